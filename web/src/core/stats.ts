// Counting, sorting, binning: what a page may do with numbers that others estimated.

export function finite(values: ArrayLike<number>): number[] {
  const out: number[] = [];
  for (let i = 0; i < values.length; ++i) if (Number.isFinite(values[i])) out.push(values[i]!);
  return out;
}

/** NaN of none. */
export function quantile(values: ArrayLike<number>, share: number): number {
  const sorted = Float64Array.from(finite(values)).sort();
  if (sorted.length === 0) return NaN;
  const place = Math.min(1, Math.max(0, share)) * (sorted.length - 1), below = Math.floor(place);
  const above = Math.min(below + 1, sorted.length - 1);
  return sorted[below]! + (place - below) * (sorted[above]! - sorted[below]!);
}

/** Lowest and highest finite value of all; null of none. Loops, as arrays may be longer than an argument list. */
export function extent(...all: ArrayLike<number>[]): [number, number] | null {
  let low = Infinity, high = -Infinity;
  for (const values of all)
    for (let i = 0; i < values.length; ++i) {
      const value = values[i]!;
      if (!Number.isFinite(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  return low <= high ? [low, high] : null;
}

export function largestSize(...all: ArrayLike<number>[]): number {
  const ends = extent(...all);
  return ends ? Math.max(Math.abs(ends[0]), Math.abs(ends[1])) : NaN;
}

export function lengths(u: ArrayLike<number>, v: ArrayLike<number>): Float64Array {
  return Float64Array.from({length: u.length}, (_, i) => Math.hypot(u[i]!, v[i]!));
}

export function scaled(values: ArrayLike<number>, factor: number): Float64Array {
  return Float64Array.from({length: values.length}, (_, i) => factor * values[i]!);
}

/** Quantile of χ² with `dof` degrees of freedom at the standard normal quantile `z` (Wilson and Hilferty). */
export function chi2Quantile(dof: number, z: number): number {
  const a = 2 / (9 * dof);
  return dof * Math.max(0, 1 - a + z * Math.sqrt(a)) ** 3;
}
export const z95 = 1.959964;

export function roundUp125(value: number): number {
  return round125(value, (mantissa) => (mantissa <= 1 ? 1 : mantissa <= 2 ? 2 : mantissa <= 5 ? 5 : 10));
}
export function roundDown125(value: number): number {
  return round125(value, (mantissa) => (mantissa < 2 ? 1 : mantissa < 5 ? 2 : 5));
}
function round125(value: number, choose: (mantissa: number) => number): number {
  if (!(value > 0) || !Number.isFinite(value)) return 1;
  const power = 10 ** Math.floor(Math.log10(value));
  return Number((choose(Number((value / power).toPrecision(9))) * power).toPrecision(9));
}
