// camera diff: how far apart two cameras are over the image, along its diagonal, and parameter by parameter.
import {Chart} from '../core/chart';
import type {Grid} from '../core/document';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {fixed, num, valueText} from '../core/format';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent, lengths, quantile, roundDown125, roundUp125, scaled} from '../core/stats';
import {colourKey, drawField, shareNotAbove, sizeOfGrid} from './fields';

export const difference: Figure = {
  id: 'diff', title: 'How far apart?', note: 'from A to B after the best rigid motion, px', span: 14,
  draw(host, doc) {
    const grid = doc.pixelGrid('diff'), du = grid?.values('delta_u_px'), dv = grid?.values('delta_v_px');
    if (!grid || !du || !dv) return null;
    const size = sizeOfGrid(grid), values = lengths(du, dv), row = el('div', {class: 'split'});
    const marks = values.filter(Number.isFinite).length;
    const main = el('div', {class: 'wide'}), side = el('div');
    row.append(main);
    host.append(row);
    drawField(main, {title: 'difference', grid, size, values, du, dv}, 0.05, 380);
    const sigmas = [['sigma_a_px', '3σ of A'], ['sigma_b_px', '3σ of B']].map(([name, title]) => [grid.values(name!), title!] as const);
    for (const [sigma, title] of sigmas) {
      if (!sigma) continue;
      row.append(side);
      drawField(side, {title, grid, size, values: scaled(sigma, 3)}, 0.05, 240);
    }
    colourKey(host, 'px');
    const [a, b] = [sigmas[0]![0], sigmas[1]![0]];
    const share = a && b ? shareNotAbove(values, Float64Array.from(a, (s, i) => 3 * Math.hypot(s, b[i]!))) : NaN;
    const good = `Half of the image differs by less than ${num(quantile(values, 0.5), 2)} px, 95 % of it by less than ${num(quantile(values, 0.95), 2)} px.` +
      (Number.isFinite(share) ? ` In ${(100 * share).toFixed(0)} % of it the difference is below 3σ of both together.` : '');
    return {marks, rows: marks, tables: [], words: good, good};
  },
};

/** The grid's values nearest to the diagonal from top left to bottom right. */
function alongDiagonal(grid: Grid, columns: (Float64Array | null)[]): {along: number[]; values: number[][]} {
  const steps = Math.max(grid.cols, grid.rows), along: number[] = [], values = columns.map(() => [] as number[]);
  for (let i = 0; i < steps; ++i) {
    const col = Math.round((i / (steps - 1)) * (grid.cols - 1)), row = Math.round((i / (steps - 1)) * (grid.rows - 1));
    along.push(Math.hypot(col * grid.du, row * grid.dv));
    columns.forEach((column, k) => values[k]!.push(column ? column[row * grid.cols + col]! : NaN));
  }
  return {along, values};
}

export const diagonal: Figure = {
  id: 'diagonal', title: 'Where along the diagonal?', note: 'px', span: 10,
  draw(host, doc) {
    const grid = doc.pixelGrid('diff'), du = grid?.values('delta_u_px'), dv = grid?.values('delta_v_px');
    if (!grid || !du || !dv) return null;
    const three = (name: string) => { const s = grid.values(name); return s ? scaled(s, 3) : null; };
    const {along, values} = alongDiagonal(grid, [lengths(du, dv), three('sigma_a_px'), three('sigma_b_px')]);
    const ends = extent(...values.map((v) => v.filter((x) => x > 0)));
    if (!ends) return null;
    const names = ['difference', '3σ of A', '3σ of B'], shown = [0, 1, 2].filter((k) => values[k]!.some(Number.isFinite));
    legend(host, shown.map((k) => ({words: names[k]!, colour: `var(--${['ink', 'blue', 'orange'][k]})`, look: k === 2 ? 'dash' : 'line'})));
    const low = roundDown125(Math.max(ends[0], 1e-4 * ends[1], quantile(values[0]!, 0.03)));
    new Chart(host, {height: 260, isFilling: true, label: 'Difference along the diagonal beside the 3σ of each camera'}, (pen) => {
      const left = 54, right = pen.w - 12, bottom = pen.h - 42;
      const x = scale(0, along[along.length - 1]!, left, right), y = scale(low, roundUp125(ends[1]), bottom, 24, true);
      yAxis(pen, y, left, right, {label: 'px'});
      xAxis(pen, x, 24, bottom, {label: 'along the diagonal from the top-left corner, px'});
      pen.clipped(left, 20, right - left, bottom - 20, () => {
        for (const k of shown) pen.path(along.flatMap((a, i) => [x(a), y(values[k]![i]!)]), [pen.c.ink, pen.c.blue, pen.c.orange][k]!, k === 0 ? 2.2 : 1.7, k === 2 ? [6, 4] : []);
      });
      along.forEach((a, i) => pen.hit({x: x(a), y: (24 + bottom) / 2, w: x(along[1]!) - x(0), h: bottom, tip: () => [`${num(a, 3)} px along`, ...shown.map((k) => `${names[k]} ${num(values[k]![i]!, 3)} px`)]}));
    });
    return {marks: along.length, rows: along.length, tables: [], words: '', good: 'Good: the difference stays below the 3σ of both.'};
  },
};

export const parameters: Figure = {
  id: 'parameters', title: 'Which parameters differ?', note: 'value ± 3σ; in σ where both have one', span: 14,
  draw(host, doc) {
    const table = doc.table('parameters');
    if (!table) return null;
    const body = el('tbody');
    for (let i = 0; i < table.rows; ++i) {
      const n = (name: string) => table.number(name, i), a = valueText(n('a'), n('sigma_a')), b = valueText(n('b'), n('sigma_b'));
      const inSigmas = (n('b') - n('a')) / Math.hypot(n('sigma_a'), n('sigma_b'));
      const pm = (text: string) => el('td', {}, text ? `± ${text}` : '');
      body.append(el('tr', {}, el('th', {}, table.text('name', i)), el('td', {class: 'value'}, a.value), pm(a.plusMinus), el('td', {class: 'value'}, b.value), pm(b.plusMinus),
        el('td', {class: 'value'}, num(n('b') - n('a'), 3)), el('td', {class: `value${Math.abs(inSigmas) > 3 ? ' state-care' : ''}`}, Number.isFinite(inSigmas) ? `${fixed(inSigmas, 1)} σ` : '–')));
    }
    host.append(el('div', {class: 'scroll'}, el('table', {class: 'estimate'},
      el('thead', {}, el('tr', {}, ...['', 'A', '', 'B', '', 'B − A', 'in σ'].map((word) => el('th', {}, word)))), body)));
    return {marks: table.rows, rows: table.rows, tables: [table], words: `${table.rows} parameters`, good: 'Parameters trade against each other: what counts is how far apart the pixels are.'};
  },
};
