// Captures in a real browser: photos that others took, what breaks off, and what a page may not send.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {existsSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {Socket} from 'node:net';
import {randomBytes} from 'node:crypto';
import {dirname, join, resolve} from 'node:path';
import {at, cameraBrowser, film, greyOf, hash, opened, sleep, started, until} from './capture.mjs';
import {launch} from './page.mjs';

const frames_a_photo = 15;

/** A film in which each photo is shown for 15 frames; the checksums of its Y planes. */
function filmOf(files, name) {
  mkdirSync(at(), {recursive: true});
  const file = at(`${name}.y4m`), planes = new Set(), parts = [Buffer.from('YUV4MPEG2 W640 H480 F15:1 Ip A1:1 C420\n')];
  const chroma = Buffer.alloc(640 * 240, 128);
  for (const photo of files) {
    const grey = execFileSync('ffmpeg', ['-v', 'error', '-i', photo, '-f', 'rawvideo', '-pix_fmt', 'gray', '-'], {maxBuffer: 1 << 24});
    assert.equal(grey.length, 640 * 480, photo);
    planes.add(hash(grey));
    for (let i = 0; i < frames_a_photo; ++i) parts.push(Buffer.from('FRAME\n'), grey, chroma);
  }
  writeFileSync(file, Buffer.concat(parts));
  return {file, planes};
}

/** alidade calibrate, whose verdict may be that care is needed. */
function batch(alidade, photos, board, out) {
  rmSync(at(out), {recursive: true, force: true});
  try {
    execFileSync(alidade, ['calibrate', photos, ...board, '--out', at(out), '--quiet', '--no-report'], {stdio: 'pipe'});
  } catch (error) {
    if (error.status !== 6) throw error;
  }
  return readFileSync(at(out, 'camera.yaml'), 'utf8');
}

async function realPhotosGiveTheCameraOfTheBatch(alidade, name, files, board) {
  const {file, planes} = filmOf(files, name), browser = await cameraBrowser(file);
  try {
    const run = await started(alidade, ['--until', '0.001px'], name, ['calibrate', ...board]), shown = await opened(browser, run.url);
    await shown.becomes('looking');
    // One that brings less than half of what was asked for is waited for, up to 12 s.
    await until('three photos by itself', async () => (await shown.photos()) >= 3, 60_000);
    const byItself = await shown.photos();
    for (let i = 0; i < files.length; ++i) { // in the next one each is taken by hand
      await shown.page.keyboard.press(' ');
      await sleep(1000);
    }
    await shown.page.keyboard.press('Enter');
    await shown.becomes('ended');
    await run.exited;
    assert.deepEqual(shown.faults, []);
    const kept = readdirSync(at(name, 'photos')).sort();
    console.log(`      ${name}: ${byItself} photos taken automatically, ${kept.length} in all, of ${planes.size}`);
    assert.ok(kept.length >= 0.8 * files.length, `${kept.length}`);
    for (const one of kept) assert.ok(planes.has(hash(greyOf(at(name, 'photos', one)).grey)), `${one} is no frame of the film`);
    assert.equal(readFileSync(at(name, 'camera.yaml'), 'utf8'), batch(alidade, at(name, 'photos'), board, `${name}-batch`));
    await shown.close();
  } finally {
    await browser.close();
  }
}

async function bouguetsPhotosGiveTheCameraOfTheBatch({alidade}) {
  const folder = join(process.env.ALIDADE_DATA ?? '/none', 'data', 'bouguet-example1');
  if (!existsSync(folder)) return console.log('      skipped: ALIDADE_DATA is not set');
  const files = Array.from({length: 20}, (_, i) => join(folder, `Image${i + 1}.tif`));
  await realPhotosGiveTheCameraOfTheBatch(alidade, 'bouguet', files, ['--board', '12x13', '--square', '0.03']);
}

/** Where `make demo` puts them. */
async function openCvsPhotosGiveTheCameraOfTheBatch({alidade}) {
  const folder = resolve(dirname(alidade), '../demo/photos');
  if (!existsSync(folder)) return console.log('      skipped: make demo downloads them');
  const files = readdirSync(folder).filter((name) => name.endsWith('.jpg')).sort().map((name) => join(folder, name));
  await realPhotosGiveTheCameraOfTheBatch(alidade, 'opencv', files, ['--board', '9x6', '--square', '0.025']);
}

async function aKilledRunGoesOnWithEveryPhoto({alidade}) {
  const {file} = film(alidade), browser = await cameraBrowser(file);
  try {
    const run = await started(alidade, ['--until', '0.001px'], 'killed'), shown = await opened(browser, run.url);
    await until('three photos', async () => (await shown.photos()) >= 3);
    await run.end(); // kill -9
    await shown.becomes('lost');
    assert.equal(await shown.page.textContent('.capture-advice'), 'nothing is taken any more');
    await shown.close();
    const kept = readdirSync(at('killed', 'photos')).sort(), bytes = kept.map((name) => hash(readFileSync(at('killed', 'photos', name))));
    const again = await started(alidade, ['--until', '0.001px', '--resume', at('killed')], 'killed', undefined, true);
    const second = await opened(browser, again.url);
    await second.becomes('looking');
    await until('those and more', async () => (await second.photos()) > kept.length);
    await second.page.keyboard.press('Enter');
    await second.becomes('ended');
    await again.exited;
    assert.deepEqual(second.faults, []);
    assert.deepEqual(kept.map((name) => hash(readFileSync(at('killed', 'photos', name)))), bytes);
    const now = readdirSync(at('killed', 'photos')).sort();
    assert.deepEqual(now.slice(0, kept.length), kept);
    assert.deepEqual(readFileSync(at('killed', 'photos.csv'), 'utf8').trim().split('\n').slice(1).map((row) => row.split(',')[0]), now);
    await second.close();
  } finally {
    await browser.close();
  }
}

/** Whether frames of a server, unmasked, hold one that closes. */
function hasCloseFrame(bytes) {
  for (let i = 0; i + 2 <= bytes.length;) {
    if ((bytes[i] & 0x0f) === 8) return true;
    const short = bytes[i + 1] & 0x7f;
    if (short === 126 && i + 4 > bytes.length) return false;
    i += short === 126 ? 4 + bytes.readUInt16BE(i + 2) : short === 127 ? 10 + Number(bytes.readBigUInt64BE(i + 2)) : 2 + short;
  }
  return false;
}
/** A WebSocket without a browser: what it sends, and whether the other side closes it. */
async function rawSocket(url) {
  const {hostname, port, search} = new URL(url), socket = new Socket();
  let isClosed = false, said = '';
  socket.on('data', (data) => {
    said += data.toString('latin1');
    const begin = said.indexOf('\r\n\r\n');
    if (begin >= 0 && hasCloseFrame(Buffer.from(said.slice(begin + 4), 'latin1'))) isClosed = true;
  });
  socket.on('close', () => (isClosed = true));
  socket.on('error', () => undefined);
  await new Promise((done) => socket.connect(Number(port), hostname, done));
  socket.write(`GET /capture${search} HTTP/1.1\r\nHost: ${hostname}:${port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: ${randomBytes(16).toString('base64')}\r\n\r\n`);
  await until('the upgrade', () => said.includes(' 101 '));
  const head = (size) => { // the shortest form of the length; masked with zeros: as it is
    const bytes = Buffer.alloc(size < 126 ? 6 : size < 65536 ? 8 : 14);
    bytes[0] = 0x82, bytes[1] = 0x80 | Math.min(size, size < 65536 ? 126 : 127);
    if (size >= 65536) bytes.writeBigUInt64BE(BigInt(size), 2);
    else if (size >= 126) bytes.writeUInt16BE(size, 2);
    return bytes;
  };
  return {
    send: (body) => socket.write(Buffer.concat([head(body.length), body])),
    announce: (size) => socket.write(head(size)),
    isClosed: () => isClosed,
    close: () => socket.destroy(),
  };
}
function imageOf(width, height, magic = 'ADY1') {
  const body = Buffer.alloc(16 + width * height, 90);
  body.write(magic, 0, 'latin1');
  [width, height, 1].forEach((value, i) => body.writeUInt32LE(value, 4 + 4 * i));
  return body;
}

async function sizeAndRateOfImagesAreBounded({alidade}) {
  const run = await started(alidade, [], 'bounded');
  try {
    const good = await rawSocket(run.url);
    for (let i = 0; i < 30; ++i) {
      good.send(imageOf(64, 48));
      await sleep(20);
    }
    assert.equal(good.isClosed(), false, 'fifty a second are fine');
    for (let i = 0; i < 200; ++i) good.send(imageOf(64, 48));
    await until('too many a second are closed', () => good.isClosed(), 5000);
    const large = await rawSocket(run.url);
    large.announce(65 << 20);
    await until('too large is closed', () => large.isClosed(), 5000);
    for (const wrong of [imageOf(64, 48).subarray(0, 1000), imageOf(64, 48, 'NONE'), Buffer.from('ADY1')]) {
      const socket = await rawSocket(run.url);
      socket.send(wrong);
      await until('what is no image is closed', () => socket.isClosed(), 5000);
    }
    const after = await rawSocket(run.url); // the run goes on
    after.send(imageOf(64, 48));
    await sleep(300);
    assert.equal(after.isClosed(), false);
    after.close();
    assert.equal(run.child.exitCode, null);
  } finally {
    await run.end();
  }
}

async function aDeniedCameraIsNamedAndAskedForAgain({alidade}) {
  const browser = await launch(['--use-fake-device-for-media-stream', '--deny-permission-prompts']);
  try {
    const run = await started(alidade, [], 'denied'), shown = await opened(browser, run.url, {permissions: []});
    await shown.becomes('refused');
    assert.match(await shown.page.textContent('h1'), /the camera was refused/);
    assert.match(await shown.page.textContent('.capture-none'), /allow the camera/);
    for (const id of ['take', 'undo', 'pause']) assert.ok(await shown.page.isDisabled(`#${id}`), id);
    if (process.env.ALIDADE_SHOTS) await shown.page.screenshot({path: join(process.env.ALIDADE_SHOTS, 'capture-denied.png')});
    await shown.page.context().grantPermissions(['camera']);
    await shown.page.locator('button', {hasText: 'ask again'}).press('Enter');
    await shown.becomes('looking');
    assert.deepEqual(shown.faults, []);
    await shown.close();
    await run.end();
  } finally {
    await browser.close();
  }
}

export const tests = {
  'capture: a denied camera is named, and asked for again': aDeniedCameraIsNamedAndAskedForAgain,
  'capture: Bouguet’s photos as a film give the camera of the batch': bouguetsPhotosGiveTheCameraOfTheBatch,
  'capture: OpenCV’s photos as a film give the camera of the batch': openCvsPhotosGiveTheCameraOfTheBatch,
  'capture: a killed run goes on with every photo': aKilledRunGoesOnWithEveryPhoto,
  'capture: size and rate of images are bounded': sizeAndRateOfImagesAreBounded,
};
