// rig: axes, cameras and the other head in space; coverage; residuals against angles; what cannot be determined.
import {Chart} from '../core/chart';
import {cividis, css, directionColour, pixelShare} from '../core/colours';
import type {Doc, Table} from '../core/document';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {degrees, num, times, valueText} from '../core/format';
import {colourBar, magnificationFor, panelIn} from '../core/panel';
import {add, mul, norm, poseOf, rotationOf, sub, unit, type Pose, type V3} from '../core/rigid';
import type {Selection} from '../core/selection';
import {lengths, quantile} from '../core/stats';
import {View3} from '../core/view3';
import {World} from '../core/world';
import {correlationsOf} from './correlations';
import {drawCorrelations} from './estimate';
import {scatter, type ScatterDot} from './scatter';

function viewsOf(doc: Doc, selection: Selection): Table | null {
  const views = doc.table('views');
  if (!views) return null;
  const rms = views.numbers('rms_px'), used = views.numbers('used');
  if (selection.items.length === 0)
    selection.offer(Array.from({length: views.rows}, (_, i) => i).sort((a, b) => used[b]! - used[a]! || (rms[b]! || 0) - (rms[a]! || 0)));
  return views;
}
const headColours = ['blue', 'orange', 'green', 'purple'] as const;
function headsOf(views: Table): number[] {
  return [...new Set(views.numbers('head'))].filter(Number.isFinite).sort((a, b) => a - b);
}
const nameOf = (views: Table, i: number) => `${views.text('name', i)}, head ${views.text('head', i)}, board ${views.text('board', i)}`;

function headPose(doc: Doc, k: number): Pose | null {
  const n = (name: string, i: number) => doc.estimate(`heads[${k}].world_from_base.${name}[${i}]`);
  const q = [0, 1, 2, 3].map((i) => n('quaternion_wxyz', i));
  const t = [0, 1, 2].map((i) => n('translation_m', i)) as V3;
  return q.concat(t).every(Number.isFinite) ? {t, r: rotationOf(q[1]!, q[2]!, q[3]!, q[0]!)} : null;
}

function addAxes(world: World, axes: Table, length: number): void {
  for (let i = 0; i < axes.rows; ++i) {
    const n = (name: string) => axes.number(name, i), p: V3 = [n('point_in_world_x_m'), n('point_in_world_y_m'), n('point_in_world_z_m')];
    const d = unit([n('direction_x'), n('direction_y'), n('direction_z')]), name = axes.text('name', i), isPan = name.includes('pan');
    const ends: V3[] = [sub(p, mul(d, length)), add(p, mul(d, length))];
    world.line(ends, {colour: isPan ? 'green' : 'orange', width: 3});
    world.label(ends[0]!, name, isPan ? 'green' : 'orange');
    world.hold(...ends);
  }
}

function rigWorld(doc: Doc, views: Table, selection: Selection): World {
  const world = new World(), heads = headsOf(views), axes = doc.table('axes'), cams: {pose: Pose; row: number}[] = [];
  for (let i = 0; i < views.rows; ++i) {
    const pose = poseOf(views, 'world_from_cam', i);
    if (pose) cams.push({pose, row: i});
  }
  const bases = [0, 1, 2, 3].map((k) => headPose(doc, k)).filter((pose) => pose !== null);
  const apart = bases.length > 1 ? norm(sub(bases[0]!.t, bases[1]!.t)) : 0.3, length = Math.max(0.03, 0.22 * apart);
  bases.forEach((pose, k) => {
    world.axes(pose, 0.5 * length, false);
    world.label(add(pose.t, mul([pose.r[0][1], pose.r[1][1], pose.r[2][1]], -1.7 * length)), `head ${heads[k] ?? k + 1}`);
    world.hold(pose.t, add(pose.t, mul([pose.r[0][1], pose.r[1][1], pose.r[2][1]], -1.8 * length)));
    if (k === 0 || !(doc.estimate('sigma_relative_m') > 0)) return;
    const three = 3 * doc.estimate('sigma_relative_m');
    world.ellipsoid(pose.t, [[three, 0, 0], [0, three, 0], [0, 0, three]], 'red');
  });
  for (const {pose, row} of cams) {
    const isChosen = row === selection.item, colour = headColours[Math.max(0, heads.indexOf(views.number('head', row))) % 4]!;
    const corners = world.frustum(pose, [0.45, 0.34], isChosen ? 1.3 * length : 0.55 * length, {colour: isChosen ? 'red' : colour, width: isChosen ? 3 : 1.1, opacity: isChosen ? 1 : 0.55});
    world.face(corners, isChosen ? 'red' : colour, isChosen ? 0.3 : 0.08, {pick: () => selection.choose(row), tip: () => [nameOf(views, row), `RMS ${num(views.number('rms_px', row), 3)} px`]});
    world.hold(...corners);
  }
  if (axes) addAxes(world, axes, length);
  return world;
}

export const rigSpace: Figure = {
  id: 'space', title: 'Where are the axes and the cameras?', note: 'world frame: first camera at readings of zero, m', span: 14,
  draw(host, doc, selection) {
    const views = viewsOf(doc, selection);
    if (!views || (!headPose(doc, 0) && !doc.table('axes'))) return null;
    const posed = views.hasValues('world_from_cam_x_m');
    legend(host, [...(doc.table('axes') ? [{words: 'pan axis', colour: 'var(--green)'}, {words: 'tilt axis', colour: 'var(--orange)'}] : []),
      ...(posed ? [...headsOf(views).slice(0, 4).map((head, k) => ({words: `views of head ${head}`, colour: `var(--${headColours[k]!})`, look: 'square' as const})), {words: 'the chosen view', colour: 'var(--red)', look: 'square' as const}] : []), {words: '3σ of the other head', colour: 'var(--red)', look: 'ring'}]);
    const label = `${headsOf(views).length} heads in space`;
    const view = new View3(host, {height: 380, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.6, pitch: 0.35, label}, () => rigWorld(doc, views, selection));
    selection.on(() => view.refresh());
    const s = 3 * doc.estimate('sigma_relative_m');
    return {marks: views.rows, rows: views.rows, tables: [views, ...(doc.table('axes') ? [doc.table('axes')!] : [])], words: label,
      good: 'Good: the ellipsoid is small against the distance of the heads.' + (s > 0 ? ` Here its radius is ${num(1e3 * s, 2)} mm (3σ).` : '')};
  },
};

export const rigCoverage: Figure = {
  id: 'coverage', title: 'Which angles were covered?', note: 'readings of pan and tilt, ° · colour: RMS', span: 12,
  draw(host, doc, selection) {
    const views = viewsOf(doc, selection);
    if (!views || !views.hasValues('pan_rad')) return null;
    const heads = headsOf(views), row = el('div', {class: 'row'}), charts: Chart[] = [], has = views.hasValues('rms_px');
    host.append(row);
    heads.slice(0, 4).forEach((head) => {
      const part = el('div'), dots: ScatterDot[] = [];
      for (let i = 0; i < views.rows; ++i) {
        if (views.number('head', i) !== head) continue;
        const rms = views.number('rms_px', i), isUsed = views.number('used', i) > 0;
        dots.push({x: degrees * views.number('pan_rad', i), y: degrees * views.number('tilt_rad', i), size: 6, shape: isUsed || !has ? 'disc' : 'cross', isChosen: () => selection.item === i,
          colour: (pen) => (Number.isFinite(rms) ? css(cividis(pixelShare(rms))) : pen.c.soft), pick: () => selection.choose(i),
          tip: () => [nameOf(views, i), `pan ${num(degrees * views.number('pan_rad', i), 4)}°, tilt ${num(degrees * views.number('tilt_rad', i), 4)}°`, isUsed ? `RMS ${num(rms, 3)} px` : `not used${views.text('reason', i) ? `: ${views.text('reason', i)}` : ''}`]});
      }
      part.append(el('p', {class: 'caption'}, el('b', {}, `head ${head}`), ` · ${dots.length} views`));
      row.append(part);
      charts.push(scatter(part, dots, {xLabel: 'pan, °', yLabel: 'tilt, °', height: 250, label: `Angles of head ${head}`, include: [[-10, -10], [10, 10]]}));
    });
    if (has) new Chart(host, {height: 46, label: 'colours of RMS'}, (pen) => void colourBar(pen, Math.max(20, pen.w / 2 - 220), Math.min(pen.w - 20, pen.w / 2 + 220), 2, 'RMS of a view, px'));
    selection.on(() => charts.forEach((chart) => chart.redraw()));
    return {marks: views.rows, rows: views.rows, tables: [views], words: `${views.rows} views`, good: `Good: both angles turned, by ±15° and more, in all combinations; the same colour everywhere.${has && views.numbers('used').some((used) => used === 0) ? ' Crosses: views rejected.' : ''}`};
  },
};

export const rigResiduals: Figure = {
  id: 'residuals', title: 'Do residuals follow the angles?', note: 'correction of each reading, ° · triangle: travel', span: 12,
  draw(host, doc, selection) {
    const views = viewsOf(doc, selection);
    if (!views || !views.hasValues('pan_correction_rad') || !doc.isAnswer) return null;
    const heads = headsOf(views), charts: Chart[] = [], row = el('div', {class: 'row'});
    legend(host, heads.slice(0, 4).map((head, k) => ({words: `head ${head}`, colour: `var(--${headColours[k]!})`, look: 'dot'})));
    host.append(row);
    const sigma = degrees * doc.estimate('noise.sigma_encoder_rad'), travel = views.has('travel_sign');
    let inside = 0, known = 0;
    for (const axis of ['pan', 'tilt'] as const) {
      const dots: ScatterDot[] = [], part = el('div');
      for (let i = 0; i < views.rows; ++i) {
        const x = degrees * views.number(`${axis}_rad`, i), y = degrees * views.number(`${axis}_correction_rad`, i), sign = views.number(travel ? 'travel_sign' : '', i);
        if (views.number('used', i) > 0 && Number.isFinite(y)) ++known, (inside += Number(Math.abs(y) <= 3 * sigma));
        dots.push({x, y, size: 4, shape: views.number('used', i) > 0 ? (sign > 0 ? 'up' : sign < 0 ? 'down' : 'disc') : 'cross', isChosen: () => selection.item === i, pick: () => selection.choose(i),
          colour: (pen) => pen.c[headColours[Math.max(0, heads.indexOf(views.number('head', i))) % 4]!], tip: () => [nameOf(views, i), `${axis} ${num(x, 4)}°`, `correction ${num(y, 3)}°`, `RMS ${num(views.number('rms_px', i), 3)} px`]});
      }
      row.append(part);
      charts.push(scatter(part, dots, {xLabel: `${axis} as read, °`, yLabel: `correction of ${axis}, °`, height: 250, zero: true, label: `Correction of ${axis} against its reading`, include: sigma > 0 ? [[dots[0]?.x ?? 0, 3.2 * sigma]] : [],
        below: (pen, _, y) => { if (sigma > 0) pen.g.fillStyle = pen.c.isDark ? 'rgba(140,200,240,.12)' : 'rgba(0,114,178,.1)', pen.g.fillRect(0, y(3 * sigma), pen.w, y(-3 * sigma) - y(3 * sigma)); }}));
    }
    selection.on(() => charts.forEach((chart) => chart.redraw()));
    return {marks: views.rows, rows: views.rows, tables: [views], words: '', good: `Good: no slope, no wave, no two levels (a slope is a scale, a wave an eccentric encoder, two levels are backlash). Band: 3σ of a reading; ${known > 0 ? ((100 * inside) / known).toFixed(0) : '–'} % are inside.`};
  },
};

export const rigView: Figure = {
  id: 'view', title: 'This view: how far off is each corner?', note: 'found → predicted · ← →', span: 10,
  draw(host, doc, selection) {
    const views = viewsOf(doc, selection), corners = doc.table('corners');
    if (!views || !corners) return null;
    const c = (name: string) => corners.numbers(name), view = c('view'), u = c('u_px'), v = c('v_px'), du = c('residual_u_px'), dv = c('residual_v_px');
    const caption = el('p', {class: 'caption'}), sizes = [0, 1, 2, 3].map((k) => ({width: doc.estimate(`heads[${k}].camera.width`), height: doc.estimate(`heads[${k}].camera.height`)})).filter((s) => s.width > 0);
    const size = sizes[0] ?? {width: 1.05 * quantile(u, 1), height: 1.05 * quantile(v, 1)}, typical = quantile(lengths(du, dv), 0.95);
    host.append(caption);
    const chart = new Chart(host, {height: 200, aspect: size.height / size.width, most: 520}, (pen) => {
      const panel = panelIn(size, 0, 0, pen.w, pen.h), {factor, bar_px, barLength} = magnificationFor(panel, typical, 0.06 * panel.w), k = factor * panel.perPixel;
      pen.rect(panel.x, panel.y, panel.w, panel.h, pen.c.panel, pen.c.soft);
      for (let i = 0; i < corners.rows; ++i) {
        if (view[i] !== selection.item) continue;
        const [x, y] = panel.at(u[i]!, v[i]!);
        pen.arrow(x, y, x + k * du[i]!, y + k * dv[i]!, pen.c.ink, 1.6, 6);
        pen.circle(x, y, 3.2, css(directionColour(du[i]!, dv[i]!)));
        pen.hit({x, y, tip: () => [`corner ${corners.text('corner', i)} at ${num(u[i]!, 5)}, ${num(v[i]!, 5)} px`, `residual ${num(du[i]!, 3)}, ${num(dv[i]!, 3)} px`]});
      }
      pen.scaleBar(panel.x + 14, panel.y + panel.h - 16, barLength, `${num(bar_px, 2)} px, arrows ×${num(factor, 2)}`);
    });
    const update = () => (caption.replaceChildren(el('b', {}, selection.item >= 0 ? nameOf(views, selection.item) : '–'), ` · RMS ${num(views.number('rms_px', selection.item), 3)} px`), chart.redraw());
    selection.on(update);
    update();
    return {marks: corners.rows, rows: corners.rows, tables: [corners], words: '', good: 'Good: arrows of no common direction. All one way: the reading of this view is off.'};
  },
};

const parameterRows: [string, string, string, string, number][] = [
  ['base x', 'world_from_base.translation_m[0]', 'world_from_base.translation_m[0]', 'mm', 1e3], ['base y', 'world_from_base.translation_m[1]', 'world_from_base.translation_m[1]', 'mm', 1e3], ['base z', 'world_from_base.translation_m[2]', 'world_from_base.translation_m[2]', 'mm', 1e3],
  ['pan to tilt', 'pan_to_tilt_m[2]', 'pan_to_tilt_m[2]', 'mm', 1e3], ['tilt to camera x', 'tilt_to_cam_m[0]', 'tilt_to_cam_m[0]', 'mm', 1e3], ['tilt to camera y', 'tilt_to_cam_m[1]', 'tilt_to_cam_m[1]', 'mm', 1e3],
  ['tilt to camera z', 'tilt_to_cam_m[2]', 'tilt_to_cam_m[2]', 'mm', 1e3], ['off square', 'axes_skew_rad', 'axes_skew_rad', '°', degrees], ['pan zero', 'encoder.pan_zero_rad', '', '°', degrees], ['tilt zero', 'encoder.tilt_zero_rad', '', '°', degrees],
  ['pan scale', 'encoder.pan_scale', 'encoder.pan_scale', '', 1], ['tilt scale', 'encoder.tilt_scale', 'encoder.tilt_scale', '', 1]];

export const rigEstimate: Figure = {
  id: 'estimate', title: 'Estimate', note: 'value ± 3σ', span: 10,
  draw(host, doc) {
    const heads = [0, 1, 2, 3].filter((k) => Number.isFinite(doc.estimate(`heads[${k}].id`)));
    if (heads.length === 0) return null;
    const hasModel = doc.estimates.some((one) => one.path.startsWith('heads[') && doc.inflation(one.path) > 0), body = el('tbody');
    for (const [name, path, sigmaPath, unit_, factor] of parameterRows)
      body.append(el('tr', {}, el('th', {}, name), ...heads.flatMap((k) => {
        const sigma = sigmaPath ? doc.sigma(`heads[${k}].${sigmaPath}`) : NaN, text = valueText(factor * doc.estimate(`heads[${k}].${path}`), factor * sigma);
        return [el('td', {class: 'value'}, text.value), el('td', {}, text.plusMinus ? `± ${text.plusMinus}` : sigma === 0 ? 'fixed' : ''), hasModel ? el('td', {class: 'right'}, times(doc.inflation(`heads[${k}].${sigmaPath}`))) : null];
      }), el('td', {class: 'unit'}, unit_)));
    host.append(el('div', {class: 'scroll'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, el('th'), ...heads.flatMap((k) => [el('th', {}, `head ${doc.estimate(`heads[${k}].id`)}`), el('th', {}, hasModel ? '3σ' : ''), hasModel ? el('th', {}, 'over model') : null]), el('th'))), body)));
    const relative = heads.length === 1 ? 'camera after a rotation, 3σ' : 'camera to camera, 3σ';
    const rest: [string, string, string, number][] = [[relative, 'sigma_relative_rad', '°', 3 * degrees], [relative, 'sigma_relative_m', 'mm', 3e3], ['RMS', 'rms_px', 'px', 1], ['χ² per degree of freedom', 'chi2_per_dof', '', 1], ['σ of a corner', 'noise.sigma_px', 'px', 1], ['σ of a reading', 'noise.sigma_encoder_rad', '°', degrees]];
    host.append(el('table', {class: 'estimate'}, ...rest.filter(([, path]) => Number.isFinite(doc.estimate(path))).map(([name, path, unit_, factor]) => el('tr', {}, el('th', {}, name), el('td', {class: 'value'}, num(factor * doc.estimate(path), 3)), el('td', {class: 'unit'}, unit_)))));
    return {marks: heads.length * parameterRows.length, rows: heads.length * parameterRows.length, tables: [], words: `${heads.length} heads`, good: `The world is the first camera at readings of zero.${hasModel ? ' Over model: how many times σ is above what it would be if every corner erred by itself.' : ''}`};
  },
};

const shortName = (name: string) => name.replace(/^head(\d+)\./, '$1 ').replace('pan_to_tilt', 'pt').replace('tilt_to_cam', 'tc').replace('base_', 'b').replace('cam_', 'c').replace('axes_skew', 'skew').replace('_zero', '0').replace(/_/g, '');

export const rigUnknown: Figure = {
  id: 'unknown', title: 'What does trade against what?', note: 'correlations above 0.9', span: 24,
  draw(host, doc) {
    const n = doc.covarianceNames.length, upper = doc.covarianceUpper;
    if (n < 2 || n > 200 || upper.length !== (n * (n + 1)) / 2) return null;
    const at = (i: number, j: number) => upper[i * n - (i * (i - 1)) / 2 + (j - i)]!, pairs: [number, string, string][] = [];
    for (let i = 0; i < n; ++i)
      for (let j = i + 1; j < n; ++j) {
        const rho = at(i, j) / Math.sqrt(at(i, i) * at(j, j));
        if (Math.abs(rho) > 0.9 && at(i, i) > 0 && at(j, j) > 0) pairs.push([rho, doc.covarianceNames[i]!, doc.covarianceNames[j]!]);
      }
    pairs.sort((a, b) => Math.abs(b[0]) - Math.abs(a[0]));
    const plain = (name: string) => name.replace(/^head(\d+)\./, 'head $1 ').replace(/_(m|rad)$/, '').replace(/_/g, ' ');
    const shown = pairs.slice(0, 12);
    if (shown.length === 0) return null;
    const list = el('ul', {class: 'legend'}, ...shown.map(([rho, a, b]) => el('li', {}, el('b', {}, num(rho, 3)), `${plain(a)} and ${plain(b)}`)));
    host.append(list);
    const matrix = correlationsOf(doc);
    if (matrix) drawCorrelations(host, {...matrix, names: matrix.names.map(shortName)});
    return {marks: shown.length, rows: shown.length, tables: [], words: `${pairs.length} pairs trade against each other`,
      good: 'Pairs like these are known together, not each by itself: what the rig is used for (camera to camera) may still be known well. ' +
        (doc.table('cameras') ? 'A path that goes nearer and further, and up and down, parts them.' : 'More turn about both axes and boards nearer and further part them.')};
  },
};
