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
export const at = (...parts) => join(folder, 'capture', ...parts);
export const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
export const hash = (bytes) => createHash('sha256').update(bytes).digest('hex');

export async function until(what, isTrue, most_ms = patience_ms) {
  for (const start = Date.now(); Date.now() - start < most_ms; await sleep(40)) if (await isTrue()) return;
  throw new Error(`${typeof what === 'function' ? what() : what}: not within ${most_ms} ms`);
}

/** The grey values of an 8-bit grey PNG. */
export function greyOf(file) {
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
export function film(alidade) {
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

export async function started(alidade, args, name, job = ['calibrate', ...board], goesOn = false) {
  if (!goesOn) rmSync(at(name), {recursive: true, force: true});
  const child = spawn(alidade, [job[0], '--live', '0', ...job.slice(1), ...args, '--out', at(name)], {stdio: ['ignore', 'ignore', 'pipe']});
  let said = '';
  child.stderr.on('data', (data) => (said += data));
  const exited = once(child, 'exit');
  await until(() => `the address: ${said}`, () => /live: \S+/.test(said) || child.exitCode !== null);
  const url = /live: (http:\/\/127\.0\.0\.1:\d+\/\?token=\w+)/.exec(said)?.[1];
  assert.ok(url, said);
  return {child, url, exited, said: () => said, end: async () => (child.kill('SIGKILL'), exited)};
}

export async function cameraBrowser(y4m) {
  return launch(['--use-fake-ui-for-media-stream', '--use-fake-device-for-media-stream', `--use-file-for-fake-video-capture=${y4m}`]);
}
/** Counts the images that the page is handed and those it closes. */
function countImages() {
  const counts = (window.images = {read: 0, open: new Set()}), {read} = ReadableStreamDefaultReader.prototype, {close} = VideoFrame.prototype;
  ReadableStreamDefaultReader.prototype.read = async function () {
    const chunk = await read.call(this);
    if (chunk.value instanceof VideoFrame) ++counts.read, counts.open.add(chunk.value);
    return chunk;
  };
  VideoFrame.prototype.close = function () {
    counts.open.delete(this);
    close.call(this);
  };
}
// The browser's own word on images that nobody closes: a loaded one says it of images that it made and never handed over. What was handed over is counted instead.
const isOfImages = (message) => message.text().startsWith('A VideoFrame was garbage collected');

export async function opened(browser, url, {width = 1280, height = 900, theme = 'light', permissions = ['camera'], before = null} = {}) {
  const context = await browser.newContext({viewport: {width, height}, colorScheme: theme, permissions}), page = await context.newPage(), faults = [];
  page.setDefaultTimeout(patience_ms);
  await page.addInitScript(countImages);
  if (before) await page.addInitScript(before);
  page.on('console', (message) => !isOfImages(message) && ['error', 'warning'].includes(message.type()) && faults.push(`console: ${message.text()}`));
  page.on('pageerror', (error) => faults.push(`error: ${error.message}`));
  page.on('request', (one) => !one.url().startsWith(new URL(url).origin) && !/^(data|blob):/.test(one.url()) && faults.push(`request: ${one.url()}`));
  await page.goto(url);
  await page.waitForFunction(() => document.documentElement.dataset.ready === '1');
  const data = (name) => page.evaluate((one) => document.documentElement.dataset[one], name);
  return {page, faults, data, becomes: (stage) => until(`stage ${stage}`, async () => (await data('capture')) === stage), photos: async () => Number(await data('photos')), close: () => context.close()};
}

/** Both themes, a desk's, a small and a telephone's width: nothing is cut off. */
async function fitsEveryWindow(page, name) {
  for (const [width, height] of [[1280, 900], [800, 900], [390, 844]]) {
    await page.setViewportSize({width, height});
    for (const theme of ['light', 'dark']) {
      await page.emulateMedia({colorScheme: theme});
      await sleep(250);
      const wide = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
      assert.ok(wide <= 0, `${width} ${theme}: ${wide} px too wide`);
      if (process.env.ALIDADE_SHOTS) await page.screenshot({path: join(process.env.ALIDADE_SHOTS, `${name}-${width}-${theme}.png`), fullPage: true});
    }
  }
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
    const images = () => shown.page.evaluate(() => ({read: window.images.read, open: window.images.open.size}));
    assert.ok((await images()).read > 4);
    await until('every image is closed', async () => (await images()).open === 0, 10_000);
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
    await until('it says where the image is', async () => /in the page in control/.test(await second.page.textContent('.capture-none')), 10_000);
    await second.page.keyboard.press('?');
    const keys = await second.page.locator('dialog.help kbd').allTextContents();
    assert.deepEqual(keys, ['space', 'u', 'p', 'Enter', 'm', 'd', 'Esc', '?']);
    await second.page.keyboard.press('Escape');
    assert.ok(!(await second.page.locator('dialog.help').isVisible()));
    await until('it watches', async () => (await second.photos()) === (await shown.photos()));
    assert.deepEqual(second.faults, []);
    await second.close();
    await shown.page.keyboard.press('p');
    await shown.becomes('looking');
    await until('three photos', async () => (await shown.photos()) >= 3);
    await fitsEveryWindow(shown.page, 'capture');
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

async function aMissingCameraIsSaid({alidade, browser}) {
  const run = await started(alidade, [], 'refused'), shown = await opened(browser, run.url, {permissions: []});
  try {
    await shown.becomes('refused');
    assert.match(await shown.page.textContent('h1'), /there is no camera/);
    assert.deepEqual(shown.faults, []);
    if (process.env.ALIDADE_SHOTS) await shown.page.screenshot({path: join(process.env.ALIDADE_SHOTS, 'capture-refused.png')});
    await run.end();
    await shown.becomes('lost');
  } finally {
    await shown.close();
    await run.end();
  }
}

async function aCanvasIsNotExactAndSaysSo({alidade}) {
  const {file, planes} = film(alidade), browser = await cameraBrowser(file);
  try {
    const run = await started(alidade, ['--until', '0.001px'], 'canvas');
    const shown = await opened(browser, run.url, {before: () => delete window.MediaStreamTrackProcessor});
    await shown.becomes('looking');
    await until('four photos', async () => (await shown.photos()) >= 4);
    assert.equal(await shown.data('exact'), '0');
    assert.match(await shown.page.textContent('.capture-notes'), /canvas/);
    await shown.page.keyboard.press('Enter');
    await shown.becomes('ended');
    await run.exited;
    assert.deepEqual(shown.faults, []);
    const rows = readFileSync(at('canvas', 'photos.csv'), 'utf8').trim().split('\n').slice(1);
    assert.ok(rows.length >= 4 && rows.every((row) => row.split(',')[2] === '0'), rows.join(' '));
    for (const row of rows) assert.ok(!planes.has(hash(greyOf(at('canvas', 'photos', row.split(',')[0])).grey)), 'a canvas changes values');
    const checks = JSON.parse(readFileSync(at('canvas', 'result.json'), 'utf8')).verdict.checks.map((one) => one.text);
    assert.ok(checks.some((text) => /not the camera.s own values/.test(text)), checks.join(' | '));
    await shown.close();
  } finally {
    await browser.close();
  }
}

async function aCameraThatGoesIsSaidAndComesBack({alidade}) {
  const {file} = film(alidade), browser = await cameraBrowser(file);
  try {
    const run = await started(alidade, ['--until', '0.001px'], 'unplugged'), shown = await opened(browser, run.url);
    await shown.becomes('looking');
    await until('two photos', async () => (await shown.photos()) >= 2);
    // What a browser does when the camera is pulled out, or taken away by its owner.
    await shown.page.evaluate(() => {
      const [track] = document.querySelector('#camera').srcObject.getVideoTracks();
      track.stop();
      track.dispatchEvent(new Event('ended'));
    });
    await shown.becomes('lost');
    assert.match(await shown.page.textContent('.capture-notes'), /the camera is gone/);
    const kept = readdirSync(at('unplugged', 'photos')).length;
    assert.ok(kept >= 2);
    await shown.page.reload();
    await shown.becomes('looking');
    await until('more photos', async () => (await shown.photos()) > kept);
    assert.deepEqual(shown.faults, []);
    await run.end();
    await shown.becomes('lost');
    await shown.close();
  } finally {
    await browser.close();
  }
}

async function aFolderIsShownAndSteered({alidade, browser}) {
  film(alidade);
  const run = await started(alidade, ['--until', '0.001px', '--from', at('in')], 'folder'), shown = await opened(browser, run.url, {permissions: []});
  try {
    await shown.becomes('looking');
    await until('four photos', async () => (await shown.photos()) >= 4);
    assert.equal(await shown.page.evaluate(() => document.querySelector('#camera').width > 300), true);
    await shown.page.keyboard.press('u');
    await shown.page.keyboard.press('Enter');
    await shown.becomes('ended');
    assert.deepEqual(shown.faults, []);
  } finally {
    await shown.close();
    await run.end();
  }
}

async function shotsOfARangefinderAreGuided({alidade, browser}) {
  const made = at('shots-made'), incoming = at('shots-in');
  for (const one of [made, incoming]) rmSync(one, {recursive: true, force: true});
  mkdirSync(incoming, {recursive: true});
  execFileSync(alidade, ['simulate', 'rangefinder', '--photos', '--out', made, '--quiet']);
  const [head, ...rows] = readFileSync(join(made, 'shots.csv'), 'utf8').trim().split('\n').map((row) => row.split(','));
  const column = (name) => head.indexOf(name);
  const job = ['rangefinder', '--camera', join(made, 'camera.yaml'), '--board', '9x6', '--square', '0.04'];
  const run = await started(alidade, ['--from', incoming], 'shots', job), shown = await opened(browser, run.url, {permissions: []});
  try {
    await shown.becomes('looking');
    await shown.page.keyboard.press(' ');
    await shown.page.keyboard.press('Enter');
    assert.match(await shown.page.textContent('.capture-advice'), /enter the rangefinder/);
    const most = Math.min(7, rows.length);
    for (let i = 0; i < most; ++i) {
      const before = await shown.page.evaluate(() => window.alidade.page.view.drawings);
      const name = rows[i][column('photo')], bytes = readFileSync(join(made, name));
      writeFileSync(join(incoming, `${String(i).padStart(3, '0')}.png`), bytes);
      await until('the image', async () => (await shown.page.evaluate(() => window.alidade.page.view.drawings)) > before && /hold it still/.test(await shown.page.textContent('.capture-advice')));
      await shown.page.keyboard.press(' '); // to the field
      await shown.page.keyboard.type(rows[i][column('range_m')]);
      await shown.page.keyboard.press('Enter');
      await until(`shot ${i + 1}`, async () => (await shown.photos()) === i + 1);
    }
    assert.match(await shown.page.textContent('.capture-figure'), /mm/);
    assert.match(await shown.page.textContent('#fig-camera'), /Next: .*m away/);
    await fitsEveryWindow(shown.page, 'shots');
    await shown.page.keyboard.press('Escape');
    await shown.page.keyboard.press('u');
    await until('undone', async () => (await shown.photos()) === most - 1);
    await shown.page.keyboard.press('Enter');
    await shown.becomes('ended');
    assert.deepEqual(shown.faults, []);
    const [code] = await run.exited;
    assert.ok(code === 0 || code === 6, `${code}: ${run.said()}`);
    assert.equal(readFileSync(at('shots', 'shots.csv'), 'utf8').trim().split('\n').length, most);
    rmSync(at('shots-batch'), {recursive: true, force: true});
    try {
      execFileSync(alidade, ['rangefinder', at('shots', 'shots.csv'), ...job.slice(1), '--out', at('shots-batch'), '--quiet'], {stdio: 'pipe'});
    } catch (error) {
      assert.equal(error.status, code);
    }
    assert.equal(readFileSync(at('shots-batch', 'rangefinder.yaml'), 'utf8'), readFileSync(at('shots', 'rangefinder.yaml'), 'utf8'));
  } finally {
    await shown.close();
    await run.end();
  }
}

export const tests = {
  'capture: a film is kept bit for bit, guided, and the page becomes the report': aFilmIsKeptBitForBitAndBecomesTheReport,
  'capture: the keyboard alone steers it; another page watches': theKeyboardAloneSteersIt,
  'capture: only its own page may write': onlyItsOwnPageMayWrite,
  'capture: a camera that is not there is said, and so is a run that has gone': aMissingCameraIsSaid,
  'capture: a canvas where the browser has nothing better: not exact, and said': aCanvasIsNotExactAndSaysSo,
  'capture: a camera that is unplugged is said, its photos stay, and it goes on': aCameraThatGoesIsSaidAndComesBack,
  'capture: a folder is shown and steered': aFolderIsShownAndSteered,
  'capture: shots of a rangefinder are guided, by keys alone, and are those of the batch': shotsOfARangefinderAreGuided,
};
