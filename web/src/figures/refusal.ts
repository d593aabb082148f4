// What cannot be told? Each check's value beside its limit, and what to add: a refusal is also a page.
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num} from '../core/format';
import {lookOf} from '../page/states';

export const refusal: Figure = {
  id: 'refusal', title: 'What cannot be told?', note: 'value beside its limit', span: 24,
  draw(host, doc) {
    if (doc.isAnswer || !doc.isReadable || (!doc.sentence && doc.checks.length === 0)) return null;
    host.append(el('p', {}, el('b', {}, doc.sentence)));
    if (doc.checks.length > 0)
      host.append(el('div', {class: 'scroll'}, el('table', {class: 'estimate'},
        el('thead', {}, el('tr', {}, el('th'), el('th'), el('th', {}, 'value'), el('th', {}, 'limit'), el('th'))),
        el('tbody', {}, ...doc.checks.map((check) => {
          // Both zero: what cannot be told at all has neither.
          const look = lookOf(check.state), hasValue = check.value !== 0 || check.limit !== 0;
          return el('tr', {}, el('th', {}, el('span', {class: `state-${look.name}`}, `${look.symbol} `), check.name), el('td', {class: 'word', style: 'text-align:left'}, check.text),
            el('td', {class: 'value'}, hasValue ? num(check.value, 3) : '–'), el('td', {class: 'right'}, hasValue ? num(check.limit, 3) : '–'), el('td', {class: 'unit'}, hasValue ? check.unit : ''));
        })))));
    return {marks: Math.max(1, doc.checks.length), rows: Math.max(1, doc.checks.length), tables: [], words: doc.sentence, good: doc.toAdd ? `What to add: ${doc.toAdd}.` : undefined};
  },
};
