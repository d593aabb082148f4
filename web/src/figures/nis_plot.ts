// Normalised innovations with the bounds that 95 % keep: shared by observe, track and localize.
import type {Selection} from '../core/selection';
import {SeriesPlot, type EventMark} from '../core/series';
import {chi2Quantile, quantile, z95} from '../core/stats';
import {num} from '../core/format';

export interface NisLook {
  t: ArrayLike<number>;
  nis: Float64Array;
  dof: (i: number) => number;
  counts: (i: number) => boolean; // those that the share counts
  label: string;
  xLabel: string;
  height: number;
  selection: Selection;
  events?: EventMark[];
  spans?: {from: number; to: number}[];
  isFilling?: boolean;
}

export interface Share {
  known: number;
  inside: number;
}

/** Draws ratio, band and mean over 40 stretches of time. */
export function drawNis(host: HTMLElement, look: NisLook): Share {
  const n = look.nis.length, none = () => new Float64Array(n).fill(NaN), ratio = none(), low = none(), high = none(), mean = none();
  const share = {known: 0, inside: 0};
  for (let i = 0; i < n; ++i) {
    const dof = look.dof(i);
    if (!Number.isFinite(look.nis[i]!) || !(dof >= 1 && dof < 1e8)) continue;
    ratio[i] = look.nis[i]! / dof;
    low[i] = chi2Quantile(dof, -z95) / dof;
    high[i] = chi2Quantile(dof, z95) / dof;
    if (!look.counts(i)) continue;
    ++share.known;
    if (ratio[i]! >= low[i]! && ratio[i]! <= high[i]!) ++share.inside;
  }
  const first = look.t[0]!, width = (look.t[n - 1]! - first) / 40;
  for (let begin = 0; begin < n && width > 0;) {
    const slot = Math.floor((look.t[begin]! - first) / width);
    let end = begin, sum = 0, count = 0;
    for (; end < n && (end === begin || Math.floor((look.t[end]! - first) / width) === slot); ++end)
      if (Number.isFinite(ratio[end]!) && look.counts(end)) sum += ratio[end]!, ++count;
    for (let i = begin; i < end && count > 0; ++i) mean[i] = sum / count;
    begin = end;
  }
  if (share.known === 0 && !ratio.some(Number.isFinite)) return share;
  const bottom = Math.max(1e-3, Math.min(0.4, 0.7 * quantile(ratio, 0.01))), top = Math.max(3, 1.4 * quantile(high, 1), 1.3 * quantile(ratio, 1));
  new SeriesPlot(host, {t: look.t, isLog: true, label: look.label, xLabel: look.xLabel, height: look.height, selection: look.selection, events: look.events, spans: look.spans,
    isFilling: look.isFilling, bands: [{low, high, colour: 'blue', opacity: 0.18}], levels: [{value: 1, colour: 'ink'}], range: [bottom, Math.min(top, 1e4 * bottom)],
    lines: [{name: 'NIS / dof', values: ratio, colour: 'blue', isDots: true, size: n > 3000 ? 2 : 3.4}, {name: 'mean', values: mean, colour: 'orange', width: 2, isQuiet: true}],
    aria: `${look.label}; ${share.inside} of ${share.known} inside the 95 % bounds`,
    tip: (i) => [`${num(ratio[i]!, 3)} of ${look.dof(i)} degrees of freedom`, `95 %: ${num(low[i]!, 2)} … ${num(high[i]!, 2)}`]});
  return share;
}
