// Is the board flat? Heights of its points as fitted, how they moved within the plane, and the transfer tests.
import {Chart, type Pen} from '../core/chart';
import {css, diverging} from '../core/colours';
import type {Doc, Table} from '../core/document';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num} from '../core/format';
import {scale} from '../core/scale';
import {largestSize, lengths, quantile, roundDown125, roundUp125, scaled} from '../core/stats';

function drawShape(pen: Pen, points: Table, limit_mm: number): void {
  const c = (name: string) => points.numbers(name), col = c('col'), row = c('row');
  const dx = scaled(c('dx_m'), 1e3), dy = scaled(c('dy_m'), 1e3), dz = scaled(c('dz_m'), 1e3), sigma = scaled(c('sigma_dz_m'), 1e3);
  const cols = largestSize(col) || 1, rows = largestSize(row) || 1, foot = 74;
  const pitch = Math.min(pen.w / (cols + 1.4), (pen.h - foot) / (rows + 1.2)), left = (pen.w - pitch * cols) / 2, top = pitch * 0.65;
  const typical = quantile(lengths(dx, dy), 0.95), factor = typical > 0 ? roundDown125((0.45 * pitch) / typical) : 0;
  for (let i = 0; i < points.rows; ++i) {
    const x = left + pitch * col[i]!, y = top + pitch * row[i]!;
    if (!Number.isFinite(x + y + dz[i]!)) continue;
    pen.circle(x, y, 0.36 * pitch, css(diverging(dz[i]! / limit_mm)));
    if (sigma[i]! > 0 && Math.abs(dz[i]!) > 3 * sigma[i]!) pen.circle(x, y, 0.36 * pitch + 1.5, null, pen.c.ink, 1.6);
    pen.arrow(x, y, x + factor * dx[i]!, y + factor * dy[i]!, pen.c.card, 3.5, 5);
    pen.arrow(x, y, x + factor * dx[i]!, y + factor * dy[i]!, '#14181d', 1.5, 4);
    pen.hit({x, y, r: 0.36 * pitch, tip: () => [`point ${col[i]}, ${row[i]}`, `height ${num(dz[i]!, 3)} ± ${num(3 * sigma[i]!, 2)} mm (3σ)`, `within the plane ${num(dx[i]!, 2)}, ${num(dy[i]!, 2)} mm`]});
  }
  const y = pen.h - foot + 16, x = scale(-limit_mm, limit_mm, 40, pen.w - 40);
  for (let k = 0; k < 120; ++k) pen.rect(40 + ((pen.w - 80) * k) / 120, y, (pen.w - 80) / 120 + 0.5, 9, css(diverging((2 * (k + 0.5)) / 120 - 1)));
  for (const share of [-1, -0.5, 0, 0.5, 1]) pen.text(num(share * limit_mm, 2), x(share * limit_mm), y + 18, {align: 'center', size: 11, colour: pen.c.soft});
  const bar_mm = factor > 0 ? roundDown125(50 / factor) : 0;
  if (factor > 0) pen.scaleBar(40, y + 40, bar_mm * factor, `${num(bar_mm, 2)} mm within the plane · colour: height, mm`);
  else pen.text('height off the printed plane, mm', pen.w / 2, y + 38, {align: 'center', size: 11.5, colour: pen.c.soft});
}

function transferTable(doc: Doc): HTMLElement | null {
  const rows = [['transfer_rms_px', 'shape learned on the others'], ['transfer_flat_rms_px', 'fixed flat']].filter(([path]) => Number.isFinite(doc.estimate(path!)));
  if (rows.length === 0) return null;
  return el('table', {class: 'estimate'}, el('tr', {class: 'group'}, el('th', {colspan: 3}, 'RMS on unseen photos')),
    ...rows.map(([path, words]) => el('tr', {}, el('th', {}, words!), el('td', {class: 'value'}, num(doc.estimate(path!), 3)), el('td', {class: 'unit'}, 'px'))));
}

export const board: Figure = {
  id: 'board', title: 'Is the board flat?', note: 'mm', span: 8,
  draw(host, doc) {
    const points = doc.table('board_points');
    if (!points || !points.hasValues('dz_m')) return null;
    const highest_mm = 1e3 * largestSize(points.numbers('dz_m')), isFlat = !(highest_mm > 0) && !(largestSize(points.numbers('dx_m')) > 0);
    const cols = largestSize(points.numbers('col')) || 1, rows = largestSize(points.numbers('row')) || 1;
    if (isFlat) host.append(el('p', {class: 'caption'}, 'The board was fixed flat, so its heights are not shown.'));
    else new Chart(host, {height: 220, aspect: (rows + 1.2) / (cols + 1.4) + 0.17, most: 460, label: `Heights of the board's points, at most ${num(highest_mm, 2)} mm`},
      (pen) => drawShape(pen, points, Math.max(0.1, roundUp125(highest_mm))));
    const transfer = transferTable(doc);
    if (transfer) host.append(transfer);
    const shape = doc.estimateText('board_shape');
    return {marks: points.rows, rows: points.rows, tables: [points], words: `highest ${num(highest_mm, 2)} mm`,
      good: (isFlat ? 'Much smaller with a learned shape means that the board bends.' : `Ringed: further than 3σ from flat. Highest ${num(highest_mm, 2)} mm.`) + (shape ? ` Solved as: ${shape}.` : '')};
  },
};
