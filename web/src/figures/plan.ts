// plan: where to hold the board, or how to turn, and what is known then: 3σ now and after each step.
import {Chart, type Pen} from '../core/chart';
import type {Doc, Table} from '../core/document';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {degrees, fixed, num, rounded} from '../core/format';
import {panelIn} from '../core/panel';
import {add, column, identity, isFinite3, lensOf, move, mul, norm, poseOf, unit, type Lens, type Pose, type V3} from '../core/rigid';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent} from '../core/stats';
import {View3} from '../core/view3';
import {World} from '../core/world';

const names = ['fx', 'fy', 'cx', 'cy'] as const;

/** Bars of one quantity in one unit: now, and after each step. */
function gainBars(host: HTMLElement, title: string, unit_: string, bars: [string, number][]): void {
  const known = bars.filter(([, value]) => value > 0);
  if (known.length === 0) return;
  new Chart(host, {height: 30 + 27 * known.length, label: `${title}: ${known.map(([words, value]) => `${words} ${num(value, 2)} ${unit_}`).join(', ')}`}, (pen) => {
    const left = 96, x = scale(0, Math.max(...known.map(([, value]) => value)), left, pen.w - 78);
    pen.text(`${title}, ${unit_}`, 0, 9, {size: 12, weight: 650});
    known.forEach(([words, value], i) => {
      const y = 24 + 27 * i;
      pen.text(words, left - 8, y + 11, {align: 'right', size: 11.5, colour: pen.c.soft});
      pen.rect(left, y, Math.max(1.5, x(value) - left), 21, words === 'now' ? pen.c.soft : pen.c.green);
      pen.text(`${rounded(value, 2)} ${unit_}`, Math.max(left + 2, x(value)) + 7, y + 11, {size: 11.5, weight: 650});
      pen.hit({x: (left + x(value)) / 2, y: y + 11, w: x(value) - left, h: 24, tip: () => [words, `${title} ${num(value, 3)} ${unit_}`]});
    });
  });
}
const after = (what: string, i: number) => `after ${what} ${i + 1}`;

interface Sheet {
  corners: V3[]; // of the points' outline, half a square beyond them
  points: V3[];
}
/** The board as its points tell it; null where the document has none. */
function sheetOf(doc: Doc): Sheet | null {
  const table = doc.table('points_in_board');
  if (!table) return null;
  const [x, y, z] = ['x_m', 'y_m', 'z_m'].map((name) => table.numbers(name)) as [Float64Array, Float64Array, Float64Array];
  const points = Array.from(x, (_, i): V3 => [x[i]!, y[i]!, z[i]!]).filter(isFinite3), xs = extent(x), ys = extent(y);
  if (!xs || !ys || points.length < 3) return null;
  const pitch = Math.sqrt(((xs[1] - xs[0]) * (ys[1] - ys[0])) / points.length) || 0.01;
  return {points, corners: [[xs[0] - pitch, ys[0] - pitch, 0], [xs[1] + pitch, ys[0] - pitch, 0], [xs[1] + pitch, ys[1] + pitch, 0], [xs[0] - pitch, ys[1] + pitch, 0]]};
}

function poses(next: Table): Pose[] {
  return Array.from({length: Math.min(20, next.rows)}, (_, i) => poseOf(next, 'cam_from_board', i)).filter((pose) => pose !== null);
}
const middleOf = (sheet: Sheet, pose: Pose) => move(pose, mul(sheet.points.reduce(add), 1 / sheet.points.length));
const tiltOf = (pose: Pose) => Math.acos(Math.min(1, Math.abs(column(pose.r, 2)[2]))) * degrees;

/** The camera, the boards in their order, and what else is told. */
function boardsWorld(doc: Doc, sheet: Sheet, all: Pose[], more: (world: World, far: number) => void): World {
  const world = new World(), lens = lensOf(doc), nearest = Math.min(...all.map((pose) => norm(middleOf(sheet, pose)))), far = Math.max(...all.map((pose) => norm(middleOf(sheet, pose))));
  all.forEach((pose, i) => {
    const corners = sheet.corners.map((corner) => move(pose, corner)), colour = i === 0 ? 'orange' : 'blue';
    world.face(corners, colour, 0.22, {tip: () => [`${i + 1}.: ${num(norm(middleOf(sheet, pose)), 3)} m away`, `tilted ${tiltOf(pose).toFixed(0)}° from the image plane`]});
    world.line(corners, {colour, width: 2}, true);
    for (const point of sheet.points.slice(0, 600)) world.dot(move(pose, point), colour, 3);
    world.label(corners[0]!, String(i + 1), colour);
    world.hold(...corners);
  });
  if (lens) world.hold([0, 0, 0], ...world.frustum(identity, [lens.width / 2 / lens.fx, lens.height / 2 / lens.fy], 0.25 * nearest, {colour: 'ink', width: 2}));
  world.axes(identity, 0.18 * nearest);
  world.hold([0, 0.24 * nearest, 0], [0.24 * nearest, 0, 0]);
  more(world, far);
  return world;
}

/** Each board as the camera would see it; distortion is omitted, as the board may reach beyond what the model knows. */
function drawSeen(pen: Pen, lens: Lens, sheet: Sheet, pose: Pose): void {
  const panel = panelIn(lens, 0, 0, pen.w, pen.h);
  const at = (p: V3): [number, number] => {
    const q = move(pose, p);
    return q[2] > 1e-6 ? panel.at((lens.fx * q[0]) / q[2] + lens.cx, (lens.fy * q[1]) / q[2] + lens.cy) : [NaN, NaN];
  };
  pen.rect(panel.x, panel.y, panel.w, panel.h, pen.c.panel, pen.c.soft);
  pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
    const edge = sheet.corners.flatMap(at);
    pen.fill(edge, '#f4f6f8');
    pen.path(edge, pen.c.orange, 2, [], true);
    for (const point of sheet.points.slice(0, 2500)) pen.circle(...at(point), 2, '#20262d');
  });
}

function boardSketches(host: HTMLElement, doc: Doc, sheet: Sheet, all: Pose[]): void {
  const lens = lensOf(doc), row = el('div', {class: 'sketches'});
  if (!lens) return;
  host.append(row);
  all.slice(0, 6).forEach((pose, i) => {
    const part = el('div'), words = `${i + 1}: ${num(norm(middleOf(sheet, pose)), 2)} m away, tilted ${tiltOf(pose).toFixed(0)}°`;
    row.append(part);
    part.append(el('p', {class: 'caption'}, words));
    new Chart(part, {height: 70, aspect: lens.height / lens.width, most: 300, label: words}, (pen) => drawSeen(pen, lens, sheet, pose));
  });
}

export const planSketches: Figure = {
  id: 'sketches', isOptional: true, title: 'What will the camera see?', note: 'each board in the image, distortion omitted', span: 24,
  draw(host, doc) {
    const next = doc.table('next'), sheet = sheetOf(doc), all = next ? poses(next) : [];
    if (!next || !sheet || all.length === 0 || !lensOf(doc)) return null;
    boardSketches(host, doc, sheet, all);
    return {marks: all.length, rows: all.length, tables: [next], words: `${all.length} boards`, good: `Distances are from the camera to the board’s centre, tilts from the image plane.${all.length > 6 ? ' The first six are drawn.' : ''}`};
  },
};

/** 3σ now, and after all that is proposed, by name and unit. */
function planValues(doc: Doc): [string, string, number, number][] {
  const next = doc.table('next'), last = next ? next.rows - 1 : 0, n = (name: string) => next?.number(name, last) ?? NaN;
  return ([['worst 3σ of projection', 'px', doc.estimate('worst_3sigma_px'), n('worst_3sigma_px')],
    ...names.map((name) => [name, 'px', 3 * doc.estimate(`sigma_now_px.${name}`), 3 * n(`sigma_${name}_px`)]),
    ['origin', 'mm', 3e3 * doc.estimate('sigma_now_origin_m'), 3e3 * n('sigma_origin_m')], ['direction', 'mrad', 3e3 * doc.estimate('sigma_now_direction_rad'), 3e3 * n('sigma_direction_rad')],
    ['spot at worst', 'px', NaN, 3 * n('spot_sigma_px')]] as [string, string, number, number][]).filter(([, , , then]) => then > 0);
}

export const planEstimate: Figure = {
  id: 'estimate', title: 'What does it bring?', note: '± 3σ', span: 8,
  draw(host, doc) {
    const rows = planValues(doc), next = doc.table('next');
    if (rows.length === 0 || !next) return null;
    host.append(el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...['', 'now', `after all ${next.rows}`, ''].map((word) => el('th', {}, word)))),
      el('tbody', {}, ...rows.map(([words, unit_, now, then]) => el('tr', {}, el('th', {}, words), el('td', {class: 'right'}, now > 0 ? `± ${num(now, 2)}` : '–'), el('td', {class: 'value'}, `± ${num(then, 2)}`), el('td', {class: 'unit'}, unit_))))));
    return {marks: rows.length, rows: rows.length, tables: [next], words: rows.map(([words, unit_, now, then]) => `${words} ${num(now, 2)} to ${num(then, 2)} ${unit_}`).join(', '),
      good: 'By the information that these measurements would add to what is known, if they are as good as the earlier ones.'};
  },
};

export const planCalibrate: Figure = {
  id: 'plan', title: 'Where should the board be?', note: 'camera frame, m · 1: the first to take · drag to turn', span: 16,
  draw(host, doc) {
    const next = doc.table('next'), sheet = sheetOf(doc), all = next ? poses(next) : [];
    if (!next) return null;
    const row = el('div', {class: 'split'}), left = el('div', {class: 'wide'}), right = el('div'), now = doc.estimate('worst_3sigma_px');
    host.append(row);
    if (sheet && all.length > 0) {
      row.append(left);
      new View3(left, {height: 330, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.75, pitch: 0.35, label: `${all.length} boards in front of the camera`}, () => boardsWorld(doc, sheet, all, () => undefined));
    }
    row.append(right);
    const worst = next.numbers('worst_3sigma_px'), words = `the worst 3σ of projection falls from ${num(now, 2)} to ${num(worst[worst.length - 1]!, 2)} px`;
    gainBars(right, 'worst 3σ of projection', 'px', [['now', now], ...Array.from(worst.slice(0, 12), (value, i): [string, number] => [after('photo', i), value])]);
    return {marks: next.rows, rows: next.rows, tables: [next], words, good: `Each photo counts the ones before it: ${words}.`};
  },
};

export const planRangefinder: Figure = {
  id: 'plan', title: 'Where should the board be?', note: 'camera frame, m · 1: the first to take · drag to turn', span: 16,
  draw(host, doc) {
    const next = doc.table('next'), sheet = sheetOf(doc), all = next ? poses(next) : [];
    if (!next) return null;
    const row = el('div', {class: 'split'}), left = el('div', {class: 'wide'}), right = el('div');
    const v3 = (name: string) => [0, 1, 2].map((k) => doc.estimate(`${name}[${k}]`)) as V3, origin = v3('origin_m'), direction = v3('direction');
    host.append(row);
    if (sheet && all.length > 0) {
      row.append(left);
      const hasBeam = isFinite3(origin) && isFinite3(direction);
      legend(left, [{words: 'boards in their order', colour: 'var(--blue)', look: 'square'}, ...(hasBeam ? [{words: 'the beam as it is known now', colour: 'var(--red)'}] : [])]);
      new View3(left, {height: 330, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.75, pitch: 0.35, label: `${all.length} boards on the beam`}, () => boardsWorld(doc, sheet, all, (world, far) => {
        if (hasBeam) world.line([origin, add(origin, mul(unit(direction), 1.15 * far))], {colour: 'red', width: 2.4}), world.dot(origin, 'red', 7);
      }));
    }
    row.append(right);
    const of = (name: string, factor: number) => Array.from(next.numbers(name).slice(0, 12), (value, i): [string, number] => [after('shot', i), 3 * factor * value]);
    gainBars(right, '3σ of the origin', 'mm', [['now', 3e3 * doc.estimate('sigma_now_origin_m')], ...of('sigma_origin_m', 1e3)]);
    gainBars(right, '3σ of the direction', 'mrad', [['now', 3e3 * doc.estimate('sigma_now_direction_rad')], ...of('sigma_direction_rad', 1e3)]);
    const last = next.rows - 1, words = `the origin’s 3σ falls from ${num(3e3 * doc.estimate('sigma_now_origin_m'), 2)} to ${num(3e3 * next.number('sigma_origin_m', last), 2)} mm`;
    return {marks: next.rows, rows: next.rows, tables: [next], words, good: `Each shot counts the ones before it: ${words}.`};
  },
};


/** The image's outline at the turns, in degrees of pan and tilt from where the camera looks now. */
function drawTurns(pen: Pen, next: Table, half: [number, number]): void {
  const stops: [number, number][] = [[0, 0], ...Array.from({length: Math.min(20, next.rows)}, (_, i): [number, number] => [degrees * next.number('pan_rad', i), degrees * next.number('tilt_rad', i)])];
  const xs = extent(stops.map(([pan]) => pan))!, ys = extent(stops.map(([, tilt]) => tilt))!, w = pen.w - 62, h = pen.h - 62, margin = 1.06;
  const span = Math.max((xs[1] - xs[0] + 2 * half[0]) / w, (ys[1] - ys[0] + 2 * half[1]) / h) * margin || 1, mx = (xs[0] + xs[1]) / 2, my = (ys[0] + ys[1]) / 2;
  // Pan turns left: a person sees it so, with the larger angles at the left.
  const x = scale(mx - (span * w) / 2, mx + (span * w) / 2, 50 + w, 50), y = scale(my - (span * h) / 2, my + (span * h) / 2, 22 + h, 22);
  yAxis(pen, y, 50, 50 + w, {label: 'tilt, °'});
  xAxis(pen, x, 22, 22 + h, {label: 'pan, ° (left is positive)'});
  stops.forEach(([pan, tilt], i) => {
    const colour = i === 0 ? pen.c.soft : i === 1 ? pen.c.orange : pen.c.blue;
    if (half[0] > 0) pen.rect(x(pan + half[0]), y(tilt + half[1]), x(pan - half[0]) - x(pan + half[0]), y(tilt - half[1]) - y(tilt + half[1]), null, colour, 1.4);
    if (i > 0) pen.arrow(x(stops[i - 1]![0]), y(stops[i - 1]![1]), x(pan), y(tilt), colour, 2.4, 9);
    pen.circle(x(pan), y(tilt), 4, colour);
    pen.text(i === 0 ? 'now' : String(i), x(pan) + 8, y(tilt) - 9, {size: 12, weight: 700});
    pen.hit({x: x(pan), y: y(tilt), r: 6, tip: () => [i === 0 ? 'now' : `move ${i}`, `pan ${fixed(pan, 1)}°, tilt ${fixed(tilt, 1)}°`, ...(i > 0 ? [`${num(next.number('duration_s', i - 1), 2)} s`] : [])]});
  });
}

function turnTable(next: Table): HTMLElement {
  const cell = (value: number) => el('td', {class: 'value'}, fixed(Math.abs(value) < 0.05 ? 0 : value, 1));
  const hasRoll = next.numbers('roll_rad').some((roll) => Math.abs(roll) > 1e-9);
  return el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...['move', 'pan, °', 'tilt, °', ...(hasRoll ? ['roll, °'] : []), 's'].map((word) => el('th', {}, word)))),
    el('tbody', {}, ...Array.from({length: Math.min(20, next.rows)}, (_, i) => el('tr', {}, el('th', {}, String(i + 1)), cell(degrees * next.number('pan_rad', i)), cell(degrees * next.number('tilt_rad', i)),
      hasRoll ? cell(degrees * next.number('roll_rad', i)) : null, cell(next.number('duration_s', i))))));
}

export const planObserve: Figure = {
  id: 'plan', title: 'How should the head turn?', note: 'from where the camera looks now · frames: the image', span: 16,
  draw(host, doc) {
    const next = doc.table('next');
    if (!next || !next.hasValues('pan_rad')) return null;
    const row = el('div', {class: 'split'}), left = el('div', {class: 'wide'}), right = el('div'), lens = lensOf(doc);
    const half: [number, number] = lens ? [degrees * Math.atan(lens.width / 2 / lens.fx), degrees * Math.atan(lens.height / 2 / lens.fy)] : [0, 0];
    host.append(row);
    row.append(left, right);
    new Chart(left, {height: 330, isFilling: true, label: `${next.rows} turns in pan and tilt`}, (pen) => drawTurns(pen, next, half));
    left.append(turnTable(next));
    for (const name of names)
      gainBars(right, `3σ of ${name}`, 'px', [['now', 3 * doc.estimate(`sigma_now_px.${name}`)], ...Array.from(next.numbers(`sigma_${name}_px`).slice(0, 5), (value, i): [string, number] => [after('move', i), 3 * value])]);
    const last = next.rows - 1, words = `3σ of fx falls from ${num(3 * doc.estimate('sigma_now_px.fx'), 2)} to ${num(3 * next.number('sigma_fx_px', last), 2)} px, of fy from ${num(3 * doc.estimate('sigma_now_px.fy'), 2)} to ${num(3 * next.number('sigma_fy_px', last), 2)} px`;
    return {marks: next.rows, rows: next.rows, tables: [next], words, good: `Each move counts the ones before it: ${words}.`};
  },
};
