// Have the residuals structure? All of them in place, the mean of each cell, and their histogram.
import {Chart, type Pen} from '../core/chart';
import {cividis, css, directionColour, pixelShare} from '../core/colours';
import type {Table} from '../core/document';
import {choice, type Figure} from '../core/figure';
import {num, percent} from '../core/format';
import {directionWheel, magnificationFor, panelIn, type Panel} from '../core/panel';
import {linearTicks, scale} from '../core/scale';
import {lengths, quantile} from '../core/stats';
import {calibrateScene, type Corners} from './calibrate_scene';

const boldOver = 3; // σ

function spacing(values: Float64Array, otherwise: number): number {
  const distinct = [...new Set(values)].filter(Number.isFinite).sort((a, b) => a - b);
  let smallest = otherwise;
  for (let i = 1; i < distinct.length; ++i)
    if (distinct[i]! - distinct[i - 1]! > 1e-3 * otherwise) smallest = Math.min(smallest, distinct[i]! - distinct[i - 1]!);
  return smallest;
}

function drawCells(pen: Pen, panel: Panel, cells: Table, size: {width: number; height: number}): string {
  const c = (name: string) => cells.numbers(name);
  const [u, v, count, mu, mv, z] = [c('u_px'), c('v_px'), c('count'), c('mean_u_px'), c('mean_v_px'), c('z')];
  const w = spacing(u, size.width) * panel.perPixel, h = spacing(v, size.height) * panel.perPixel;
  const {factor, bar_px, barLength} = magnificationFor(panel, quantile(lengths(mu, mv), 0.9), 0.5 * Math.min(w, h));
  for (let i = 0; i < cells.rows; ++i) {
    const [x, y] = panel.at(u[i]!, v[i]!);
    pen.rect(x - w / 2, y - h / 2, w, h, null, pen.c.grid);
    if (!(count[i]! > 0)) {
      if (w > 34) pen.text('none', x, y, {align: 'center', size: 11, colour: pen.c.soft});
    } else {
      const isBold = z[i]! > boldOver, k = factor * panel.perPixel, far = Math.min(1, (0.9 * Math.min(w, h)) / (k * Math.hypot(mu[i]!, mv[i]!)));
      const tip: [number, number] = [x + k * far * mu[i]!, y + k * far * mv[i]!];
      pen.arrow(x, y, ...tip, pen.c.card, isBold ? 7 : 4, 7);
      pen.arrow(x, y, ...tip, isBold ? pen.c.red : pen.c.ink, isBold ? 3.4 : 1.6, 7);
    }
    pen.hit({x, y, w, h, tip: () => count[i]! > 0
      ? [`cell at ${num(u[i]!, 4)}, ${num(v[i]!, 4)} px: ${count[i]} corners`, `mean ${num(mu[i]!, 2)}, ${num(mv[i]!, 2)} px`, `${num(z[i]!, 2)}σ from zero`]
      : ['no corners here']});
  }
  pen.scaleBar(4, panel.y + panel.h + 14, barLength, `${num(bar_px, 2)} px, cell means ×${num(factor, 3)}; bold: over ${boldOver}σ`);
  return '';
}

function drawDots(pen: Pen, panel: Panel, corners: Corners, isBySize: boolean): number {
  const groups: number[][] = [], classes = 32;
  let drawn = 0;
  const size = corners.count > 5000 ? 1.6 : 3;
  for (let i = 0; i < corners.count; ++i) {
    if (!corners.isUsed[i]) continue;
    const [x, y] = panel.at(corners.u[i]!, corners.v[i]!), du = corners.du[i]!, dv = corners.dv[i]!;
    // A few colours instead of one a dot: setting a colour costs more than a dot.
    const share = isBySize ? pixelShare(Math.hypot(du, dv)) : Math.atan2(dv, du) / (2 * Math.PI) + 0.5;
    const group = Math.min(classes - 1, Math.max(0, Math.floor(share * classes)));
    (groups[group] ??= []).push(x, y);
    ++drawn;
  }
  groups.forEach((places, group) => {
    const share = (group + 0.5) / classes, turn = 2 * Math.PI * (share - 0.5);
    pen.g.fillStyle = css(isBySize ? cividis(share) : directionColour(Math.cos(turn), Math.sin(turn)));
    for (let i = 0; i < places.length; i += 2) pen.g.fillRect(places[i]! - size / 2, places[i + 1]! - size / 2, size, size);
  });
  return drawn;
}

/** Densities per px: of the residuals, and normal curves of what the corners' own σ predict. */
function drawHistogram(pen: Pen, corners: Corners, noise_px: number): void {
  const values: number[] = [], sigmas: number[] = [];
  for (let i = 0; i < corners.count; ++i) {
    if (!corners.isUsed[i]) continue;
    values.push(corners.du[i]!, corners.dv[i]!);
    sigmas.push(corners.su[i]!, corners.sv[i]!);
  }
  const reach = 1.15 * Math.max(quantile(values.map(Math.abs), 0.995), 1e-6), bins = 41, counts = new Array<number>(bins).fill(0);
  for (const value of values) {
    const bin = Math.floor(((value + reach) / (2 * reach)) * bins);
    if (bin >= 0 && bin < bins) ++counts[bin]!;
  }
  const left = 12, right = pen.w - 96, bottom = pen.h - 36, width = (2 * reach) / bins;
  const density = counts.map((count) => count / (values.length * width)), top = Math.max(...density);
  const x = scale(-reach, reach, left, right), y = scale(0, 1.18 * top, bottom, 18);
  pen.text('residuals u and v', left, 8, {size: 11.5, weight: 600});
  density.forEach((value, i) => {
    const from = -reach + i * width;
    pen.rect(x(from), y(value), x(from + width) - x(from) - 1, bottom - y(value), pen.c.blue);
    pen.hit({x: x(from + width / 2), y: (bottom + 18) / 2, w: x(width) - x(0), h: bottom - 18, tip: () => [`${num(from, 2)} … ${num(from + width, 2)} px`, `${counts[i]} of ${values.length}`]});
  });
  const finiteSigmas = sigmas.filter((s) => s > 0);
  const stride = Math.max(1, Math.floor(finiteSigmas.length / 400)), sample = finiteSigmas.filter((_, i) => i % stride === 0);
  const curve = (extra: number) => Array.from({length: 161}, (_, i) => {
    const at = -reach + (i / 160) * 2 * reach;
    const p = sample.reduce((sum, s0) => { const s = Math.hypot(s0, extra); return sum + Math.exp(-0.5 * (at / s) ** 2) / (s * Math.sqrt(2 * Math.PI)); }, 0) / sample.length;
    return [x(at), Math.max(16, y(p))];
  }).flat();
  if (sample.length > 0) {
    pen.path(curve(0), pen.c.soft, 1.4, [2, 3]);
    if (noise_px > 0) pen.path(Array.from({length: 161}, (_, i) => {
      const at = -reach + (i / 160) * 2 * reach;
      return [x(at), y(Math.exp(-0.5 * (at / noise_px) ** 2) / (noise_px * Math.sqrt(2 * Math.PI)))];
    }).flat(), pen.c.ink, 1.8);
  }
  pen.line(left, bottom, right, bottom, pen.c.soft);
  for (const tick of linearTicks(-reach, reach, 5)) pen.text(num(tick, 2), x(tick), bottom + 10, {align: 'center', size: 11, colour: pen.c.soft});
  pen.text('residual, px', (left + right) / 2, bottom + 26, {align: 'center', size: 11.5, colour: pen.c.soft});
  directionWheel(pen, pen.w - 44, 18 + (bottom - 18) / 2, 24);
  pen.text('direction', pen.w - 44, bottom + 4, {align: 'center', size: 10.5, colour: pen.c.soft});
}

export const residuals: Figure = {
  id: 'residuals', title: 'Have the residuals structure?', note: 'predicted − found, px', span: 9,
  draw(host, doc, selection) {
    const {size, corners} = calibrateScene(doc, selection), cells = doc.table('cells');
    if (!size || !corners || !corners.isUsed.includes(1)) return null;
    let isBySize = false, marks = 0;
    choice(host, 'colour', ['coloured by direction', 'by size'], (i) => ((isBySize = i === 1), map.redraw()));
    for (let i = 0; i < corners.count; ++i) marks += corners.isUsed[i]!;
    const bold = cells ? cells.numbers('z').filter((z) => z > boldOver).length : 0;
    const label = `${marks} residuals in place; ${bold} of ${cells?.rows ?? 0} cells have a mean over ${boldOver}σ from zero`;
    const map = new Chart(host, {height: 120, aspect: size.height / size.width + 0.06, most: 650, label}, (pen) => {
      const panel = panelIn(size, 0, 0, pen.w, pen.h - 26);
      pen.rect(panel.x, panel.y, panel.w, panel.h, pen.c.panel, pen.c.grid);
      drawDots(pen, panel, corners, isBySize);
      if (cells) drawCells(pen, panel, cells, size);
    });
    const noise_px = doc.estimate('noise_px');
    new Chart(host, {height: 140, isFilling: true, label: 'Histogram of the residuals beside normal curves'}, (pen) => drawHistogram(pen, corners, noise_px));
    return {marks, rows: corners.isUsed.reduce((a, b) => a + b, 0), tables: [corners.table, ...(cells ? [cells] : [])], words: label,
      good: `Good: colours mixed everywhere, no bold arrow. Here ${bold} of ${cells?.rows ?? 0} cells are bold (${percent(bold, cells?.rows ?? 0)}). Line: normal of the noise found (${num(noise_px, 3)} px); dotted: what the corners' own σ predict.`};
  },
};
