// Does each shot fit? Range and spot residuals with ± 3σ, and as the other shots predict them.
import {Chart, type Pen} from '../core/chart';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {num, percent} from '../core/format';
import {scale, yAxis, type Scale} from '../core/scale';
import {faded} from '../core/colours';
import {largestSize} from '../core/stats';
import type {Selection} from '../core/selection';
import {rangefinderScene, type Shot} from './rangefinder_scene';

interface Series {
  label: string;
  unit: string;
  parts: {name: string; colour: 'ink' | 'blue' | 'orange'; of: (s: Shot) => [value: number, sigma: number, leftOut: number]}[];
}
const ranges: Series = {label: 'range as the board says − as read, mm', unit: 'mm', parts: [{name: 'range', colour: 'ink', of: (s) => [1e3 * s.dRange_m, 1e3 * s.sRange_m, 1e3 * (s.left?.range_m ?? NaN)]}]};
const spots: Series = {label: 'spot predicted − seen, px', unit: 'px', parts: [
  {name: 'spot u', colour: 'blue', of: (s) => [s.du, s.su, s.left?.u ?? NaN]}, {name: 'spot v', colour: 'orange', of: (s) => [s.dv, s.sv, s.left?.v ?? NaN]}]};

function drawPanel(pen: Pen, shots: [Shot, number][], series: Series, top: number, bottom: number, selection: Selection): void {
  const left = 46, right = pen.w - 6, pitch = (right - left) / shots.length, sizes: number[] = [];
  for (const [shot] of shots) if (shot.isUsed) for (const part of series.parts) sizes.push(...part.of(shot).map((v, k) => (k === 1 ? 3 * v : v)));
  const limit = 1.08 * largestSize(sizes) || 1, y = scale(-limit, limit, bottom, top);
  yAxis(pen, y, left, right, {label: series.label, wanted: 4});
  shots.forEach(([shot, index], place) => {
    const middle = left + pitch * (place + 0.5);
    if (index === selection.item) pen.rect(left + pitch * place, top - 4, pitch, bottom - top + 8, faded(pen.c.orange, 0.16));
    series.parts.forEach((part, k) => drawMark(pen, part.of(shot), shot, middle + (series.parts.length > 1 ? (k - 0.5) * Math.min(13, 0.4 * pitch) : 0), y, pen.c[part.colour], k === 1, pitch));
    pen.hit({x: middle, y: (top + bottom) / 2, w: pitch, h: bottom - top, pick: () => selection.choose(index), tip: () => [shot.name, `${num(shot.range_m, 4)} m${shot.isUsed ? '' : `, not used: ${shot.reason}`}`,
      ...series.parts.map((part) => { const [v, s, l] = part.of(shot); return `${part.name} ${num(v, 3)} ± ${num(3 * s, 2)} ${series.unit}${Number.isFinite(l) ? `; by the others ${num(l, 3)}` : ''}`; })]});
  });
}

function drawMark(pen: Pen, [value, sigma, left]: [number, number, number], shot: Shot, x: number, y: Scale, colour: string, isSquare: boolean, pitch: number): void {
  if (!Number.isFinite(value)) return;
  const w = Math.max(1.5, Math.min(9, 0.3 * pitch)), clamp = (v: number) => Math.min(y.from, Math.max(y.to, y(v)));
  if (sigma > 0) pen.rect(x - w / 2, clamp(3 * sigma), w, clamp(-3 * sigma) - clamp(3 * sigma), faded(pen.c.soft, 0.28));
  if (!y.holds(value)) { // at the edge, pointing outwards; how far out it lies would hide the rest
    const at = clamp(value), out = value > 0 ? -1 : 1;
    pen.fill([x - 5, at - 2 * out, x + 5, at - 2 * out, x, at + 6 * out], pen.c.red);
    pen.text(num(value, 2), x, at - 12 * out, {align: 'center', size: 10.5, colour: pen.c.red});
    return;
  }
  const r = pitch > 10 ? 3.6 : 2;
  if (Number.isFinite(left) && pitch > 8) pen.circle(x, clamp(left), r + 1.8, null, pen.c.soft, 1.3);
  if (!shot.isUsed) pen.cross(x, y(value), r, pen.c.soft, 1.6);
  else if (isSquare) pen.rect(x - r, y(value) - r, 2 * r, 2 * r, colour);
  else pen.circle(x, y(value), r, colour);
}

export const rangefinderResiduals: Figure = {
  id: 'residuals', title: 'Does each shot fit?', note: 'mm and px, ± 3σ · click a shot', span: 14,
  draw(host, doc, selection) {
    const scene = rangefinderScene(doc, selection);
    if (!scene) return null;
    const all = scene.shots.map((shot, i) => [shot, i] as [Shot, number]), has = (series: Series) => all.some(([s]) => series.parts.some((p) => Number.isFinite(p.of(s)[0])));
    const panels = [ranges, spots].filter(has), step = Math.ceil(all.length / 400), shown = all.filter(([shot, i]) => i % step === 0 || !shot.isUsed);
    if (panels.length === 0) return null;
    let known = 0, inside = 0;
    for (const [shot] of all)
      for (const part of panels.flatMap((p) => p.parts)) {
        const [v, s] = part.of(shot);
        if (shot.isUsed && Number.isFinite(v) && s > 0) ++known, (inside += Number(Math.abs(v) <= 3 * s));
      }
    legend(host, [{words: '± 3σ', colour: 'var(--soft)', look: 'band'}, {words: 'range', colour: 'var(--ink)', look: 'dot'}, {words: 'spot u', colour: 'var(--blue)', look: 'dot'}, {words: 'spot v', colour: 'var(--orange)', look: 'square'},
      ...(all.some(([s]) => s.left) ? [{words: 'as the other shots predict it', colour: 'var(--soft)', look: 'ring' as const}] : []), ...(all.some(([s]) => !s.isUsed) ? [{words: 'not used (red triangle: beyond the axis)', colour: 'var(--soft)', look: 'cross' as const}] : [])]);
    const words = `of the residuals of used shots ${percent(inside, known, 1)} are inside 3σ (99.7 % expected)`;
    const chart = new Chart(host, {height: 120 + 150 * panels.length, isFilling: true, label: words}, (pen) => {
      const foot = 34, h = (pen.h - foot) / panels.length, pitch = (pen.w - 52) / shown.length;
      panels.forEach((series, k) => drawPanel(pen, shown, series, 24 + k * h, (k + 1) * h - 8, selection));
      const every = Math.max(1, Math.ceil(50 / pitch));
      shown.forEach(([shot, i], place) => {
        if (place % every !== 0) return;
        const x = 46 + pitch * (place + 0.5);
        pen.text(String(i + 1), x, pen.h - 25, {align: 'center', size: 11, colour: pen.c.soft});
        pen.text(`${num(shot.range_m, 3)} m`, x, pen.h - 9, {align: 'center', size: 11, colour: pen.c.soft});
      });
      pen.text('shot', 2, pen.h - 25, {size: 11, colour: pen.c.soft});
    });
    selection.on(() => chart.redraw());
    const unused = all.filter(([s]) => !s.isUsed);
    if (unused.length > 0)
      host.append(el('details', {class: 'reasons', open: unused.length <= 6}, el('summary', {}, `${unused.length} shot${unused.length === 1 ? '' : 's'} not used`),
        el('ul', {}, ...unused.slice(0, 100).map(([s, i]) => el('li', {}, `shot ${i + 1} `, el('b', {}, s.name), `: ${s.reason || 'no reason given'}`)))));
    return {marks: shown.length, rows: shown.length, tables: [scene.table], words,
      good: doc.isAnswer ? `Good: marks inside their bars, on both sides of zero; rings hardly further out. Here ${words}.` : 'No answer: shots may fit each other and still not tell where the beam is.'};
  },
};
