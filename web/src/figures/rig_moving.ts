// Cameras placed by a moving target: where each stands and how its clock goes; all of them and the path in space.
import {Chart} from '../core/chart';
import type {Doc, Table} from '../core/document';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {degrees, num, times, valueText} from '../core/format';
import {add, halfAxes, isFinite3, mul, norm, poseOf, type M3, type V3} from '../core/rigid';
import {scale, xAxis} from '../core/scale';
import {extent, roundDown125} from '../core/stats';
import {View3} from '../core/view3';
import {ballOf, World} from '../core/world';
import {hasTriple, triple} from './columns';
import {scatter} from './scatter';

const colours = ['blue', 'orange', 'green', 'purple', 'sky', 'red'] as const;
const target = 'target_in_world_';

function camerasOf(doc: Doc): Table | null {
  const cameras = doc.table('cameras');
  return cameras && hasTriple(cameras, 'world_from_cam_') ? cameras : null;
}
function covOf(cameras: Table, i: number): M3 {
  const c = (name: string) => cameras.number(`cov_${name}_m2`, i);
  return [[c('xx'), c('xy'), c('xz')], [c('xy'), c('yy'), c('yz')], [c('xz'), c('yz'), c('zz')]];
}
/** Half-axes of 3σ; none of the camera that the frame is fixed to. */
function threeSigma(cameras: Table, i: number): V3[] | null {
  const axes = covOf(cameras, i).every(isFinite3) ? halfAxes(covOf(cameras, i)).map((axis) => mul(axis, 3)) : null;
  return axes && Math.max(...axes.map(norm)) > 0 ? axes : null;
}

/** σ of a parameter by its name in the covariance; 0 where there is none. */
function sigmaNamed(doc: Doc, name: string): number {
  const n = doc.covarianceNames.length, i = doc.covarianceNames.indexOf(name);
  return i < 0 ? 0 : Math.sqrt(Math.max(0, doc.covarianceUpper[i * n - (i * (i - 1)) / 2] ?? 0));
}

export const movingEstimate: Figure = {
  id: 'estimate', title: 'Where does each camera stand?', note: 'value ± 3σ', span: 8,
  draw(host, doc) {
    const cameras = camerasOf(doc);
    if (!cameras) return null;
    const indices = Array.from({length: 40}, (_, k) => k).filter((k) => Number.isFinite(doc.estimate(`cameras[${k}].id`)));
    const isOneFixed = Array.from({length: cameras.rows}, (_, r) => covOf(cameras, r)[0]![0]!).some((variance) => variance === 0);
    const pair = (value: number, sigma: number, isHeld = sigma === 0) => { const text = valueText(value, sigma); return [el('td', {class: 'value'}, text.value), el('td', {}, text.plusMinus ? `± ${text.plusMinus}` : isHeld ? 'fixed' : '')]; };
    const body = el('tbody');
    for (const k of indices) {
      const e = (name: string) => doc.estimate(`cameras[${k}].${name}`), isPlaced = doc.estimateText(`cameras[${k}].placed`) !== 'false';
      body.append(el('tr', {class: 'group'}, el('th', {colspan: 4}, `camera ${e('id')} · ${isPlaced ? `${e('used')} of ${e('sights')} observations, RMS ${num(e('rms_px'), 2)} px` : `not located: ${doc.estimateText(`cameras[${k}].reason`) || '–'}`}`)));
      if (!isPlaced) continue;
      ['x', 'y', 'z'].forEach((axis, i) => {
        const row = Array.from({length: cameras.rows}, (_, r) => r).find((r) => cameras.number('id', r) === e('id')) ?? -1;
        body.append(el('tr', {}, el('th', {}, axis), ...pair(cameras.number(`world_from_cam_${axis}_m`, row), Math.sqrt(covOf(cameras, row)[i]![i]!)), el('td', {class: 'unit'}, 'm')));
      });
      const turn = 3 * degrees * Math.hypot(...['rx', 'ry', 'rz'].map((axis) => sigmaNamed(doc, `head${e('id')}.base_${axis}_rad`)));
      const over = Math.max(0, ...[0, 1, 2].map((i) => doc.inflation(`heads[${k}].world_from_base.translation_m[${i}]`) || 0));
      if (over > 0) body.append(el('tr', {}, el('th', {}, 'σ over model'), el('td'), el('td', {}, `up to ${times(over)}`), el('td')));
      if (turn > 0) body.append(el('tr', {}, el('th', {}, 'attitude'), el('td'), el('td', {}, `± ${num(turn, 2)}`), el('td', {class: 'unit'}, '°')));
      if (e('sigma_clock_s') > 0 || Math.abs(e('clock_offset_s')) > 0) body.append(el('tr', {}, el('th', {}, 'clock'), ...pair(e('clock_offset_s'), e('sigma_clock_s')), el('td', {class: 'unit'}, 's')));
    }
    host.append(el('div', {class: 'scroll'}, el('table', {class: 'estimate'}, body)));
    return {marks: indices.length, rows: indices.length, tables: [cameras], words: `${cameras.rows} cameras located`, good: `${isOneFixed ? 'Fixed: the σ of the others are relative to this camera. ' : ''}Clock: offset of the rig’s time from the camera’s own.`};
  },
};

function movingWorld(cameras: Table, path: Table | null, factor: number): World {
  const world = new World(), at = path ? triple(path, target) : null, places = at ? Array.from({length: path!.rows}, (_, i) => at.at(i)).filter(isFinite3) : [];
  const poses = Array.from({length: cameras.rows}, (_, i) => poseOf(cameras, 'world_from_cam', i));
  world.hold(...places, ...poses.flatMap((pose) => (pose ? [pose.t] : [])));
  const size = 0.26 * ballOf(world.frame).radius;
  world.line(pathPieces(path, places), {colour: 'ink', width: 2});
  poses.forEach((pose, i) => {
    if (!pose) return;
    const colour = colours[i % colours.length]!, half: [number, number] = [cameras.number('half_view_x', i) || 0.5, cameras.number('half_view_y', i) || 0.4];
    const corners = world.frustum(pose, half, size / Math.max(1, norm([...half, 1])), {colour, width: 2.2});
    world.face(corners, colour, 0.2, {tip: () => [`camera ${cameras.text('id', i)}`, `${num(cameras.number('num_used', i), 6)} observations used, RMS ${num(cameras.number('rms_px', i), 2)} px`]});
    world.label(add(pose.t, mul(isUpright(cameras), 0.35 * size)), `camera ${cameras.text('id', i)}`, colour);
    world.hold(...corners);
    const three = threeSigma(cameras, i);
    if (three) world.ellipsoid(pose.t, three.map((axis) => mul(axis, factor)), 'red');
  });
  return world;
}
/** The path as it was seen; where nobody saw it for a while the line breaks. */
function pathPieces(path: Table | null, places: V3[]): V3[] {
  const t = path?.numbers('t_s'), out: V3[] = [], steps = t ? Array.from(t.slice(1), (v, i) => v - t[i]!).sort((a, b) => a - b) : [], usual = steps[Math.floor(steps.length / 2)] ?? 0;
  places.forEach((p, i) => {
    if (t && i > 0 && t[i]! - t[i - 1]! > 8 * usual) out.push([NaN, NaN, NaN]);
    out.push(p);
  });
  return out;
}

export const movingSpace: Figure = {
  id: 'space', title: 'Where are the cameras, and where did the target go?', note: 'world frame, m · drag to turn', span: 16,
  draw(host, doc) {
    const cameras = camerasOf(doc), path = doc.table('path');
    if (!cameras) return null;
    const sizes = Array.from({length: cameras.rows}, (_, i) => Math.max(0, ...(threeSigma(cameras, i) ?? []).map(norm))), largest = Math.max(...sizes);
    const all = Array.from({length: cameras.rows}, (_, i) => triple(cameras, 'world_from_cam_').at(i)), factor = largest > 0 ? Math.max(1, roundDown125((0.05 * ballOf(all).radius) / largest)) : 1;
    legend(host, [...all.map((_, i) => ({words: `camera ${cameras.text('id', i)}`, colour: `var(--${colours[i % colours.length]!})`, look: 'square' as const})), ...(path ? [{words: 'the target’s path', colour: 'var(--ink)'}] : []),
      ...(largest > 0 ? [{words: `3σ of a place, ${factor} ×`, colour: 'var(--red)', look: 'ring' as const}] : [])]);
    const label = `${cameras.rows} cameras${path ? ` and a path through ${path.rows} points` : ''}`;
    new View3(host, {height: 400, isFilling: true, up: isUpright(cameras), ahead: aheadOf(cameras), yaw: 0.6, pitch: 0.45, label}, () => movingWorld(cameras, path, factor));
    return {marks: cameras.rows, rows: cameras.rows, tables: [cameras, ...(path ? [path] : [])], words: label,
      good: `Good: cameras around the path, not all on one side of it, ellipsoids small against their distances.${largest > 0 ? ` Here 3σ of a place is at most ${num(largest, 2)} m.` : ''}`};
  },
};
/** Upwards in the world: against the cameras' own downward axes, in the mean, along the nearest axis of the frame. */
function isUpright(cameras: Table): V3 {
  const sum: V3 = [0, 0, 0];
  for (let i = 0; i < cameras.rows; ++i) {
    const pose = poseOf(cameras, 'world_from_cam', i);
    if (pose) for (const k of [0, 1, 2] as const) sum[k] -= pose.r[k][1];
  }
  const best = [0, 1, 2].reduce((a, b) => (Math.abs(sum[b]!) > Math.abs(sum[a]!) ? b : a));
  return [0, 1, 2].map((k) => (k === best ? Math.sign(sum[k]!) || 1 : 0)) as V3;
}
function aheadOf(cameras: Table): V3 {
  return isUpright(cameras)[2] !== 0 ? [0, 1, 0] : [0, 0, 1];
}

export const movingAbove: Figure = {
  id: 'above', title: 'And from above?', note: 'm', span: 12,
  draw(host, doc) {
    const cameras = camerasOf(doc), path = doc.table('path');
    if (!cameras || !path || !hasTriple(path, target)) return null;
    const up = isUpright(cameras), [a, b] = up[2] !== 0 ? [0, 1] : up[1] !== 0 ? [0, 2] : [1, 2], axis = ['x', 'y', 'z'];
    const p = triple(path, target), c = triple(cameras, 'world_from_cam_'), every = Math.max(1, Math.floor(path.rows / 800)), rows = Array.from({length: path.rows}, (_, i) => i).filter((i) => i % every === 0), t = path.numbers('t_s');
    const dots = rows.map((i) => ({x: p.value[a!]![i]!, y: p.value[b!]![i]!, size: 1.5, colour: (pen: {c: {ink: string}}) => pen.c.ink, tip: () => [`${num(t[i]!, 5)} s`, `${p.at(i).map((v) => num(v, 4)).join(', ')} m`]}));
    const stands = Array.from({length: cameras.rows}, (_, i) => ({x: c.value[a!]![i]!, y: c.value[b!]![i]!, size: 6, shape: 'square' as const, colour: (pen: {c: Record<string, unknown>}) => String(pen.c[colours[i % colours.length]!]), tip: () => [`camera ${cameras.text('id', i)}`]}));
    scatter(host, [...dots, ...stands] as Parameters<typeof scatter>[1], {xLabel: `${axis[a!]}, m`, yLabel: `${axis[b!]}, m`, height: 320, isFilling: true, isSquare: true, label: 'Cameras and path from above'});
    return {marks: rows.length + cameras.rows, rows: rows.length + cameras.rows, tables: [path, cameras], words: '', good: 'Squares: cameras, in their colours; dots: the target.'};
  },
};

export const movingClocks: Figure = {
  id: 'clocks', isOptional: true, title: 'How well is each clock known?', note: '3σ amid a camera’s observations, ms', span: 12,
  draw(host, doc) {
    const indices = Array.from({length: 40}, (_, k) => k).filter((k) => doc.estimate(`cameras[${k}].sigma_clock_s`) > 0);
    if (indices.length === 0) return null;
    const bars = indices.map((k) => [doc.estimate(`cameras[${k}].id`), 3e3 * doc.estimate(`cameras[${k}].sigma_clock_s`)] as const), ends = extent(bars.map(([, v]) => v))!;
    new Chart(host, {height: 70 + 34 * bars.length, isFilling: true, label: `3σ of clocks, at most ${num(ends[1], 2)} ms`}, (pen) => {
      const left = 84, right = pen.w - 64, bottom = pen.h - 40, x = scale(0, 1.05 * ends[1], left, right), pitch = (bottom - 8) / bars.length;
      xAxis(pen, x, 8, bottom, {label: '3σ of the clock, ms'});
      bars.forEach(([id, value], i) => {
        const y = 8 + pitch * i;
        pen.text(`camera ${id}`, left - 8, y + pitch / 2, {align: 'right', size: 11.5, colour: pen.c.soft});
        pen.rect(left, y + 0.18 * pitch, x(value) - left, 0.64 * pitch, pen.c.blue);
        pen.text(num(value, 2), x(value) + 6, y + pitch / 2, {size: 11.5, weight: 650});
      });
    });
    return {marks: bars.length, rows: bars.length, tables: [], words: `at most ${num(ends[1], 2)} ms`, good: 'Good: short against the time in which the target moves by as much as its position is known. The camera rejected here has the rig’s clock.'};
  },
};
