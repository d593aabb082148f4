// What a page says first, and that no figure says more, or less, than the document behind it.
import assert from 'node:assert/strict';
import {base} from './documents.mjs';

/** A window of a laptop: the verdict, the values, one figure and the next step, without scrolling. */
async function theFirstScreenAnswers({open, urlOf, documents}) {
  for (const name of Object.keys(documents)) {
    const {page, close} = await open(urlOf(name), {width: 1280, height: 800});
    await page.evaluate(() => new Promise((done) => requestAnimationFrame(() => setTimeout(done, 20)))); // what is below is drawn in a test of its own
    const found = await page.evaluate(() => ({next: document.querySelector('header .to-do')?.textContent ?? '', header: document.querySelector('header').getBoundingClientRect().bottom,
      first: [...document.querySelectorAll('.card.first')].map((card) => ({id: card.id, top: card.getBoundingClientRect().top, bottom: card.getBoundingClientRect().bottom})), cards: document.querySelectorAll('main > .card').length}));
    await close();
    assert.ok(found.next.length > 12, `${name}: no next step`);
    assert.ok(found.header < 300, `${name}: the header is ${found.header} px high`);
    const wanted = name.endsWith('refused') ? 1 : 2;
    assert.equal(found.first.length, wanted, `${name}: ${found.first.map(({id}) => id)}`);
    for (const card of found.first) assert.ok(card.top < 310 && card.bottom < 850, `${name}: ${card.id} from ${card.top} to ${card.bottom}`);
  }
}

async function sigmaIsExplainedPhotoByPhoto({open, url, calibration}) {
  const document = calibration(6), z2 = document.data.photos.cluster_z2, {page, faults, close} = await open(url(document));
  const card = page.locator('#fig-clusters'), words = await card.innerText();
  assert.match(words, /Photo by photo: where does σ come from\?/);
  const mean = z2.reduce((a, b) => a + b, 0) / z2.length;
  assert.ok(words.includes(`the mean over 6 photos is ${Number(mean.toPrecision(2))}`), words);
  assert.match(words, /raised 2 to 2\.2 times .* 11 to 13 degrees of freedom/);
  assert.equal(await card.getAttribute('data-marks'), '6');
  const tips = await page.evaluate(() => [...window.alidade.charts].find((chart) => chart.canvas.closest('#fig-clusters')).hits.map((hit) => hit.tip()));
  const sorted = document.data.photos.name.map((name, i) => [name, z2[i]]).sort((a, b) => b[1] - a[1]);
  tips.forEach(([name, value], i) => assert.ok(name === sorted[i][0] && value.startsWith(String(sorted[i][1])), `${name} ${value} beside ${sorted[i]}`));
  assert.ok((await page.locator('#fig-estimate').innerText()).includes('×2.0'), 'σ over the model’s');
  await close();
  for (const column of ['cluster_z2']) delete document.data.photos[column];
  delete document.stddev_model;
  const without = await open(url(document));
  assert.equal(await without.page.locator('#fig-clusters').count(), 0);
  assert.ok(!(await without.page.locator('#fig-estimate').innerText()).includes('over model'));
  assert.ok(!(await without.page.locator('.left-out').allInnerTexts()).join().includes('where does σ come from'));
  await without.close();
  assert.deepEqual(faults, []);
}

async function whatWasAssumedIsSaid({open, url, calibration}) {
  const document = calibration(3), {page, close} = await open(url(document)), words = await page.locator('#fig-assumed').innerText();
  assert.match(words, /square\s+0\.025 m\s+not given \(supposed: 0\.00005 m\)\s+0\.3 σ\s+fx by 0\.1/);
  assert.match(words, /camera fx\s+1100\s+exact/);
  assert.match(words, /less than its own σ/);
  await close();
  document.assumed[0].moves = 2.4;
  const grave = await open(url(document));
  assert.match(await grave.page.locator('#fig-assumed').innerText(), /◆ 2\.4 σ[\s\S]*One thing without a σ would/);
  await grave.close();
}

async function causesAreNamedWorstFirst({open, url}) {
  const causes = [{name: 'k1', z: 0.4, members: [{name: 'k1', value: -0.001, sigma: 0.002, unit: ''}]}, {name: 'mount', z: -5.2, members: [{name: 'mount x', value: 1.2, sigma: 0.1, unit: '°'}]}];
  const {page, faults, close} = await open(url(base('observe', {estimate: {causes}}))), rows = await page.locator('#fig-causes tbody tr').allInnerTexts();
  assert.match(rows[0], /mount\s+−5\.2 σ\s+mount x 1\.20 ± 0\.30 °/);
  assert.match(rows[1], /k1\s+0\.4 σ/);
  assert.ok(!(await page.locator('body').innerText()).includes('causes'), 'they stand in their own table alone');
  assert.deepEqual(faults, []);
  await close();
}

/** Beside a header that says that the halves differ no figure says that all of the image agrees. */
async function halvesDoNotContradictTheHeader({open, url, calibration}) {
  const document = calibration(4), caption = async () => {
    const {page, close} = await open(url(document)), words = await page.locator('#fig-halves').innerText();
    await close();
    return words;
  };
  document.verdict.checks = [{name: 'consistent', state: 'good', text: 'halves differ by 1.1σ in cx', value: 1.1, limit: 3, unit: 'σ', figure: 'halves'}];
  assert.match(await caption(), /Here it does in \d+ % of the image/);
  Object.assign(document.verdict, {state: 'care', sentence: 'Usable with care: halves differ by 4.8σ in fy', checks: [{name: 'consistent', state: 'care', text: 'halves differ by 4.8σ in fy', value: 4.8, limit: 3, unit: 'σ', figure: 'halves'}]});
  const words = await caption();
  assert.ok(!/\d+ % of the image/.test(words), words);
  assert.match(words, /They do not: halves differ by 4\.8σ in fy/);
}

/** A rate is no time: what ends in _rad_s or _rad_per_s stood there in seconds. */
async function unitsAreThoseOfTheNames({open, url, documents}) {
  const document = structuredClone(documents.servo.document);
  Object.assign(document, {command: 'localize', data: {}, estimate: {imu: {gyro_bias_rad_s: [0.01, 0, 0], accelerometer_bias_m_s2: [0.5, 0, 0]}, rotation: {sigma_rate_rad_per_s: 0.02}, ate_m: 0.25}});
  const {page, close} = await open(url(document)), words = (await page.locator('#fig-estimate').innerText()).replace(/\s+/g, ' ');
  await close();
  for (const wanted of [/gyro bias x 0\.573\d* °\/s/, /accelerometer bias x 0\.5\d* m\/s²/, /rotation sigma rate 1\.1\d* °\/s/, /ATE 250 mm/]) assert.match(words, wanted);
}

async function aRefusalShowsCornersAsFound({open, url, calibration}) {
  const document = calibration(2);
  Object.assign(document.verdict, {state: 'refused', exit_code: 4, sentence: 'only 2 usable photos of the board; it takes 3', to_add: 'add photos of the board'});
  document.data.photos.used.fill(false), document.data.corners.weight.fill(0);
  for (const column of ['residual_u_px', 'residual_v_px']) document.data.corners[column].fill(null);
  const {page, faults, close} = await open(url(document));
  const tips = await page.evaluate(() => [...window.alidade.charts].find((chart) => chart.canvas.closest('#fig-photo')).hits.map((hit) => hit.tip().join(' ')));
  assert.equal(tips.length, 54);
  assert.ok(tips.every((tip) => tip.includes('as found') && !tip.includes('rejected')), tips[0]);
  assert.match(await page.locator('#fig-photo').innerText(), /which corners were found\?[\s\S]*54 corners found/);
  assert.ok(!(await page.locator('#fig-photo').innerText()).includes('Crosses'));
  assert.deepEqual(faults, []);
  await close();
}

async function exitCodeSixIsATriangle({open, url, calibration}) {
  const document = calibration(3);
  Object.assign(document.verdict, {state: 'bad', exit_code: 6, sentence: 'Not to be trusted: RMS is 1.9 × what the corners’ own σ predicts'});
  const {page, close} = await open(url(document)), heading = await page.locator('h1').innerText();
  assert.equal(heading, '▲ Not to be trusted: RMS is 1.9 × what the corners’ own σ predicts');
  assert.match(await page.locator('.counts').innerText(), /exit code 6/);
  await close();
}

/** Orange pixels in a row of the plot's middle. */
const orangeAcross = () => {
  const canvas = document.querySelector('#fig-nis .uplot canvas'), g = canvas.getContext('2d'), row = g.getImageData(0, Math.round(0.55 * canvas.height), canvas.width, 6).data;
  let count = 0;
  for (let i = 0; i < row.length; i += 4) if (row[i] > 150 && row[i] < 200 && row[i + 1] > 85 && row[i + 1] < 130 && row[i + 2] < 40 && row[i + 3] > 60) ++count;
  return count;
};

async function manyEventsLeaveThePlotFree({open, url}) {
  const rows = 600, t = Array.from({length: rows}, (_, i) => i / 30), of = (value) => t.map(() => value);
  const made = (every) => base('observe', {estimate: {camera: {width: 780, height: 582, fx: 700, fy: 700, cx: 390, cy: 290}}, data: {steps: {t_s: t, fx_px: of(700), sigma_fx_px: of(1), nis: of(40), nis_dof: of(4), event: t.map((_, i) => (i % every === 1 ? 'burst' : ''))}}});
  const counts = [];
  for (const every of [3, 100]) {
    const {page, faults, close} = await open(url(made(every)));
    counts.push(await page.evaluate(orangeAcross));
    assert.deepEqual(faults, []);
    await close();
  }
  assert.equal(counts[0], 0, '200 events are drawn through the plot');
  assert.ok(counts[1] > 0, 'six events are lines');
}

async function aReRunIsCalledSo({open, url, documents}) {
  const {document} = documents.reproduce, {page, faults, close} = await open(url(document));
  const heads = await page.locator('#fig-experiments thead').innerText();
  for (const word of ['as printed', 'paper’s method, re-run', 'ours', 'bound']) assert.ok(heads.includes(word), heads);
  const cells = await page.locator('#fig-experiments tbody tr').nth(2).locator('td.value').allInnerTexts();
  assert.equal(cells[0], '', 'nothing is printed there');
  assert.deepEqual(cells.slice(1, 3), ['3.1', '0.02']);
  const panels = await page.locator('#fig-paper-4 canvas').evaluateAll((all) => all.map((one) => one.getAttribute('aria-label')));
  assert.equal(panels.length, 2, 'one panel for each unit');
  assert.ok(panels.some((label) => label.endsWith('°')) && panels.some((label) => label.endsWith('px')), panels.join());
  await close();
  const silent = JSON.parse(JSON.stringify(document));
  silent.data.experiments.printed.fill(null);
  const without = await open(url(silent));
  assert.ok(!(await without.page.locator('#fig-experiments thead').innerText()).includes('as printed'));
  await without.close();
  assert.deepEqual(faults, []);
}

async function figuresSayWhatTheyDraw({open, url, documents}) {
  const {document} = documents.reproduce, {page, faults, close} = await open(url(document));
  for (const [id, title, caption] of [['4', 'Figure 4: angles', 'Drawn: an angle'], ['6', 'Figure 6: spots', 'Left the image'], ['8', 'Figure 8: errors', 'Shares of spots.'], ['table_2', 'Table 2: three ways', 'Three rows.']]) {
    const words = await page.locator(`#fig-paper-${id}`).innerText();
    assert.ok(words.includes(title) && words.includes(caption), words);
  }
  const cells = await page.locator('#fig-paper-table_2 tbody tr').nth(2).locator('th, td').allInnerTexts();
  assert.deepEqual(cells, ['ours', '–', '6']);
  assert.equal(await page.locator('#fig-paper-6 canvas').count(), 2);
  await close();
  assert.deepEqual(faults, []);
}

async function aRigsCausesHaveTheirScores({open, url, documents}) {
  const document = JSON.parse(JSON.stringify(documents['rig, moving target'].document));
  document.command = 'rig', document.estimate = {heads: [], causes: [{name: 'head2.pan_scale', size: 0.004, sigmas: 2.4}, {name: 'head1.camera.fx', size: 0.001, sigmas: -6.1}]};
  document.data = {};
  const {page, close} = await open(url(document)), words = await page.locator('#fig-causes tbody tr').first().innerText();
  assert.ok(words.includes('head1.camera.fx') && words.includes('6.1 σ'), words);
  await close();
}

export const tests = {
  'figures of a paper say what they draw': figuresSayWhatTheyDraw,
  'causes of a rig have their scores': aRigsCausesHaveTheirScores,
  'first screen: verdict, values, one figure, the next step': theFirstScreenAnswers,
  'sigma is explained photo by photo': sigmaIsExplainedPhotoByPhoto,
  'what was assumed is said': whatWasAssumedIsSaid,
  'causes are named, worst first': causesAreNamedWorstFirst,
  'halves do not contradict the header': halvesDoNotContradictTheHeader,
  'units are those of the names': unitsAreThoseOfTheNames,
  'a refusal shows corners as found': aRefusalShowsCornersAsFound,
  'exit code 6 is a triangle': exitCodeSixIsATriangle,
  'many events leave the plot free': manyEventsLeaveThePlotFree,
  'a re-run is called so': aReRunIsCalledSo,
};
