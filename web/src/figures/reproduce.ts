// reproduce: each claim of the paper beside its method as we re-run it and our own, and the figures drawn again.
import {Chart, type Pen} from '../core/chart';
import type {Doc, Table} from '../core/document';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {num} from '../core/format';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent, finite} from '../core/stats';
import {lookOf} from '../page/states';
import {drawSpots, drawTable, hasSpots} from './reproduce_spots';

interface Column {
  name: string;
  words: string;
}

/** Of the numbers only those that the run has: "as printed" where something is printed. */
function columnsOf(table: Table): Column[] {
  const all: Column[] = [{name: 'printed', words: 'as printed'}, {name: 'ours', words: 'paper’s method, re-run'}, {name: 'best', words: 'ours'}, {name: 'ratio', words: 're-run / printed'}, {name: 'bound', words: 'bound'}];
  return all.filter(({name}) => table.hasValues(name));
}

const wordOf: Record<string, string> = {good: 'reproduced', care: 'in shape', bad: 'not reproducible'};

function claimRow(table: Table, i: number, columns: Column[]): HTMLElement {
  const look = lookOf(table.text('state', i)), value = (name: string) => table.number(name, i);
  return el('tr', {}, el('th', {style: 'min-width:13em;white-space:normal'}, el('span', {class: `state-${look.name}`, role: 'img', 'aria-label': wordOf[look.name] ?? look.word}, look.symbol), ' ', el('b', {}, table.text('id', i)), el('br'), table.text('quantity', i)), ...columns.map(({name}) => el('td', {class: 'value'}, Number.isFinite(value(name)) ? num(value(name), 4) : '')), el('td', {class: 'unit'}, table.text('unit', i)),
    table.has('words') ? el('td', {class: 'word', style: 'text-align:left'}, table.text('words', i)) : null);
}

export const reproduceTable: Figure = {
  id: 'experiments', title: 'Does it come out as the paper says?', note: 'empty: there is no such number', span: 24,
  draw(host, doc) {
    const table = doc.table('experiments');
    if (!table) return null;
    const columns = columnsOf(table), rows = Array.from({length: table.rows}, (_, i) => i), held = rows.filter((i) => table.text('state', i) === 'good').length;
    const heads = ['', ...columns.map(({words}) => words), 'unit', ...(table.has('words') ? ['what is behind it'] : [])];
    host.append(el('div', {class: 'scroll', style: 'max-height:none'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...heads.map((word) => el('th', {}, word)))), el('tbody', {}, ...rows.map((i) => claimRow(table, i, columns))))));
    return {marks: table.rows, rows: table.rows, tables: [table], words: `${held} of ${table.rows} hold`,
      good: `● reproduced ◆ in shape ▲ not reproducible; ${held} of ${table.rows} are reproduced. Ours: our default method on the same data.`};
  },
};

/** The claims in short: how many hold, and those with numbers side by side. */
export const reproduceShort: Figure = {
  id: 'estimate', title: 'Does it come out?', note: 'paper’s method, re-run, and ours', span: 10,
  draw(host, doc) {
    const table = doc.table('experiments');
    if (!table) return null;
    const columns = columnsOf(table).filter(({name}) => name === 'printed' || name === 'ours' || name === 'best'), rows = Array.from({length: table.rows}, (_, i) => i);
    const cell = (i: number, name: string) => el('td', {class: 'value'}, Number.isFinite(table.number(name, i)) ? num(table.number(name, i), 3) : '');
    host.append(el('div', {class: 'scroll'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, el('th'), ...columns.map(({words}) => el('th', {}, words)), el('th'))), el('tbody', {}, ...rows.map((i) => {
      const look = lookOf(table.text('state', i));
      return el('tr', {}, el('th', {title: table.text('quantity', i)}, el('span', {class: `state-${look.name}`, role: 'img', 'aria-label': wordOf[look.name] ?? look.word}, look.symbol), ` ${table.text('id', i)}`), ...columns.map(({name}) => cell(i, name)), el('td', {class: 'unit'}, table.text('unit', i)));
    })))));
    return {marks: table.rows, rows: table.rows, tables: [table], words: `${table.rows} claims`, good: '● reproduced ◆ in shape ▲ not reproducible. In words below.'};
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

interface Line {
  name: string;
  words: string;
  kind: 'printed' | 'ours' | 'best' | 'other';
}
const unitsOf: [string, string][] = [['_percent', '%'], ['_deg', '°'], ['_mrad', 'mrad'], ['_rad', 'rad'], ['_ms', 'ms'], ['_px', 'px'], ['_mm2', 'mm²'], ['_mm', 'mm'], ['_cm', 'cm'], ['_s', 's'], ['_m', 'm']];

function unitOf(name: string): string {
  return unitsOf.find(([ending]) => name.endsWith(ending))?.[1] ?? '';
}
function lineOf(name: string): Line {
  const ending = unitsOf.find(([one]) => name.endsWith(one))?.[0] ?? '', plain = name.slice(0, name.length - ending.length), [first, ...rest] = plain.split('_'), what = rest.join(' ');
  const named = (words: string) => (what ? `${what}, ${words}` : words);
  if (first === 'printed') return {name, kind: 'printed', words: named('as printed')};
  if (first === 'ours') return {name, kind: 'ours', words: named('paper’s method, re-run')};
  if (first === 'best') return {name, kind: 'best', words: named('ours')};
  return {name, kind: 'other', words: plain.replace(/_/g, ' ')};
}

const colours = ['blue', 'orange', 'green', 'purple', 'red', 'sky', 'ink', 'soft'] as const;
const dashes: Record<Line['kind'], number[]> = {printed: [], ours: [], best: [7, 3], other: []};

/** Columns whose rows have no order: no line joins them. */
const isCases = (across: string) => /^(scenario|board|algorithm)$/.test(across);

/** What the document says of a figure. */
interface Words {
  title: string;
  caption: string;
  across: string;
  up: string;
}
function wordsFor(doc: Doc, id: string): Words {
  const said = doc.table('figures'), row = said ? Array.from({length: said.rows}, (_, i) => i).find((i) => said.text('id', i) === id) : undefined, text = (name: string) => (said && row !== undefined ? said.text(name, row) : '');
  return {title: text('title'), caption: text('caption'), across: text('across'), up: text('up')};
}
const withUnit = (words: string, unit: string) => (unit ? `${words}, ${unit}` : words);

/** The name of the axis that goes across, with its unit. */
function acrossOf(name: string, said: string): string {
  if (name === 't_s') return 'time, s';
  const unit = unitOf(name), plain = (unit ? name.slice(0, name.lastIndexOf('_')) : name).replace(/^num_/, 'number of ').replace(/_/g, ' ');
  return withUnit(said || plain, unit);
}

/** A histogram: shares over the middles of its bins. */
const isHistogram = (across: string) => across === 'error_px';
function outline(pen: Pen, x: number[], values: number[], sx: (v: number) => number, sy: (v: number) => number, colour: string, dash: number[]): void {
  const half = x.length > 1 ? (x[1]! - x[0]!) / 2 : 0.5;
  pen.path(x.flatMap((v, i) => [sx(v - half), sy(values[i]!), sx(v + half), sy(values[i]!)]), colour, 1.8, dash);
}

/** Lines of one unit over the first column; what the paper prints as rings, cases that have no order as dots. */
function drawPanel(pen: Pen, table: Table, across: string, lines: Line[], unit: string, isLast: boolean, said: Words): void {
  const x = table.numbers(across), xs = extent(x)!, ys = extent(...lines.map(({name}) => table.numbers(name)))!, hasCases = isCases(across);
  const isLog = !isHistogram(across) && ys[0] > 0 && ys[1] > 100 * ys[0], margin = 0.06 * (ys[1] - ys[0]) || Math.abs(ys[1]) * 0.1 || 1, pad = hasCases ? 0.4 : 0;
  const left = 60, right = pen.w - 12, bottom = pen.h - (isLast ? 42 : 22), sx = scale(xs[0] - pad, xs[1] + pad, left, right), sy = isLog ? scale(ys[0] / 1.5, ys[1] * 1.5, bottom, 24, true) : scale(ys[0] - margin, ys[1] + margin, bottom, 24);
  yAxis(pen, sy, left, right, {label: withUnit(said.up, unit).replace(/^, /, '')});
  xAxis(pen, sx, 24, bottom, {label: isLast ? acrossOf(across, said.across) : undefined, format: hasCases ? (v) => (!Number.isInteger(v) ? '' : table.has('label') ? (table.text('label', v - 1).split(':')[0] ?? '') : String(v)) : undefined});
  lines.forEach(({name, words, kind}, k) => {
    const values = table.numbers(name), colour = pen.c[colours[k % colours.length]!], shift = hasCases ? (k - (lines.length - 1) / 2) * 5 : 0;
    if (isHistogram(across)) outline(pen, Array.from(x), Array.from(values), sx, sy, colour, k > 0 ? [6, 3] : []);
    else if (kind !== 'printed' && !hasCases) pen.path(Array.from(x).flatMap((v, i) => [sx(v), sy(values[i]!)]), colour, 1.8, dashes[kind]);
    else x.forEach((v, i) => Number.isFinite(values[i]!) && pen.circle(sx(v) + shift, sy(values[i]!), 4, kind === 'printed' ? null : colour, colour, 1.8));
    if (table.rows < 2000) x.forEach((v, i) => Number.isFinite(values[i]!) && pen.hit({x: sx(v) + shift, y: sy(values[i]!), r: 3, tip: () => [`${across.replace(/_/g, ' ')} ${num(v, 4)}`, `${words} ${num(values[i]!, 4)} ${unit}`]}));
  });
}

function titleOf(id: string, said: string): string {
  const [first, second] = id.split('_');
  if (said) return /^\d/.test(id) ? `Figure ${first}: ${said.replace(/^[A-Z](?=[a-z])/, (one) => one.toLowerCase())}` : said;
  if (/^\d/.test(id)) return `Figure ${first}${second ? `, ${id.slice(first!.length + 1).replace(/_/g, ' ')}` : ''}: what comes out?`;
  return first === 'table' ? `Table ${second}: what comes out?` : `${id.replace(/_/g, ' ').replace(/^./, (one) => one.toUpperCase())}: what comes out?`;
}

/** A table fig_ID: first column across, the others up, one panel for each unit. */
export function reproduceFigure(table: Table, doc: Doc): Figure {
  const id = table.name.replace(/^fig_/, ''), said = wordsFor(doc, id), title = titleOf(id, said.title), plainOf = (name: string) => lineOf(name).words;
  const isTable = id.startsWith('table') && table.has('label'), isWide = isTable || hasSpots(table);
  return {id: `paper-${id.replace(/[^\w-]/g, '_')}`, title, span: isWide ? 24 : 12,
    draw(host) {
      if (isTable || hasSpots(table)) {
        if (isTable) drawTable(host, table, plainOf, unitOf);
        else drawSpots(host, table, (name) => lineOf(`${name}_px`).words);
        return {marks: table.rows, rows: table.rows, tables: [table], words: said.title, good: said.caption};
      }
      const names = table.names.filter((name) => name !== 'label' && table.hasValues(name)), across = names[0], lines = names.slice(1).map(lineOf);
      if (!across || lines.length === 0 || finite(table.numbers(across)).length === 0) return null;
      const byUnit = new Map<string, Line[]>();
      for (const line of lines) byUnit.set(unitOf(line.name), [...(byUnit.get(unitOf(line.name)) ?? []), line]);
      const panels = [...byUnit];
      panels.forEach(([unit, of], place) => {
        const isLast = place === panels.length - 1;
        legend(host, of.map(({words, kind}, k) => ({words, colour: `var(--${colours[k % colours.length]!})`, look: kind === 'printed' ? 'ring' : isCases(across) ? 'dot' : kind === 'best' || (isHistogram(across) && k > 0) ? 'dash' : 'line'})));
        new Chart(host, {height: panels.length > 1 ? 190 : 300, isFilling: true, label: `${title}: ${of.map(({words}) => words).join(', ')}${unit ? `, ${unit}` : ''}`}, (pen) => drawPanel(pen, table, across, of, unit, isLast, said));
      });
      const has = (kind: Line['kind']) => lines.some((line) => line.kind === kind), printed = has('printed') ? ' Rings: as printed.' : '';
      if (said.caption) return {marks: table.rows, rows: table.rows, tables: [table], words: '', good: `${said.caption}${printed}`};
      return {marks: table.rows, rows: table.rows, tables: [table], words: '', good: `By the paper’s method as we re-run it${has('ours') ? (isCases(across) ? ', and by ours' : '; dashed: by ours') : ''}.${printed}`};
    }};
}
