// Captures in a real browser: its camera is a film of rendered photos, made here. Loopback only.
import assert from 'node:assert/strict';
import {execFileSync, spawn} from 'node:child_process';
import {createHash} from 'node:crypto';
import {once} from 'node:events';
import {existsSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {request} from 'node:http';
import {join} from 'node:path';
import {inflateSync} from 'node:zlib';
import {folder, launch} from './page.mjs';

const patience_ms = 120_000, board = ['--board', '9x6', '--square', '0.025'];
const at = (...parts) => join(folder, 'capture', ...parts);
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const hash = (bytes) => createHash('sha256').update(bytes).digest('hex');

async function until(what, isTrue, most_ms = patience_ms) {
  for (const start = Date.now(); Date.now() - start < most_ms; await sleep(40)) if (await isTrue()) return;
  throw new Error(`${typeof what === 'function' ? what() : what}: not within ${most_ms} ms`);
}

/** The grey values of an 8-bit grey PNG. */
function greyOf(file) {
  const bytes = readFileSync(file), parts = [];
  let width = 0, height = 0;
  for (let i = 8; i < bytes.length;) {
    const size = bytes.readUInt32BE(i), kind = bytes.toString('latin1', i + 4, i + 8), data = bytes.subarray(i + 8, i + 8 + size);
    if (kind === 'IHDR') [width, height] = [data.readUInt32BE(0), data.readUInt32BE(4)], assert.deepEqual([...data.subarray(8, 10)], [8, 0], 'an 8-bit grey PNG');
    if (kind === 'IDAT') parts.push(data);
    i += size + 12;
  }
  const rows = inflateSync(Buffer.concat(parts)), grey = Buffer.alloc(width * height);
  for (let y = 0; y < height; ++y) {
    const filter = rows[y * (width + 1)];
    for (let x = 0; x < width; ++x) {
      const left = x > 0 ? grey[y * width + x - 1] : 0, up = y > 0 ? grey[(y - 1) * width + x] : 0, corner = x > 0 && y > 0 ? grey[(y - 1) * width + x - 1] : 0;
      const p = left + up - corner, pa = Math.abs(p - left), pb = Math.abs(p - up), pc = Math.abs(p - corner);
      grey[y * width + x] = (rows[y * (width + 1) + 1 + x] + [0, left, up, (left + up) >> 1, pa <= pb && pa <= pc ? left : pb <= pc ? up : corner][filter]) & 255;
    }
  }
  return {width, height, grey};
}

/** A film in which each photo is shown for a second: every Y plane of it by its checksum. */
function film(alidade) {
  const file = at('film.y4m'), planes = new Set();
  mkdirSync(at(), {recursive: true});
  if (!existsSync(at('in'))) execFileSync(alidade, ['simulate', 'board', ...board, '--photos', '14', '--size', '640x480', '--out', at('in'), '--quiet']);
  const photos = readdirSync(at('in')).filter((name) => name.endsWith('.png')).sort().map((name) => greyOf(at('in', name)));
  const chroma = Buffer.alloc((photos[0].width * photos[0].height) / 2, 128), parts = [Buffer.from(`YUV4MPEG2 W${photos[0].width} H${photos[0].height} F15:1 Ip A1:1 C420\n`)];
  for (const {grey} of photos) {
    planes.add(hash(grey));
    for (let i = 0; i < 15; ++i) parts.push(Buffer.from('FRAME\n'), grey, chroma);
  }
  writeFileSync(file, Buffer.concat(parts));
  return {file, planes};
}

async function started(alidade, args, name) {
  rmSync(at(name), {recursive: true, force: true});
  const child = spawn(alidade, ['calibrate', '--live', '0', ...board, ...args, '--out', at(name)], {stdio: ['ignore', 'ignore', 'pipe']});
  let said = '';
  child.stderr.on('data', (data) => (said += data));
  const exited = once(child, 'exit');
  await until(() => `the address: ${said}`, () => /live: \S+/.test(said) || child.exitCode !== null);
  const url = /live: (http:\/\/127\.0\.0\.1:\d+\/\?token=\w+)/.exec(said)?.[1];
  assert.ok(url, said);
  return {child, url, exited, said: () => said, end: async () => (child.kill('SIGKILL'), exited)};
}

async function cameraBrowser(y4m) {
  return launch(['--use-fake-ui-for-media-stream', '--use-fake-device-for-media-stream', `--use-file-for-fake-video-capture=${y4m}`]);
}
async function opened(browser, url, {width = 1280, height = 900, theme = 'light', permissions = ['camera']} = {}) {
  const context = await browser.newContext({viewport: {width, height}, colorScheme: theme, permissions}), page = await context.newPage(), faults = [];
  page.setDefaultTimeout(patience_ms);
  page.on('console', (message) => ['error', 'warning'].includes(message.type()) && faults.push(`console: ${message.text()}`));
  page.on('pageerror', (error) => faults.push(`error: ${error.message}`));
  page.on('request', (one) => !one.url().startsWith(new URL(url).origin) && !/^(data|blob):/.test(one.url()) && faults.push(`request: ${one.url()}`));
  await page.goto(url);
  await page.waitForFunction(() => document.documentElement.dataset.ready === '1');
  const data = (name) => page.evaluate((one) => document.documentElement.dataset[one], name);
  return {page, faults, data, becomes: (stage) => until(`stage ${stage}`, async () => (await data('capture')) === stage), photos: async () => Number(await data('photos')), close: () => context.close()};
}

async function aFilmIsKeptBitForBitAndBecomesTheReport({alidade}) {
  const {file, planes} = film(alidade), browser = await cameraBrowser(file);
  try {
    const run = await started(alidade, ['--until', '0.5px'], 'film');
    const shown = await opened(browser, run.url);
    await shown.becomes('looking');
    await until('four photos', async () => (await shown.photos()) >= 4 || (await shown.data('capture')) === 'ended');
    if (process.env.ALIDADE_SHOTS) await shown.page.screenshot({path: join(process.env.ALIDADE_SHOTS, 'capture-film.png'), fullPage: true});
    assert.equal(await shown.data('exact'), '1');
    if ((await shown.data('capture')) === 'looking') await shown.page.keyboard.press('Enter').catch(() => undefined);
    await shown.becomes('ended');
    await shown.page.waitForSelector('#fig-trust');
    const [code] = await run.exited;
    assert.ok(code === 0 || code === 6, `${code}: ${run.said()}`);
    assert.deepEqual(shown.faults, []);
    const rows = readFileSync(at('film', 'photos.csv'), 'utf8').trim().split('\n');
    assert.equal(rows[0], 'file,t_s,exact');
    const kept = readdirSync(at('film', 'photos')).sort();
    assert.deepEqual(rows.slice(1).map((row) => row.split(',')[0]), kept);
    for (const name of kept) assert.ok(planes.has(hash(greyOf(at('film', 'photos', name)).grey)), `${name} is no frame of the film`);
    for (const row of rows.slice(1)) assert.equal(row.split(',')[2], '1');
    rmSync(at('batch'), {recursive: true, force: true});
    try {
      execFileSync(alidade, ['calibrate', at('film', 'photos'), ...board, '--out', at('batch'), '--quiet'], {stdio: 'pipe'});
    } catch (error) {
      assert.equal(error.status, code);
    }
    assert.equal(readFileSync(at('batch', 'camera.yaml'), 'utf8'), readFileSync(at('film', 'camera.yaml'), 'utf8'));
    await shown.close();
  } finally {
    await browser.close();
  }
}

async function theKeyboardAloneSteersIt({alidade}) {
  const {file} = film(alidade), browser = await cameraBrowser(file);
  try {
    const run = await started(alidade, ['--until', '0.001px'], 'keys'), shown = await opened(browser, run.url);
    await shown.becomes('looking');
    await until('a photo', async () => (await shown.photos()) >= 1);
    await shown.page.keyboard.press('p');
    await shown.becomes('paused');
    const before = await shown.photos();
    let taken = before;
    for (let i = 0; i < 20 && taken <= before; ++i) {
      await shown.page.keyboard.press(' ');
      await sleep(600);
      taken = await shown.photos();
    }
    assert.ok(taken > before, 'space takes one');
    await shown.page.keyboard.press('u');
    await until('undone', async () => (await shown.photos()) === taken - 1);
    await shown.page.keyboard.press('m');
    assert.equal(await shown.page.getAttribute('#mirror', 'aria-pressed'), 'true');
    for (const id of ['camera', 'take', 'undo', 'pause', 'end']) assert.ok(await shown.page.isVisible(`#${id}`), id);
    const second = await opened(browser, run.url);
    await second.becomes('watching');
    assert.ok(await second.page.isDisabled('#take'));
    await until('it watches', async () => (await second.photos()) === (await shown.photos()));
    assert.deepEqual(second.faults, []);
    await second.close();
    await shown.page.keyboard.press('p');
    await shown.becomes('looking');
    await until('three photos', async () => (await shown.photos()) >= 3);
    for (const [width, height] of [[1280, 900], [800, 900], [390, 844]]) {
      await shown.page.setViewportSize({width, height});
      for (const theme of ['light', 'dark']) {
        await shown.page.emulateMedia({colorScheme: theme});
        await sleep(250);
        const wide = await shown.page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
        assert.ok(wide <= 0, `${width} ${theme}: ${wide} px too wide`);
        if (process.env.ALIDADE_SHOTS) await shown.page.screenshot({path: join(process.env.ALIDADE_SHOTS, `capture-${width}-${theme}.png`), fullPage: true});
      }
    }
    const frames = await shown.page.evaluate(() => new Promise((done) => {
      let count = 0;
      const begin = performance.now(), step = () => (performance.now() - begin > 2000 ? done(count / 2) : (++count, requestAnimationFrame(step)));
      requestAnimationFrame(step);
    }));
    console.log(`      ${frames.toFixed(0)} frames a second`);
    await shown.page.keyboard.press('Enter');
    await shown.becomes('ended');
    assert.deepEqual(shown.faults, []);
    await run.exited;
    await shown.close();
  } finally {
    await browser.close();
  }
}

/** Status of an HTTP request, an upgrade to a WebSocket among them: 101 where it is granted. */
function statusOf(url, headers = {}) {
  return new Promise((done, failed) => {
    const {hostname, port, pathname, search} = new URL(url);
    const one = request({hostname, port, path: pathname + search, headers}, (response) => (response.resume(), done(response.statusCode)));
    one.on('upgrade', (response, socket) => (socket.destroy(), done(response.statusCode)));
    one.on('error', failed);
    one.end();
  });
}

async function onlyItsOwnPageMayWrite({alidade}) {
  const run = await started(alidade, [], 'guarded');
  try {
    const {origin, host, search} = new URL(run.url), socket = `${origin}/capture`;
    const upgrade = {Connection: 'Upgrade', Upgrade: 'websocket', 'Sec-WebSocket-Version': '13', 'Sec-WebSocket-Key': 'dGhlIHNhbXBsZSBub25jZQ=='};
    assert.equal(await statusOf(run.url), 200);
    assert.equal(await statusOf(`${socket}${search}`, {...upgrade, Origin: origin}), 101);
    assert.equal(await statusOf(`${origin}/`), 403);
    assert.equal(await statusOf(`${origin}/?token=0`), 403);
    assert.equal(await statusOf(run.url, {Host: 'evil.example'}), 403);
    assert.equal(await statusOf(socket, {...upgrade, Origin: origin}), 403);
    assert.equal(await statusOf(`${socket}?token=0`, {...upgrade, Origin: origin}), 403);
    assert.equal(await statusOf(`${socket}${search}`, {...upgrade, Origin: 'http://evil.example'}), 403);
    assert.equal(await statusOf(`${socket}${search}`, {...upgrade, Origin: origin, Host: `evil.example:${host.split(':')[1]}`}), 403);
  } finally {
    await run.end();
  }
}

async function aRefusedCameraIsSaid({alidade, browser}) {
  const run = await started(alidade, [], 'refused'), shown = await opened(browser, run.url, {permissions: []});
  try {
    await shown.becomes('refused');
    assert.deepEqual(shown.faults, []);
    if (process.env.ALIDADE_SHOTS) await shown.page.screenshot({path: join(process.env.ALIDADE_SHOTS, 'capture-refused.png')});
    await run.end();
    await shown.becomes('lost');
  } finally {
    await shown.close();
    await run.end();
  }
}

export const tests = {
  'capture: a film is kept bit for bit, guided, and the page becomes the report': aFilmIsKeptBitForBitAndBecomesTheReport,
  'capture: the keyboard alone steers it; another page watches': theKeyboardAloneSteersIt,
  'capture: only its own page may write': onlyItsOwnPageMayWrite,
  'capture: a refused camera is said, and so is a run that has gone': aRefusedCameraIsSaid,
};
