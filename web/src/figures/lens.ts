// Is the lens model enough? Mean residual against radius, and the error of richer models on photos they have not seen.
import {Chart, type Pen} from '../core/chart';
import type {Table} from '../core/document';
import {legend, type Figure} from '../core/figure';
import {num, shortened} from '../core/format';
import {scale, ticksOf, xAxis, yAxis} from '../core/scale';
import {largestSize, roundUp125} from '../core/stats';

function beyond(rings: Table): number {
  let count = 0;
  for (let i = 0; i < rings.rows; ++i) {
    const limit = 3 * rings.number('sigma_px', i);
    if (Math.abs(rings.number('mean_radial_px', i)) > limit || Math.abs(rings.number('mean_tangential_px', i)) > limit) ++count;
  }
  return count;
}

function drawRings(pen: Pen, rings: Table): void {
  const r = rings.numbers('radius_px'), sigma = rings.numbers('sigma_px');
  const kinds = [['mean_radial_px', 'radial', pen.c.blue, -3.5], ['mean_tangential_px', 'tangential', pen.c.orange, 3.5]] as const;
  const reach = (name: string) => rings.numbers(name).map((v, i) => Math.abs(v) + 3 * (sigma[i]! || 0));
  const limit = roundUp125(1.02 * largestSize(reach('mean_radial_px'), reach('mean_tangential_px')) || 1);
  const left = 56, right = pen.w - 10, bottom = pen.h - 40;
  const x = scale(0, 1.05 * largestSize(r), left, right), y = scale(-limit, limit, bottom, 22);
  yAxis(pen, y, left, right, {label: 'mean residual ± 3σ, px', wanted: 4});
  xAxis(pen, x, 22, bottom, {label: 'distance from the principal point, px', isGridHidden: true});
  for (let i = 0; i < rings.rows; ++i)
    for (const [name, word, colour, shift] of kinds) {
      const mean = rings.number(name, i), three = 3 * (sigma[i]! || 0), at = x(r[i]!) + shift;
      if (!Number.isFinite(mean + at)) continue;
      pen.line(at, y(mean - three), at, y(mean + three), colour, 1.6);
      if (word === 'radial') pen.circle(at, y(mean), 4, colour);
      else pen.rect(at - 3.5, y(mean) - 3.5, 7, 7, colour);
      pen.hit({x: at, y: y(mean), r: 5, tip: () => [`${word} at ${num(r[i]!, 3)} px`, `${num(mean, 3)} ± ${num(three, 2)} px (3σ)`]});
    }
}

function drawModels(pen: Pen, models: Table): void {
  const rms = models.numbers('heldout_rms_px'), sigma = models.numbers('sigma_px').map((s) => 3 * (s || 0));
  let low = Infinity, high = 0;
  rms.forEach((v, i) => {
    if (Number.isFinite(v)) low = Math.min(low, Math.max(v - sigma[i]!, 0.7 * v)), high = Math.max(high, Math.min(v + sigma[i]!, 1.5 * v));
  });
  if (!(high > 0)) return;
  const isLog = high > 3 * low, margin = isLog ? 0 : Math.max(0.15 * (high - low), 0.02 * high); // one that fails by far must not hide the others
  const left = 108, right = pen.w - 14, top = 24, bottom = pen.h - 40;
  const x = scale(isLog ? low / 1.1 : Math.max(0, low - margin), isLog ? high * 1.1 : high + margin, left, right, isLog), pitch = (bottom - top) / models.rows;
  pen.text('error on photos held out ± 3σ, px', 0, 9, {size: 11.5, weight: 600});
  xAxis(pen, x, top, bottom, {format: (v) => num(v, 3), wanted: Math.min(5, ticksOf(x, 5).length), label: 'RMS, px'});
  for (let i = 0; i < models.rows; ++i) {
    const y = top + pitch * (i + 0.5), value = rms[i]!;
    pen.text(shortened(models.text('name', i), 16), left - 8, y, {align: 'right', size: 11.5});
    if (!Number.isFinite(value)) continue;
    pen.line(Math.max(left, x(Math.max(1e-9, value - sigma[i]!))), y, Math.min(right, x(value + sigma[i]!)), y, pen.c.blue, 1.8);
    pen.circle(Math.min(right, Math.max(left, x(value))), y, 4.5, pen.c.blue);
    pen.hit({x: x(value), y, r: 9, tip: () => [models.text('name', i), `${num(value, 4)} ± ${num(sigma[i]!, 2)} px (3σ)`]});
  }
}

export const lens: Figure = {
  id: 'lens', title: 'Is the lens model enough?', note: 'px', span: 8,
  draw(host, doc) {
    const rings = doc.table('rings'), models = doc.table('models');
    if (!rings && !models) return null;
    const words = rings ? `${beyond(rings)} of ${rings.rows} rings are beyond 3σ.` : '';
    if (rings) {
      legend(host, [{words: 'radial', colour: 'var(--blue)', look: 'dot'}, {words: 'tangential', colour: 'var(--orange)', look: 'square'}]);
      new Chart(host, {height: 210, isFilling: true, label: `Mean residual of rings; ${words}`}, (pen) => drawRings(pen, rings));
    }
    if (models) new Chart(host, {height: 66 + 22 * models.rows, label: 'Error on held-out photos for each lens model'}, (pen) => drawModels(pen, models));
    const count = (rings?.rows ?? 0) + (models?.rows ?? 0);
    return {marks: count, rows: count, tables: [rings, models].filter((t) => t !== null), words,
      good: `Good: every interval reaches zero, and no richer model does better on photos it has not seen. Here ${words}`};
  },
};
