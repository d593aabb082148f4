// Runs that are watched while they run: by our page, and by the protocol's own client. Loopback only.
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import {once} from 'node:events';
import {existsSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createConnection} from 'node:net';
import {join} from 'node:path';
import {build} from 'esbuild';
import {folder, readJson} from './page.mjs';
import {followWords} from './runs.mjs';

const slowness = Number(process.env.ALIDADE_SLOWNESS ?? 1.5);
const patience_ms = 60_000;
const at = (...parts) => join(folder, 'live', ...parts);
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** Waits until it is true, not for ever. */
async function until(what, isTrue, most_ms = patience_ms) {
  for (const start = Date.now(); Date.now() - start < most_ms; await sleep(20)) if (await isTrue()) return Date.now() - start;
  throw new Error(`${what}: not within ${most_ms} ms`);
}

async function run(alidade, args) {
  const child = spawn(alidade, args, {stdio: ['ignore', 'ignore', 'pipe']});
  const [code] = await once(child, 'exit');
  assert.equal(code, 0, args.join(' '));
}

/** A command with --live on a free port, and where it is. */
async function started(alidade, args) {
  const child = spawn(alidade, [...args, '--live', '0', '--quiet'], {stdio: ['pipe', 'ignore', 'pipe']});
  let said = '';
  child.stderr.on('data', (data) => (said += data));
  child.stdin.on('error', () => undefined); // it may be gone
  const exited = once(child, 'exit');
  await until('the address', () => /live: \S+/.test(said) || child.exitCode !== null);
  const url = /live: (\S+)/.exec(said)?.[1];
  assert.ok(url, said);
  return {child, url, exited, said: () => said, end: async () => (child.kill('SIGKILL'), exited)};
}

/** Feeds rows at a rate until `stop` is called; then, or at their end, the input ends. */
function feed(child, file, hz) {
  const [head, ...rows] = readFileSync(file, 'utf8').trim().split('\n'), begin = Date.now();
  let sent = 0;
  child.stdin.write(`${head}\n`);
  const timer = setInterval(() => {
    for (; sent < rows.length && sent < ((Date.now() - begin) / 1000) * hz; ++sent) child.stdin.write(`${rows[sent]}\n`);
    if (sent === rows.length) stop();
  }, 10);
  const stop = () => (clearInterval(timer), child.stdin.end());
  return {stop, sent: () => sent};
}

async function observed(alidade, hz) {
  if (!existsSync(at('log', 'log.csv'))) await run(alidade, ['simulate', 'rotation', '--source', 'head', '--points', '8', '--duration', '60', '--out', at('log')]);
  const live = await started(alidade, ['observe', '-', '--size', '780x582', '--no-report', '--out', at('observe')]);
  return {...live, feed: feed(live.child, at('log', 'log.csv'), hz)};
}

async function page(browser, url) {
  const context = await browser.newContext({viewport: {width: 1280, height: 900}}), opened = await context.newPage(), faults = [];
  opened.setDefaultTimeout(patience_ms);
  opened.on('console', (message) => message.type() === 'error' && faults.push(`console: ${message.text()}`));
  opened.on('pageerror', (error) => faults.push(`error: ${error.message}`));
  opened.on('request', (request) => !request.url().startsWith(new URL(url).origin) && !/^(data|blob):/.test(request.url()) && faults.push(`request: ${request.url()}`));
  await opened.goto(url);
  await opened.waitForFunction(() => document.documentElement.dataset.ready === '1');
  return {page: opened, faults, close: () => context.close()};
}
const clock = (page) => page.evaluate(() => /(\d+):(\d+\.\d+)/.exec(document.querySelector('.live-facts')?.textContent ?? '')?.slice(1, 3).reduce((m, s) => 60 * Number(m) + Number(s)));

async function aRunMovesAndBecomesTheReport({browser, alidade}) {
  const live = await observed(alidade, 50), {page: seen, faults, close} = await page(browser, live.url);
  await seen.waitForFunction(() => document.querySelector('.top.live')?.dataset.state === 'live' && window.alidade.page.updates > 5);
  const before = await clock(seen), [updates, from] = await seen.evaluate(() => [window.alidade.page.updates, performance.now()]);
  await sleep(2000);
  const after = await clock(seen), [later, to] = await seen.evaluate(() => [window.alidade.page.updates, performance.now()]);
  const hz = (1000 * (later - updates)) / (to - from);
  console.log(`      ${hz.toFixed(1)} updates a second of the page`);
  assert.ok(after - before > 1 / slowness, `the clock went from ${before} to ${after}`);
  assert.ok(hz >= 20 / slowness, `${hz} updates a second`);
  await seen.keyboard.press(' ');
  const held = await seen.evaluate(() => window.alidade.page.updates);
  await sleep(500);
  assert.equal(await seen.evaluate(() => window.alidade.page.updates), held, 'space holds');
  live.feed.stop();
  await seen.waitForFunction(() => document.documentElement.dataset.live === 'ended');
  assert.equal((await live.exited)[0], 0);
  const result = readJson(at('observe', 'result.json'));
  assert.ok((await seen.locator('h1').innerText()).includes(result.verdict.sentence.slice(0, 12)));
  assert.ok((await seen.locator('main > .card').count()) >= 4);
  assert.deepEqual(faults, []);
  await close();
}

async function whoJoinsSeesMarksAtOnce({browser, alidade}) {
  const live = await observed(alidade, 50);
  await until('two seconds of rows', () => live.feed.sent() > 100);
  const {page: seen, faults, close} = await page(browser, live.url);
  await seen.waitForFunction(() => window.alidade.page.updates > 0);
  const [shown_ms, first_s, now_s] = await seen.evaluate(() => [performance.getEntriesByName('drawn')[0].startTime - performance.getEntriesByType('navigation')[0].responseEnd, window.alidade.page.rows.first, window.alidade.page.rows.time]);
  console.log(`      marks ${shown_ms.toFixed(0)} ms after the page had arrived`);
  assert.ok(shown_ms < 1000 * slowness, `${shown_ms} ms`);
  // The run itself may be behind what it was fed, so what came before the page is told by its first row.
  assert.ok(first_s < 0.1, `what was before is there: ${first_s} … ${now_s} s`);
  await seen.waitForFunction(() => window.alidade.page.rows.time > 1.5);
  assert.ok((await seen.evaluate(() => window.alidade.page.rows.first)) < 0.1, 'and stays');
  assert.deepEqual(faults, []);
  live.child.kill('SIGKILL');
  const took_ms = await until('the cross', async () => (await seen.locator('.top.live .symbol').innerText()) === '✕', 10_000);
  console.log(`      ✕ ${took_ms} ms after the run was killed`);
  assert.ok(took_ms < 2000 * slowness, `${took_ms} ms`);
  live.feed.stop();
  await close();
}

/** The package's client in a page of its own, with every message it gets. */
async function packageClient(browser) {
  const bundle = await build({stdin: {contents: "import C from '@foxglove/ws-protocol/dist/esm/src/FoxgloveClient'; window.FoxgloveClient = C;", resolveDir: import.meta.dirname ?? new URL('.', import.meta.url).pathname}, bundle: true, write: false, format: 'iife', logLevel: 'error'});
  const context = await browser.newContext(), tab = await context.newPage();
  await tab.evaluate(bundle.outputFiles[0].text);
  const connect = (url, name) => tab.evaluate(([address, protocol]) => {
    const ws = new WebSocket(address, [protocol]), client = new window.FoxgloveClient({ws}), seen = (window.seen = {channels: [], last: {}, count: 0, statuses: [], closed: null, info: null, times: 0}), topics = new Map();
    client.on('serverInfo', (info) => (seen.info = info));
    client.on('advertise', (channels) => channels.forEach((one) => (seen.channels.push(one), topics.set(client.subscribe(one.id), one.topic))));
    client.on('message', (one) => (++seen.count, (seen.last[topics.get(one.subscriptionId)] = {ns: String(one.timestamp), row: JSON.parse(new TextDecoder().decode(one.data))})));
    client.on('status', (status) => seen.statuses.push(status));
    client.on('time', () => ++seen.times);
    client.on('close', (event) => (seen.closed = event.code));
    ws.addEventListener('open', () => (seen.protocol = ws.protocol));
  }, [url.replace(/^http/, 'ws'), name]);
  return {connect, seen: () => tab.evaluate(() => window.seen), close: () => context.close()};
}

async function thePackagesClientConnectsUnderBothNames({browser, alidade}) {
  await run(alidade, ['simulate', 'track', '--scenario', 'C', '--out', at('track')]);
  for (const name of ['foxglove.sdk.v1', 'foxglove.websocket.v1']) {
    const client = await packageClient(browser);
    const live = await started(alidade, ['track', at('track', 'events.csv'), '--rig', at('track', 'rig.yaml'), '--truth', at('track', 'truth.csv'), '--live-pace', '2', '--no-report', '--out', at('tracked')]);
    await client.connect(live.url, name);
    await until('rows', async () => (await client.seen()).count > 50);
    const during = await client.seen();
    assert.equal(during.protocol, name);
    assert.deepEqual(during.info.capabilities, ['time']);
    for (const channel of during.channels) {
      assert.equal(channel.encoding, 'json');
      assert.equal(JSON.parse(channel.schema).type, 'object', channel.topic);
    }
    const topics = during.channels.map((one) => one.topic);
    for (const topic of ['/track', '/tf', '/target', '/scene', '/log', '/head1/camera', '/head2/marks']) assert.ok(topics.includes(topic), topic);
    for (const topic of ['/track', '/tf', '/target', '/scene', '/head1/camera']) assert.ok(during.last[topic], `${topic} came`);
    assert.ok(during.times > 0);
    await until('the end', async () => (await client.seen()).closed !== null);
    const {last, closed} = await client.seen(), [code] = await live.exited;
    assert.equal(code, 0);
    assert.equal(closed, 1001);
    lastStateIsTheResults(last['/track'].row, readJson(at('tracked', 'result.json')), ['steps', 'measurements']);
    await client.close();
  }
}

function lastStateIsTheResults(row, result, tables) {
  let compared = 0;
  for (const name of tables)
    for (const [column, cells] of Object.entries(result.data[name])) {
      if (column === 'thinned') continue;
      assert.deepEqual(row[column], cells[cells.length - 1], column);
      ++compared;
    }
  assert.ok(compared > 20, `${compared} columns`);
}

/** Subscribes to everything by hand, and stops reading. */
async function deafClient(url) {
  const {hostname, port, host} = new URL(url), socket = createConnection({host: hostname, port: Number(port)});
  socket.on('error', () => undefined);
  await once(socket, 'connect');
  socket.write(`GET / HTTP/1.1\r\nHost: ${host}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: foxglove.sdk.v1\r\n\r\n`);
  await once(socket, 'data');
  const text = Buffer.from(JSON.stringify({op: 'subscribe', subscriptions: Array.from({length: 12}, (_, i) => ({id: i, channelId: i + 1}))}));
  const frame = Buffer.alloc(8 + text.length); // masked by zeros
  frame.set([0x81, 0xfe, text.length >> 8, text.length & 255]);
  text.copy(frame, 8);
  socket.write(frame);
  socket.pause();
  return socket;
}

/** Processor time of the estimator's thread, and how often it waited: [s, times]. */
function mainThread(pid) {
  const stat = readFileSync(`/proc/${pid}/task/${pid}/schedstat`, 'utf8').split(' '), status = readFileSync(`/proc/${pid}/task/${pid}/status`, 'utf8');
  return [Number(stat[0]) / 1e9, Number(/\nvoluntary_ctxt_switches:\s*(\d+)/.exec(status)[1])];
}

async function aClientThatStopsReadingDoesNotSlowTheRun({alidade}) {
  writeFileSync(at('long.yaml'), 'duration_s: 400\nwarm_up_s: 2\n');
  const timed = async (clients) => {
    rmSync(at('servo'), {recursive: true, force: true});
    const live = await started(alidade, ['servo', at('long.yaml'), '--controller', 'mpc', '--seeds', '2', '--no-robustness', '--no-report', '--out', at('servo')]);
    const sockets = [];
    for (let i = 0; i < clients; ++i) sockets.push(await deafClient(live.url));
    let newest = [0, 0];
    while (live.child.exitCode === null && live.child.signalCode === null) {
      try {
        if (!existsSync(at('servo', 'result.json'))) newest = mainThread(live.child.pid); // then it waits for who still reads
      } catch { /* it ended */ }
      await sleep(10);
    }
    for (const socket of sockets) socket.destroy();
    assert.equal((await live.exited)[0], 0, live.said());
    return {seconds: readJson(at('servo', 'result.json')).seconds.run, cpu: newest[0]};
  };
  // The least of several runs, as other programs only ever add; of more runs while the machine is too busy to tell.
  const without = [], withDeaf = [], limit = 0.01 + 0.04 * slowness;
  const best = (all, what) => Math.min(...all.map((one) => one[what])), more = (what) => best(withDeaf, what) / best(without, what) - 1;
  while (without.length < 5 || (without.length < 20 && more('cpu') >= limit)) without.push(await timed(0)), withDeaf.push(await timed(4));
  console.log(`      four clients that do not read, ${without.length} pairs of runs: ${(100 * more('cpu')).toFixed(1)} % more processor time of ${best(without, 'cpu').toFixed(2)} s, ${(100 * more('seconds')).toFixed(1)} % more time`);
  // Other programs take the processor away, but are not counted in its time.
  assert.ok(more('cpu') < limit, `${more('cpu')}`);
}

/** The image, and rows of a head that follows; at the end the page is its report. */
async function aHeadThatFollowsIsSeen({browser, alidade}) {
  const live = await started(alidade, followWords(at('head'), at('head', 'out'), ['--pan-range=-40,40'])), {page: seen, faults, close} = await page(browser, live.url);
  await seen.waitForFunction(() => window.alidade.page.updates > 5 && document.querySelector('#fig-head1 canvas') !== null);
  if (process.env.SHOTS) await sleep(4000), await seen.screenshot({path: join(process.env.SHOTS, 'head-live.png'), fullPage: true});
  assert.ok((await seen.locator('#fig-error canvas').count()) >= 2 && (await seen.locator('#fig-angles canvas').count()) >= 2);
  await seen.waitForFunction(() => document.documentElement.dataset.live === 'ended');
  assert.equal((await live.exited)[0], 0, live.said());
  const result = readJson(at('head', 'out', 'result.json'));
  assert.ok(result.data.follow.t_s.length > 50 && result.estimate.forecast.rms_px > 0);
  assert.equal(await seen.locator('#fig-error, #fig-angles').count(), 2);
  assert.deepEqual(faults, []);
  await close();
}

for (const body of [aRunMovesAndBecomesTheReport, whoJoinsSeesMarksAtOnce, aClientThatStopsReadingDoesNotSlowTheRun]) body.isTimed = true;

export const tests = {
  'live: a run moves, space holds it, and it becomes the report': aRunMovesAndBecomesTheReport,
  'live: who joins sees marks at once; a killed run is crossed out': whoJoinsSeesMarksAtOnce,
  'live: the package’s client connects under both names; the last state is the result’s': thePackagesClientConnectsUnderBothNames,
  'live: a head that follows is seen, and becomes the report': aHeadThatFollowsIsSeen,
  'live: a client that stops reading does not slow the run': aClientThatStopsReadingDoesNotSlowTheRun,
};
