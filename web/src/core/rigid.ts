// Rigid motions and lenses, as far as drawing needs them.
import type {Doc, Table} from './document';

export type V3 = [number, number, number];
export type M3 = [V3, V3, V3]; // rows

export const add = (a: V3, b: V3): V3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: V3, b: V3): V3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const mul = (a: V3, s: number): V3 => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: V3, b: V3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: V3, b: V3): V3 => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const norm = (a: V3): number => Math.hypot(...a);
export const unit = (a: V3): V3 => mul(a, 1 / (norm(a) || 1));
export const isFinite3 = (a: V3): boolean => a.every(Number.isFinite);

/** b_from_a. */
export interface Pose {
  t: V3;
  r: M3;
}

export function rotationOf(x: number, y: number, z: number, w: number): M3 {
  const n = Math.hypot(x, y, z, w) || 1;
  x /= n, y /= n, z /= n, w /= n;
  return [[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]];
}
export const turn = (r: M3, p: V3): V3 => [dot(r[0], p), dot(r[1], p), dot(r[2], p)];
export const transposed = (r: M3): M3 =>
  [[r[0][0], r[1][0], r[2][0]], [r[0][1], r[1][1], r[2][1]], [r[0][2], r[1][2], r[2][2]]];
export const column = (r: M3, k: 0 | 1 | 2): V3 => [r[0][k], r[1][k], r[2][k]];
export const move = (pose: Pose, p: V3): V3 => add(turn(pose.r, p), pose.t);
export function times(a: M3, b: M3): M3 {
  const t = transposed(b);
  return a.map((row) => [dot(row, t[0]), dot(row, t[1]), dot(row, t[2])]) as M3;
}
export const compose = (a: Pose, b: Pose): Pose => ({r: times(a.r, b.r), t: move(a, b.t)});
export const identity: Pose = {t: [0, 0, 0], r: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]};

/** Columns prefix_x_m … prefix_qw of a row; null if a part is missing. */
export function poseOf(table: Table, prefix: string, row: number): Pose | null {
  const part = (name: string) => table.number(`${prefix}_${name}`, row);
  const t: V3 = [part('x_m'), part('y_m'), part('z_m')];
  const q = [part('qx'), part('qy'), part('qz'), part('qw')] as const;
  return isFinite3(t) && q.every(Number.isFinite) ? {t, r: rotationOf(...q)} : null;
}

/** A camera as drawing needs it: where a point in it is seen. */
export interface Lens {
  width: number; height: number;
  fx: number; fy: number; cx: number; cy: number;
  project(p: V3): [number, number] | null;
}

export function lensOf(doc: Doc, path = 'camera'): Lens | null {
  const value = (name: string) => doc.estimate(`${path}.${name}`), or0 = (name: string) => value(name) || 0;
  const fx = value('fx'), fy = value('fy'), cx = value('cx'), cy = value('cy');
  if (!(fx > 0 && fy > 0) || !Number.isFinite(cx) || !Number.isFinite(cy)) return null;
  const isFisheye = doc.estimateText(`${path}.model`) === 'kannala_brandt';
  const k = ['k1', 'k2', 'k3', 'k4'].map(or0), p1 = or0('p1'), p2 = or0('p2');
  const size = doc.imageSize ?? {width: 2 * cx, height: 2 * cy};
  const project = (p: V3): [number, number] | null => {
    if (!(p[2] > 1e-9)) return null;
    const x = p[0] / p[2], y = p[1] / p[2], r2 = x * x + y * y;
    if (isFisheye) {
      const r = Math.sqrt(r2), theta = Math.atan(r), t2 = theta * theta;
      const d = r > 1e-9 ? (theta * (1 + t2 * (k[0]! + t2 * (k[1]! + t2 * (k[2]! + t2 * k[3]!))))) / r : 1;
      return [fx * d * x + cx, fy * d * y + cy];
    }
    const d = 1 + r2 * (k[0]! + r2 * (k[1]! + r2 * k[2]!));
    // Beyond the turning point a polynomial folds back: nothing is seen there.
    if (1 + r2 * (3 * k[0]! + r2 * (5 * k[1]! + r2 * 7 * k[2]!)) <= 0) return null;
    return [fx * (d * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx, fy * (d * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy];
  };
  return {...size, fx, fy, cx, cy, project};
}

/** Principal half-axes of a symmetric 3×3 covariance, as columns times σ (Jacobi). */
export function halfAxes(cov: M3): V3[] {
  const a = cov.map((row) => [...row]) as M3;
  let v: M3 = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 24; ++sweep)
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]] as const) {
      if (Math.abs(a[p][q]) < 1e-30) continue;
      const theta = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]), c = Math.cos(theta), s = Math.sin(theta);
      for (let k = 0; k < 3; ++k) {
        const x = a[k]![p], y = a[k]![q];
        a[k]![p] = c * x - s * y, a[k]![q] = s * x + c * y;
      }
      for (let k = 0; k < 3; ++k) {
        const x = a[p][k]!, y = a[q][k]!;
        a[p][k] = c * x - s * y, a[q][k] = s * x + c * y;
      }
      for (let k = 0; k < 3; ++k) {
        const x = v[k]![p], y = v[k]![q];
        v[k]![p] = c * x - s * y, v[k]![q] = s * x + c * y;
      }
    }
  return ([0, 1, 2] as const).map((k) => mul(column(v, k), Math.sqrt(Math.max(0, a[k][k]))));
}
