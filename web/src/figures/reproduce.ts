// reproduce: each claim of the paper beside ours, and its figures with ours over them.
import {Chart} from '../core/chart';
import type {Table} from '../core/document';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {num} from '../core/format';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent} from '../core/stats';
import {lookOf} from '../page/states';

export const reproduceTable: Figure = {
  id: 'experiments', title: 'Does it come out as printed?', note: 'printed beside ours', span: 24,
  draw(host, doc) {
    const table = doc.table('experiments');
    if (!table) return null;
    const n = (name: string, i: number) => el('td', {class: 'value'}, num(table.number(name, i), 4)), body = el('tbody');
    let held = 0;
    for (let i = 0; i < table.rows; ++i) {
      const look = lookOf(table.text('state', i));
      held += Number(look.name === 'good');
      body.append(el('tr', {}, el('th', {}, el('span', {class: `state-${look.name}`, role: 'img', 'aria-label': look.word}, look.symbol), ' ', el('b', {}, table.text('id', i))), el('td', {class: 'word', style: 'text-align:left'}, table.text('quantity', i)), n('printed', i), n('ours', i), n('best', i), n('ratio', i), n('bound', i), el('td', {class: 'unit'}, table.text('unit', i)),
        table.has('words') ? el('td', {class: 'word', style: 'text-align:left'}, table.text('words', i)) : null));
    }
    host.append(el('div', {class: 'scroll', style: 'max-height:none'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...['', '', 'printed', 'ours', 'best', 'ratio', 'bound', 'unit', ...(table.has('words') ? ['deviation'] : [])].map((word) => el('th', {}, word)))), body)));
    return {marks: table.rows, rows: table.rows, tables: [table], words: `${held} of ${table.rows} hold`, good: `${held} of ${table.rows} come out as printed. Best: our best method on the same data; ratio: ours over printed.`};
  },
};

/** What was simulated and run for each experiment, and what the paper does not say. */
export const reproduceMethods: Figure = {
  id: 'methods', title: 'What was run, and what was chosen?', note: 'one row an experiment', span: 24,
  draw(host, doc) {
    const table = doc.table('methods');
    if (!table) return null;
    const words = (name: string, i: number) => el('td', {class: 'word', style: 'text-align:left'}, table.text(name, i) || '–'), body = el('tbody');
    for (let i = 0; i < table.rows; ++i) body.append(el('tr', {}, el('th', {}, table.text('title', i)), words('method', i), words('chosen', i)));
    host.append(el('div', {class: 'scroll', style: 'max-height:none'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...['experiment', 'what was simulated and run', 'chosen, where the paper is silent'].map((word) => el('th', {style: 'text-align:left'}, word)))), body)));
    return {marks: table.rows, rows: table.rows, tables: [table], words: `${table.rows} experiments`, good: ''};
  },
};

/** A table fig_ID: first column across, the others up; columns whose name begins with printed_ are the paper's, as dots. */
export function reproduceFigure(table: Table): Figure {
  const id = table.name.replace(/^fig_/, '');
  return {id: `paper-${id.replace(/[^\w-]/g, '_')}`, title: `Figure ${id.replace(/_/g, ' ')}`, note: 'the paper’s figure with ours over it', span: 12,
    draw(host) {
      const names = table.names.filter((name) => table.tells(name)), across = names[0], up = names.slice(1, 9);
      if (!across || up.length === 0) return null;
      const colours = ['blue', 'orange', 'green', 'purple', 'red', 'sky', 'ink', 'soft'] as const, x = table.numbers(across), xs = extent(x)!, ys = extent(...up.map((name) => table.numbers(name)))!;
      const isLog = ys[0] > 0 && ys[1] > 100 * ys[0];
      legend(host, up.map((name, k) => ({words: name.replace(/_/g, ' '), colour: `var(--${colours[k]!})`, look: name.startsWith('printed') ? 'ring' : 'line'})));
      new Chart(host, {height: 300, isFilling: true, label: `Figure ${id}`}, (pen) => {
        const left = 56, right = pen.w - 12, bottom = pen.h - 42, margin = 0.06 * (ys[1] - ys[0]) || 1, sx = scale(xs[0], xs[1], left, right), sy = isLog ? scale(ys[0] / 1.5, ys[1] * 1.5, bottom, 22, true) : scale(ys[0] - margin, ys[1] + margin, bottom, 22);
        yAxis(pen, sy, left, right), xAxis(pen, sx, 22, bottom, {label: across.replace(/_/g, ' ')});
        up.forEach((name, k) => {
          const values = table.numbers(name), colour = pen.c[colours[k]!];
          if (!name.startsWith('printed')) pen.path(Array.from(x).flatMap((v, i) => [sx(v), sy(values[i]!)]), colour, 1.8);
          else x.forEach((v, i) => Number.isFinite(values[i]!) && pen.circle(sx(v), sy(values[i]!), 4, null, colour, 1.8));
          if (table.rows < 2000) x.forEach((v, i) => Number.isFinite(values[i]!) && pen.hit({x: sx(v), y: sy(values[i]!), r: 3, tip: () => [`${across} ${num(v, 4)}`, `${name} ${num(values[i]!, 4)}`]}));
        });
      });
      return {marks: table.rows, rows: table.rows, tables: [table], words: ''};
    }};
}
