// What was checked? Each check's value beside its limit, in words.
import type {Doc} from '../core/document';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num} from '../core/format';
import {lookOf} from '../page/states';

export function checksTable(doc: Doc): HTMLElement {
  return el('div', {class: 'scroll'}, el('table', {class: 'estimate'},
    el('thead', {}, el('tr', {}, el('th'), el('th'), el('th', {}, 'value'), el('th', {}, 'limit'), el('th'))),
    el('tbody', {}, ...doc.checks.map((check) => {
      // Both zero: what cannot be determined at all has neither.
      const look = lookOf(check.state), hasValue = check.value !== 0 || check.limit !== 0;
      return el('tr', {}, el('th', {}, el('span', {class: `state-${look.name}`, role: 'img', 'aria-label': look.word}, look.symbol), ` ${check.name}`), el('td', {class: 'word', style: 'text-align:left'}, check.text),
        el('td', {class: 'value'}, hasValue ? num(check.value, 3) : '–'), el('td', {class: 'right'}, hasValue ? num(check.limit, 3) : '–'), el('td', {class: 'unit'}, hasValue ? check.unit : ''));
    }))));
}

export const checks: Figure = {
  id: 'checks', isOptional: true, title: 'What was checked?', note: 'value beside the limit where the state changes', span: 12,
  draw(host, doc) {
    if (!doc.isAnswer || doc.checks.length === 0) return null;
    host.append(checksTable(doc));
    const calm = doc.checks.filter((check) => check.state === 'good').length;
    return {marks: doc.checks.length, rows: doc.checks.length, tables: [], words: `${calm} of ${doc.checks.length} are good`};
  },
};
