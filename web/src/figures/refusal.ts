// What cannot be determined? Each check's value beside its limit, and what to add: a refusal is also a page.
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {checksTable} from './checks';

export const refusal: Figure = {
  id: 'refusal', title: 'What cannot be determined?', note: 'value beside its limit', span: 24,
  draw(host, doc) {
    if (doc.isAnswer || !doc.isReadable || (!doc.sentence && doc.checks.length === 0)) return null;
    host.append(el('p', {}, el('b', {}, doc.sentence)));
    if (doc.checks.length > 0) host.append(checksTable(doc));
    return {marks: Math.max(1, doc.checks.length), rows: Math.max(1, doc.checks.length), tables: [], words: doc.sentence, good: doc.toAdd ? `What to add: ${doc.toAdd}.` : undefined};
  },
};
