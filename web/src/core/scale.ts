// Places on paper for values, and round values to write beside them.
import {num} from './format';
import type {Pen} from './chart';

export interface Scale {
  low: number; high: number; from: number; to: number; isLog: boolean;
  (value: number): number;
  invert(place: number): number;
  holds(value: number): boolean;
}

export function scale(low: number, high: number, from: number, to: number, isLog = false): Scale {
  if (!(high > low)) high = low + (Math.abs(low) || 1) * 1e-3;
  const map = isLog ? Math.log : (x: number) => x, back = isLog ? Math.exp : (x: number) => x;
  const a = map(low), factor = (to - from) / (map(high) - a);
  const made = ((value: number) =>
    isLog && value <= 0 ? from - 1e4 * Math.sign(to - from) : from + (map(value) - a) * factor) as Scale;
  Object.assign(made, {low, high, from, to, isLog,
    invert: (place: number) => back(a + (place - from) / factor),
    holds: (value: number) => value >= low - 1e-12 * Math.abs(low) && value <= high + 1e-12 * Math.abs(high)});
  return made;
}

export function linearTicks(low: number, high: number, wanted: number): number[] {
  const span = high - low;
  if (!(span > 0) || !Number.isFinite(span)) return [];
  const raw = span / Math.max(1, wanted), power = 10 ** Math.floor(Math.log10(raw)), m = raw / power;
  const step = (m <= 1 ? 1 : m <= 2 ? 2 : m <= 2.5 ? 2.5 : m <= 5 ? 5 : 10) * power;
  const ticks: number[] = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step && ticks.length < 60; ++k)
    ticks.push(Number((k * step).toPrecision(12)));
  return ticks;
}

export function logTicks(low: number, high: number): number[] {
  const decades = Math.log10(high / low), ticks: number[] = [];
  const mantissas = decades < 1.2 ? [1, 2, 3, 5, 7] : decades < 3.5 ? [1, 2, 5] : [1];
  const every = decades > 7 ? Math.ceil(decades / 6) : 1;
  for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); ++power) {
    if (((power % every) + every) % every !== 0) continue;
    for (const m of mantissas) {
      const tick = Number((m * 10 ** power).toPrecision(12));
      if (tick >= low * 0.999999 && tick <= high * 1.000001) ticks.push(tick);
    }
  }
  return ticks.length > 1 ? ticks : linearTicks(low, high, 3).filter((tick) => tick > 0);
}

export function ticksOf(s: Scale, wanted: number): number[] {
  return s.isLog ? logTicks(s.low, s.high) : linearTicks(s.low, s.high, wanted);
}

interface AxisWords {
  label?: string;
  format?: (value: number) => string;
  wanted?: number;
  isGridHidden?: boolean;
}

/** Lines across, ticks at the left. */
export function yAxis(pen: Pen, y: Scale, left: number, right: number, words: AxisWords = {}): void {
  const format = words.format ?? ((v: number) => num(v, 3));
  for (const tick of ticksOf(y, words.wanted ?? Math.max(2, Math.abs(y.from - y.to) / 42))) {
    if (!words.isGridHidden) pen.line(left, y(tick), right, y(tick), tick === 0 && !y.isLog ? pen.c.soft : pen.c.grid);
    pen.text(format(tick), left - 6, y(tick), {align: 'right', colour: pen.c.soft, size: 11});
  }
  if (words.label) pen.text(words.label, left, Math.min(y.from, y.to) - 11, {colour: pen.c.ink, size: 11.5, weight: 600});
}

/** Ticks below, and what they are; those that would touch are omitted. */
export function xAxis(pen: Pen, x: Scale, top: number, bottom: number, words: AxisWords = {}): void {
  const format = words.format ?? ((v: number) => num(v, 4));
  let last = -Infinity, lastHalf = 0;
  for (const tick of ticksOf(x, words.wanted ?? Math.max(2, Math.abs(x.to - x.from) / 70))) {
    const text = format(tick), half = pen.width(text, 11) / 2;
    if (!words.isGridHidden) pen.line(x(tick), top, x(tick), bottom, tick === 0 && !x.isLog ? pen.c.soft : pen.c.grid);
    if (Math.abs(x(tick) - last) < half + lastHalf + 6) continue;
    pen.text(text, x(tick), bottom + 11, {align: 'center', colour: pen.c.soft, size: 11});
    last = x(tick), (lastHalf = half);
  }
  if (words.label) pen.text(words.label, (x.from + x.to) / 2, bottom + 28, {align: 'center', colour: pen.c.soft, size: 11.5});
}
