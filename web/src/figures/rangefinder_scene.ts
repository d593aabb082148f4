// What the figures of `rangefinder` draw, out of its tables.
import type {Doc, Table} from '../core/document';
import {cross, dot, isFinite3, lensOf, mul, norm, poseOf, unit, add, type Lens, type M3, type Pose, type V3} from '../core/rigid';
import type {Selection} from '../core/selection';

export interface Shot {
  name: string; reason: string; isUsed: boolean;
  range_m: number;
  dRange_m: number; sRange_m: number;
  u: number; v: number; du: number; dv: number; su: number; sv: number; cuv: number;
  left: {range_m: number; u: number; v: number} | null; // as the other shots predict it
  hit: V3;
  normal: V3; d_m: number; pose: Pose | null;
}
export interface Beam {
  origin: V3; direction: V3; scale: number;
  cov: number[][] | null; // of origin, direction, scale
}
export interface RangefinderScene {
  shots: Shot[];
  beam: Beam | null;
  lens: Lens | null;
  board: {cols: number; rows: number; square_m: number} | null;
  worstFirst: number[];
  table: Table;
}

const scenes = new WeakMap<Doc, RangefinderScene | null>();

export function rangefinderScene(doc: Doc, selection: Selection): RangefinderScene | null {
  let scene = scenes.get(doc);
  if (scene === undefined) {
    scenes.set(doc, (scene = read(doc)));
    if (scene) selection.offer(scene.worstFirst);
  }
  return scene;
}

/** Residual over σ, the worse of range and spot; 0 where there is none. */
export function severity(shot: Shot): number {
  const range = Math.abs(shot.dRange_m) / shot.sRange_m, spot = Math.max(Math.abs(shot.du) / shot.su, Math.abs(shot.dv) / shot.sv);
  return Math.max(Number.isFinite(range) ? range : 0, Number.isFinite(spot) ? spot : 0);
}

function read(doc: Doc): RangefinderScene | null {
  const table = doc.table('shots');
  if (!table) return null;
  const shots = shotsOf(doc, table), all = shots.map((_, i) => i);
  const cols = doc.estimate('board.cols'), rows = doc.estimate('board.rows'), square_m = doc.estimate('board.square_m');
  return {shots, table, beam: doc.isAnswer ? beamOf(doc) : null, lens: lensOf(doc),
    board: cols > 1 && rows > 1 && square_m > 0 && cols < 500 && rows < 500 ? {cols, rows, square_m} : null,
    worstFirst: all.sort((a, b) => Number(shots[b]!.isUsed) - Number(shots[a]!.isUsed) || severity(shots[b]!) - severity(shots[a]!))};
}

function shotsOf(doc: Doc, table: Table): Shot[] {
  const planes = doc.table('planes'), left = doc.table('left_out'), planeOf = new Map<string, number>(), leftOf = new Map<number, number>();
  for (let i = 0; planes && i < planes.rows; ++i) planeOf.set(planes.text('name', i), i);
  for (let i = 0; left && i < left.rows; ++i) leftOf.set(left.number('shot', i), i);
  return Array.from({length: table.rows}, (_, i) => {
    const n = (name: string) => table.number(name, i), plane = planeOf.get(table.text('name', i)), out = leftOf.get(i);
    const p = (name: string) => (planes && plane !== undefined ? planes.number(name, plane) : NaN);
    return {name: table.text('name', i), reason: table.text('reason', i), isUsed: n('used') > 0, range_m: n('range_m'), dRange_m: n('residual_range_m'), sRange_m: n('sigma_residual_range_m'),
      u: n('u_px'), v: n('v_px'), du: n('residual_u_px'), dv: n('residual_v_px'), su: n('sigma_residual_u_px'), sv: n('sigma_residual_v_px'), cuv: n('cov_residual_uv_px2'),
      left: left && out !== undefined ? {range_m: left.number('residual_range_m', out), u: left.number('residual_u_px', out), v: left.number('residual_v_px', out)} : null,
      // Without an answer there is no beam to hit anything.
      hit: (doc.isAnswer ? [n('point_in_cam_x_m'), n('point_in_cam_y_m'), n('point_in_cam_z_m')] : [NaN, NaN, NaN]) as V3,
      normal: [p('nx'), p('ny'), p('nz')] as V3, d_m: p('d_m'), pose: planes && plane !== undefined ? poseOf(planes, 'cam_from_board', plane) : null};
  });
}

function beamOf(doc: Doc): Beam | null {
  const v3 = (name: string) => [0, 1, 2].map((k) => doc.estimate(`${name}[${k}]`)) as V3;
  const origin = v3('origin_m'), direction = v3('direction'), scale = doc.estimate('scale');
  if (!isFinite3(origin) || !isFinite3(direction) || !(norm(direction) > 0.1)) return null;
  let cov: number[][] | null = null;
  if (doc.covarianceNames.length === 7 && doc.covarianceUpper.length === 28 && doc.covarianceUpper.every(Number.isFinite)) {
    cov = Array.from({length: 7}, () => new Array<number>(7).fill(0));
    for (let i = 0, at = 0; i < 7; ++i) for (let j = i; j < 7; ++j) cov[i]![j] = cov[j]![i] = doc.covarianceUpper[at++]!;
  }
  return {origin, direction: unit(direction), scale: scale > 0 ? scale : 1, cov};
}

export const pointAt = (beam: Beam, range_m: number): V3 => add(beam.origin, mul(beam.direction, beam.scale * range_m));

/** Covariance of the beam's point at a reading. */
export function covAt(beam: Beam, range_m: number): M3 | null {
  const {cov} = beam;
  if (!cov) return null;
  const s = beam.scale * range_m;
  const jacobian = [0, 1, 2].map((i) => [0, 1, 2, 3, 4, 5, 6].map((k) => (k === i ? 1 : k === 3 + i ? s : k === 6 ? beam.direction[i]! * range_m : 0)));
  return [0, 1, 2].map((i) => [0, 1, 2].map((j) => {
    let sum = 0;
    for (let a = 0; a < 7; ++a) for (let b = 0; b < 7; ++b) sum += jacobian[i]![a]! * cov[a]![b]! * jacobian[j]![b]!;
    return sum;
  })) as unknown as M3;
}
export const covOrigin = (beam: Beam): M3 | null => (beam.cov ? ([0, 1, 2].map((i) => beam.cov![i]!.slice(0, 3)) as unknown as M3) : null);

/** σ of the beam across itself in two directions, as its cone shows it. */
export function coneSigmas(beam: Beam, range_m: number): {axes: [V3, V3]; sigma: [number, number]} | null {
  const cov = covAt(beam, range_m);
  if (!cov) return null;
  const x = unit(cross([0, 1, 0], beam.direction)), y = cross(beam.direction, x);
  const form = (a: V3, b: V3) => dot(a, [dot(cov[0], b), dot(cov[1], b), dot(cov[2], b)]);
  return {axes: [x, y], sigma: [Math.sqrt(Math.max(0, form(x, x))), Math.sqrt(Math.max(0, form(y, y)))]};
}
