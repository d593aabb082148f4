// reproduce: where spots are and where a method computes them; a table of a paper as a table.
import type {Table} from '../core/document';
import {el} from '../core/dom';
import {legend} from '../core/figure';
import {num} from '../core/format';
import {scatter, type ScatterDot} from './scatter';

/** Columns NAME_u_px and NAME_v_px beside actual_u_px and actual_v_px. */
export function hasSpots(table: Table): boolean {
  return table.has('actual_u_px') && table.has('actual_v_px');
}

const looks = [{colour: 'red', shape: 'square'}, {colour: 'blue', shape: 'square'}, {colour: 'green', shape: 'disc'}] as const;

/** In the image, and what is computed minus what is seen. */
export function drawSpots(host: HTMLElement, table: Table, wordsOf: (name: string) => string): void {
  const names = table.names.filter((name) => name.endsWith('_u_px') && name !== 'actual_u_px').map((name) => name.slice(0, -5)).slice(0, looks.length);
  const actual = (i: number) => [table.number('actual_u_px', i), table.number('actual_v_px', i)] as const, rows = Array.from({length: table.rows}, (_, i) => i);
  const image: ScatterDot[] = [], offsets: ScatterDot[] = [];
  rows.forEach((i) => {
    const [u, v] = actual(i), where = table.has('range_m') ? `reading ${num(table.number('range_m', i), 4)} m` : `spot ${i + 1}`;
    if (Number.isFinite(u)) image.push({x: u, y: -v, size: 3.4, shape: 'cross', colour: (pen) => pen.c.ink, tip: () => [where, `actual ${num(u, 5)}, ${num(v, 5)} px`]});
    names.forEach((name, k) => {
      const cu = table.number(`${name}_u_px`, i), cv = table.number(`${name}_v_px`, i);
      if (!Number.isFinite(cu + u)) return;
      const look = looks[k]!, tip = () => [`${wordsOf(name)}, ${where}`, `${num(cu - u, 3)}, ${num(cv - v, 3)} px from the actual one`];
      image.push({x: cu, y: -cv, size: 5, shape: look.shape, colour: (pen) => pen.c[look.colour], tip});
      offsets.push({x: cu - u, y: -(cv - v), size: 4, shape: look.shape, colour: (pen) => pen.c[look.colour], tip});
    });
  });
  legend(host, [{words: 'actual', colour: 'var(--ink)', look: 'dot'}, ...names.map((name, k) => ({words: wordsOf(name), colour: `var(--${looks[k]!.colour})`, look: looks[k]!.shape === 'square' ? ('square' as const) : ('dot' as const)}))]);
  const pair = el('div', {style: 'display:grid;grid-template-columns:repeat(auto-fit,minmax(300px,1fr));gap:8px'}), left = el('div'), right = el('div');
  pair.append(left, right);
  host.append(pair);
  scatter(left, image, {xLabel: 'u, px', yLabel: '−v, px', height: 320, label: 'actual and computed spots in the image'});
  scatter(right, offsets, {xLabel: 'computed − actual u, px', yLabel: 'actual − computed v, px', height: 320, isSquare: true, label: 'computed minus actual spots', include: [[0, 0]],
    below: (pen, x, y) => { pen.line(x(0) - 8, y(0), x(0) + 8, y(0), pen.c.ink, 1.5), pen.line(x(0), y(0) - 8, x(0), y(0) + 8, pen.c.ink, 1.5); }});
}

/** A table as a table: cases down, quantities across, what is printed beside what comes out. */
export function drawTable(host: HTMLElement, table: Table, wordsOf: (name: string) => string, unitOf: (name: string) => string): void {
  const names = table.names.filter((name) => name !== 'label' && table.hasValues(name)), rows = Array.from({length: table.rows}, (_, i) => i);
  const value = (name: string, i: number) => el('td', {class: 'value'}, Number.isFinite(table.number(name, i)) ? num(table.number(name, i), 4) : '–');
  const heads = names.map((name) => el('th', {}, wordsOf(name), unitOf(name) ? `, ${unitOf(name)}` : ''));
  host.append(el('div', {class: 'scroll', style: 'max-height:none'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, el('th'), ...heads)),
    el('tbody', {}, ...rows.map((i) => el('tr', {}, el('th', {}, table.has('label') ? table.text('label', i) : String(i + 1)), ...names.map((name) => value(name, i))))))));
}
