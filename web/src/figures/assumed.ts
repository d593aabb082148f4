// What was taken as given, and what would it do? Each thing with its σ, and the result that it would move most.
import type {Assumed, Doc} from '../core/document';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num, units} from '../core/format';


/** The name without its unit, and the unit; some stand with a place behind them: "origin_m z". */
function plain(name: string): {words: string; unit: string; factor: number} {
  const [head, ...rest] = name.split(' ');
  for (const [ending, unit, factor] of units)
    if (head!.endsWith(ending)) return {words: [head!.slice(0, -ending.length).replace(/[._]/g, ' '), ...rest].join(' '), unit, factor};
  return {words: name.replace(/_|\.(?!\d)/g, ' '), unit: '', factor: 1};
}

function sigmaText(one: Assumed, unit: string, factor: number): string {
  if (one.sigma === 0) return 'exact';
  if (one.sigma > 0) return `${num(factor * one.sigma, 2)}${unit ? ` ${unit}` : ''}`;
  return one.ordinary > 0 ? `not given (supposed: ${num(factor * one.ordinary, 2)}${unit ? ` ${unit}` : ''})` : 'not given';
}

function rowOf(one: Assumed): HTMLElement {
  const {words, unit, factor} = plain(one.name), moved = plain(one.moved);
  const isGrave = !(one.sigma >= 0) && one.moves > 1, right = {class: 'right'};
  const by = Number.isFinite(one.movedBy) && one.movedBy !== 0 ? ` by ${num(moved.factor * Math.abs(one.movedBy), 2)}${moved.unit ? ` ${moved.unit}` : ''}` : '';
  return el('tr', {}, el('th', {}, words), el('td', {class: 'value'}, Number.isFinite(one.value) ? `${num(factor * one.value, 5)}${unit ? ` ${unit}` : ''}` : ''),
    el('td', right, sigmaText(one, unit, factor)),
    el('td', {class: `value${isGrave ? ' state-care' : ''}`}, one.sigma === 0 || !Number.isFinite(one.moves) ? '–' : `${isGrave ? '◆ ' : ''}${num(one.moves, 2)} σ`),
    el('td', {class: 'word'}, one.sigma === 0 && Number.isFinite(one.moves) ? '' : moved.words + by));
}

function conclusion(doc: Doc): string {
  const open = doc.assumed.filter((one) => !(one.sigma >= 0)), grave = open.filter((one) => one.moves > 1);
  if (open.length === 0) return 'All of it has its σ, which the answer’s σ counts.';
  if (grave.length === 0) return 'What has no σ would, off by the error supposed, move the answer by less than its own σ.';
  return `${grave.length === 1 ? 'One thing' : `${grave.length} things`} without a σ would, off by the error supposed, move the answer by more than its own σ: the answer is only as good as ${grave.length === 1 ? 'it' : 'they'}.`;
}

export const assumed: Figure = {
  id: 'assumed', isOptional: true, title: 'What was taken as given, and what would it do?', note: 'if off by its σ, or by an ordinary error', span: 12,
  draw(host, doc) {
    if (doc.assumed.length === 0) return null;
    const body = el('tbody');
    doc.assumed.forEach((one) => body.append(rowOf(one)));
    host.append(el('div', {class: 'scroll'}, el('table', {class: 'estimate'},
      el('thead', {}, el('tr', {}, ...['taken as given', 'value', 'σ', 'moves the answer', 'most'].map((word) => el('th', {}, word)))), body)));
    const words = conclusion(doc);
    return {marks: doc.assumed.length, rows: doc.assumed.length, tables: [], words, good: words};
  },
};
