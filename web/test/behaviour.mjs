// What a person does with a page: opens it, reads it, points at it, chooses, prints.
import assert from 'node:assert/strict';
import {settled} from './page.mjs';

const expected = {
  calibrate: ['estimate', 'trust', 'residuals', 'photos', 'poses', 'photo', 'all-photos', 'halves', 'lens', 'board', 'next', 'undistorted'],
  'camera diff': ['diff', 'diagonal', 'parameters', 'estimate'],
  observe: ['estimate', 'intrinsics', 'motion', 'nis', 'tracks', 'directions', 'points'],
  rangefinder: ['estimate', 'beam', 'residuals', 'photo', 'precision', 'next', 'counts', 'all-photos'],
  rig: ['estimate', 'space', 'coverage', 'residuals', 'view', 'unknown'],
  track: ['path', 'position', 'error', 'innovations', 'estimate', 'above', 'age'],
  servo: ['error', 'picture', 'angles', 'compare', 'robust', 'loops', 'lenses', 'focal'],
  identify: ['estimate', 'response', 'spread', 'checks'],
  'head, following': ['estimate', 'error', 'angles', 'checks'],
  'plan calibrate': ['estimate', 'plan', 'sketches'], 'plan observe': ['estimate', 'plan'], 'plan rangefinder': ['estimate', 'plan', 'sketches'],
  'rig, moving target': ['estimate', 'space', 'above', 'clocks'],
  localize: ['path', 'error', 'frame', 'tracks', 'nis', 'speed', 'estimate'],
  reproduce: ['estimate', 'experiments', 'paper-4', 'paper-6', 'paper-8', 'paper-table_2', 'methods'],
};

/** Ids of figures whose canvases have one colour only, and of those that do not draw as many marks as rows. */
const emptyFigures = () => {
  const isBlank = (canvas) => {
    if (canvas.width < 2 || canvas.height < 2) return true;
    const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
    const pixels = new Uint32Array(data.buffer);
    return pixels.every((pixel) => pixel === pixels[0]);
  };
  return [...document.querySelectorAll('main > .card')].filter((card) => card.dataset.marks !== card.dataset.rows || Number(card.dataset.marks) === 0 ||
    [...card.querySelectorAll('canvas')].some((canvas) => canvas.checkVisibility() && isBlank(canvas))).map((card) => card.id);
};

const pages = {}; // one a theme, in which the documents are shown one after the other

export async function opensAndDraws({open, urlOf, documents}, name) {
  const {document} = documents[name], isRefused = name.endsWith('refused');
  for (const [width, theme] of [[1500, 'light'], [600, 'dark']]) {
    const {page, faults, show} = (pages[theme] ??= await open('about:blank', {width, theme}));
    faults.length = 0;
    await show(urlOf(name));
    await settled(page, {whole: theme === 'light'});
    assert.deepEqual(faults, []);
    assert.equal(await page.locator('[data-failed]').count(), 0, 'a figure failed');
    const heading = await page.locator('h1').innerText();
    assert.ok(heading.includes(document.verdict.sentence.slice(document.verdict.sentence.startsWith('Usable with care') ? 16 : 0).trim()), heading);
    assert.equal(await page.locator('header').getAttribute('data-state'), document.verdict.state);
    assert.doesNotMatch(await page.locator('header').innerText(), /NaN|undefined|Infinity/);
    const ids = (await page.locator('main > .card').evaluateAll((cards) => cards.map((card) => card.id.replace('fig-', ''))));
    if (isRefused) assert.ok(ids.includes('refusal'), ids.join());
    else for (const id of expected[name]) assert.ok(ids.includes(id), `no figure ${id} among ${ids}`);
    assert.deepEqual(await page.evaluate(emptyFigures), [], 'figures with nothing in them');
    const over = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    assert.ok(over <= 1, `${over} px wider than the window`);
  }
}

/** Words beside the pointer over a place of a figure. */
async function tipAt(page, id, index) {
  const place = await page.evaluate(([id_, index_]) => {
    const card = window.alidade.cards.find((one) => one.figure.id === id_);
    const chart = [...window.alidade.charts].find((one) => card.section.contains(one.box) && one.hits.length > 0);
    chart.canvas.scrollIntoView({block: 'center'});
    const hit = chart.hits[index_ < 0 ? chart.hits.length + index_ : index_], box = chart.canvas.getBoundingClientRect();
    return {x: box.left + hit.x, y: box.top + hit.y};
  }, [id, index]);
  await page.mouse.move(place.x - 1, place.y);
  await page.mouse.move(place.x, place.y);
  return {words: await page.locator('.tip').innerText(), place};
}

const near = (text, value, digits = 3) => text.replace(/−/g, '-').match(/-?\d+(\.\d+)?(e-?\d+)?/g)?.some((word) => Math.abs(Number(word) - value) <= Math.abs(value) * 0.6 * 10 ** -digits + 1e-12);

async function hoverSaysTheValue({open, url, calibration}) {
  const document = calibration(6), {photos} = document.data, {page, close} = await open(url(document));
  const worst = photos.rms_px.map((rms, i) => [rms ?? -1, i]).sort((a, b) => b[0] - a[0]);
  for (const place of [0, 2, 4]) {
    const {words} = await tipAt(page, 'photos', place);
    assert.ok(words.includes(photos.name[worst[place][1]]) && near(words, worst[place][0]), words);
  }
  // The map of 3σ: at the image's middle, a quarter and a corner.
  await page.locator('#fig-trust canvas').first().evaluate((canvas) => canvas.scrollIntoView({block: 'center'}));
  const box = await page.locator('#fig-trust canvas').first().boundingBox();
  for (const share of [0.5, 0.25, 0.02]) {
    await page.mouse.move(box.x + share * box.width, box.y + share * box.height);
    const words = await page.locator('.tip').innerText(), grid = document.grids.sigma_infinity;
    const [u, v] = words.match(/-?[\d.]+/g).map(Number);
    const value = 3 * grid.sigma_px[Math.round(v / grid.dv_px) * grid.cols + Math.round(u / grid.du_px)];
    const said = Number(words.split('3σ ')[1].split(' ')[0]);
    assert.ok(Math.abs(said - value) < 0.12 * value, `${words} beside ${value}`);
  }
  await close();
}

async function choosingLightsUpEverywhere({open, url, calibration}) {
  const document = calibration(6), {page, close} = await open(url(document));
  const first = await page.locator('#fig-photo .caption').innerText();
  await page.keyboard.press('ArrowRight');
  const second = await page.locator('#fig-photo .caption').innerText();
  assert.notEqual(first, second);
  const {place} = await tipAt(page, 'photos', 3);
  await page.mouse.click(place.x, place.y);
  const chosen = await page.evaluate(() => window.alidade.selection.item), name = document.data.photos.name[chosen];
  assert.ok((await page.locator('#fig-photo .caption').innerText()).includes(name));
  assert.equal(await page.locator('#fig-all-photos button[aria-pressed=true]').getAttribute('data-item'), String(chosen));
  await page.locator('#fig-all-photos button').last().click();
  assert.notEqual(await page.evaluate(() => window.alidade.selection.item), chosen);
  await close();
}

async function aTimeIsChosenInAllFigures({open, urlOf}) {
  const {page, faults, close} = await open(urlOf('track'));
  await settled(page);
  await page.locator('#fig-position .u-over').first().scrollIntoViewIfNeeded();
  const box = await page.locator('#fig-position .u-over').first().boundingBox();
  await page.mouse.move(box.x + 0.5 * box.width, box.y + 20);
  assert.match(await page.locator('.tip').innerText(), /^[\d.]+ s\nx .*±/);
  await page.mouse.click(box.x + 0.5 * box.width, box.y + 20);
  const time = await page.evaluate(() => window.alidade.selection.time);
  assert.ok(time > 3 && time < 8, `time ${time}`);
  assert.deepEqual(faults, []);
  await close();
}
aTimeIsChosenInAllFigures.needs = 'track';

/** Numbers in the sentences are those of data and grids. */
async function theSentenceAgreesWithTheData({documents}) {
  const {document} = documents.calibrate, sigma = document.grids.sigma_infinity.sigma_px.filter((v) => v !== null);
  const share = /3σ is below ([\d.]+) px in ([\d.]+) %/.exec(document.verdict.sentence);
  if (share) {
    const told = (100 * sigma.filter((v) => 3 * v < Number(share[1])).length) / document.grids.sigma_infinity.sigma_px.length;
    assert.ok(Math.abs(told - Number(share[2])) <= 1.5, `${document.verdict.sentence} beside ${told} %`);
  }
  const fx = /fx ([\d.]+) ± ([\d.]+) px/.exec(documents.observe.document.verdict.sentence), {estimate, stddev} = documents.observe.document;
  assert.ok(fx && Math.abs(Number(fx[1]) - estimate.camera.fx) < 0.01 && Math.abs(Number(fx[2]) - 3 * stddev.camera.fx) < 0.01, documents.observe.document.verdict.sentence);
  const {data: {measurements}, verdict} = documents.track.document, used = /through (\d+) of (\d+)/.exec(verdict.sentence);
  assert.ok(used && Number(used[2]) === measurements.accepted.length && Number(used[1]) >= measurements.accepted.filter(Boolean).length, verdict.sentence);
}
theSentenceAgreesWithTheData.needs = 'calibrate';

async function keysDoWhatTheHelpSays({open, url, calibration}) {
  const {page, faults, close} = await open(url(calibration(3)));
  await page.keyboard.press('d');
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), 'dark');
  await page.locator('#fig-photos').hover();
  await page.keyboard.press('t');
  assert.ok(await page.locator('#fig-photos .behind table').isVisible());
  await page.keyboard.press('f');
  assert.ok(await page.locator('#fig-photos.full').count());
  await page.keyboard.press('Escape');
  assert.equal(await page.locator('.full').count(), 0);
  await page.keyboard.press('?');
  assert.ok(await page.locator('dialog.help').isVisible());
  await page.keyboard.press('Escape');
  assert.ok(!(await page.locator('dialog.help').isVisible()), 'Escape leaves the help open');
  await page.keyboard.press('?');
  await page.keyboard.press('?');
  assert.ok(!(await page.locator('dialog.help').isVisible()));
  const saved = page.waitForEvent('download');
  await page.locator('#fig-trust').hover();
  await page.keyboard.press('s');
  assert.equal((await saved).suggestedFilename(), 'calibrate-trust.png');
  assert.deepEqual(faults, []);
  await close();
}

async function downloadsAreTheData({open, url, calibration}) {
  const document = calibration(3), {page, close} = await open(url(document));
  await page.locator('#data summary', {hasText: 'corners'}).click();
  const saved = page.waitForEvent('download');
  await page.locator('#data button', {hasText: 'corners.csv'}).click();
  const stream = await (await saved).createReadStream();
  let text = '';
  for await (const part of stream) text += part;
  assert.equal(text.trim().split('\n').length, 1 + document.data.corners.u_px.length);
  assert.ok(text.startsWith(Object.keys(document.data.corners).join(',')));
  await close();
}

/** On paper: as wide as the page, 3-D as it stands, circles round. */
async function printsWell({open, url, calibration}) {
  const {page, faults, close} = await open(url(calibration(4)), {theme: 'dark'});
  await page.evaluate(() => dispatchEvent(new Event('beforeprint')));
  const found = await page.evaluate(() => {
    const canvas = document.querySelector('#fig-poses canvas'), g = canvas.getContext('2d'), pixels = new Uint32Array(g.getImageData(0, 0, canvas.width, canvas.height).data.buffer);
    const all = [...document.querySelectorAll('main canvas')].filter((one) => one.clientWidth > 0);
    return {colours: new Set(pixels).size, widest: Math.max(...all.map((one) => one.getBoundingClientRect().right)),
      stretched: all.map((one) => one.width / one.clientWidth / (one.height / one.clientHeight)).filter((ratio) => Math.abs(ratio - 1) > 0.01).length};
  });
  assert.ok(found.colours > 20, `the 3-D view has ${found.colours} colours`);
  assert.ok(found.widest <= 720, `a canvas reaches ${found.widest} px`);
  assert.equal(found.stretched, 0);
  const pdf = await page.pdf({format: 'A4', printBackground: true});
  assert.ok(pdf.length > 50_000);
  assert.deepEqual(faults, []);
  await close();
}

export const tests = {
  'pointing at a place tells its value': hoverSaysTheValue,
  'a choice is lit in all figures': choosingLightsUpEverywhere,
  'a time is chosen in all figures': aTimeIsChosenInAllFigures,
  'the sentences agree with the data': theSentenceAgreesWithTheData,
  'keys do what the help says': keysDoWhatTheHelpSays,
  'downloads are the data': downloadsAreTheData,
  'paper shows all of it': printsWell,
};
