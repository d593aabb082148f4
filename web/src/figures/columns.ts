// Groups of columns that several commands share: x y z with σ and truth.
import type {Table} from '../core/document';
import type {V3} from '../core/rigid';

export const axisNames = ['x', 'y', 'z'] as const;
export const axisColours = ['orange', 'green', 'blue'] as const;

export interface Triple {
  value: Float64Array[];
  at(i: number): V3;
}
export function triple(table: Table, before: string, after = '_m'): Triple {
  const value = axisNames.map((axis) => table.numbers(`${before}${axis}${after}`));
  return {value, at: (i) => [value[0]![i]!, value[1]![i]!, value[2]![i]!]};
}
export function hasTriple(table: Table, before: string, after = '_m'): boolean {
  return axisNames.every((axis) => table.hasValues(`${before}${axis}${after}`));
}

/** Row nearest to a time; −1 of none. */
export function rowAt(t: ArrayLike<number>, time: number): number {
  let best = -1, nearest = Infinity;
  if (Number.isFinite(time))
    for (let i = 0; i < t.length; ++i) {
      const distance = Math.abs(t[i]! - time);
      if (distance < nearest) best = i, (nearest = distance);
    }
  return best;
}
export function lastRow(values: Float64Array): number {
  for (let i = values.length; i-- > 0;) if (Number.isFinite(values[i]!)) return i;
  return -1;
}
