// Marching squares: where a grid's value passes a level.
import type {Grid} from './document';

export type Segment = [number, number, number, number]; // u1, v1, u2, v2

export function contourSegments(grid: Grid, values: Float64Array, level: number): Segment[] {
  const segments: Segment[] = [];
  for (let row = 0; row + 1 < grid.rows; ++row)
    for (let col = 0; col + 1 < grid.cols; ++col) {
      const i = row * grid.cols + col;
      const corner = [values[i]!, values[i + 1]!, values[i + 1 + grid.cols]!, values[i + grid.cols]!];
      if (!corner.every(Number.isFinite)) continue;
      const crossings = crossingsOf(corner, level);
      if (crossings.length === 4 && (corner[0]! + corner[1]! + corner[2]! + corner[3]!) / 4 > level !== corner[0]! > level)
        crossings.unshift(crossings.pop()!); // a saddle: join the pairs on the same side of its middle
      for (let k = 0; k + 1 < crossings.length; k += 2) {
        const [a, b] = [crossings[k]!, crossings[k + 1]!];
        segments.push([grid.u0 + (col + a[0]) * grid.du, grid.v0 + (row + a[1]) * grid.dv,
          grid.u0 + (col + b[0]) * grid.du, grid.v0 + (row + b[1]) * grid.dv]);
      }
    }
  return segments;
}

const corners: [number, number][] = [[0, 0], [1, 0], [1, 1], [0, 1]];

/** Places on the four edges of a unit cell, going round; sizes are crossed in their logarithm where they are positive. */
function crossingsOf(corner: number[], level: number): [number, number][] {
  const found: [number, number][] = [];
  for (let k = 0; k < 4; ++k) {
    const a = corner[k]!, b = corner[(k + 1) % 4]!;
    if (a > level === b > level) continue;
    const share = a > 0 && b > 0 && level > 0 ? Math.log(level / a) / Math.log(b / a) : (level - a) / (b - a);
    const from = corners[k]!, to = corners[(k + 1) % 4]!;
    found.push([from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])]);
  }
  return found;
}
