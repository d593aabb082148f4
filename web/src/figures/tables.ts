// Tables of a document as tables of the page: of a study and of a lot.
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num} from '../core/format';

/** Most rows that a page shows; the files beside it have all. */
const maxRows = 400;

export interface TableColumn {
  name: string;
  words: string;
  digits?: number;
}

/** The columns that say something, a row each; null where the document has no such table. */
export function tableFigure(id: string, tableName: string, title: string, note: string, columns: TableColumn[]): Figure {
  return {
    id, title, note, span: 24,
    draw(host, doc) {
      const table = doc.table(tableName);
      if (!table || table.rows === 0) return null;
      const isText = (name: string) => !Number.isFinite(table.number(name, 0)) && table.text(name, 0) !== '';
      const shown = columns.filter(({name}) => table.has(name) && (table.hasValues(name) || isText(name))), rows = Math.min(table.rows, maxRows), body = el('tbody');
      for (let i = 0; i < rows; ++i)
        body.append(el('tr', {}, ...shown.map(({name, digits}) => {
          const value = table.number(name, i);
          return Number.isFinite(value) ? el('td', {class: 'value'}, num(value, digits ?? 4)) : el('td', {class: 'word', style: 'text-align:left'}, table.text(name, i));
        })));
      host.append(el('div', {class: 'scroll', style: 'max-height:36em'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...shown.map(({words}) => el('th', {}, words)))), body)));
      return {marks: rows, rows: table.rows, tables: [table], words: `${rows} of ${table.rows} rows`, good: ''};
    },
  };
}

export const studyQuantities = tableFigure('quantities', 'quantities', 'Is the error at its bound, and does σ cover it?', 'inside 1, 2, 3σ: 0.683, 0.954, 0.997 expected', [
  {name: 'varied', words: 'varied'}, {name: 'quantity', words: ''}, {name: 'unit', words: 'unit'}, {name: 'bias', words: 'bias', digits: 3}, {name: 'rms', words: 'RMS error'}, {name: 'rms_sigma', words: 'RMS of the stated σ'}, {name: 'rms_over_bound', words: 'over the bound'}, {name: 'median', words: 'median error'}, {name: 'p90', words: '90 % below'},
  {name: 'inside_1_sigma', words: 'inside 1σ'}, {name: 'inside_2_sigma', words: '2σ'}, {name: 'inside_3_sigma', words: '3σ'}]);
export const studyWorst = tableFigure('worst', 'worst', 'Which trials are furthest off?', '--trial N runs one again', [
  {name: 'varied', words: 'varied'}, {name: 'trial', words: 'trial', digits: 12}, {name: 'quantity', words: ''}, {name: 'error', words: 'error'}, {name: 'sigma', words: 'stated σ'}]);
export const batchOutliers = tableFigure('outliers', 'outliers', 'Which values are these?', 'beyond 4 of the lot’s scatter and its own σ', [
  {name: 'camera', words: 'camera'}, {name: 'quantity', words: ''}, {name: 'value', words: 'value', digits: 6}, {name: 'sigma', words: 'σ', digits: 3}, {name: 'median_of_lot', words: 'median of the lot', digits: 6}, {name: 'z', words: 'z', digits: 3}]);
export const batchLot = tableFigure('lot', 'lot', 'How alike are they?', 'scatter: 1.4826 × the median distance from the median', [
  {name: 'quantity', words: ''}, {name: 'rows', words: 'rows'}, {name: 'median', words: 'median', digits: 6}, {name: 'scatter', words: 'scatter of the lot', digits: 3}, {name: 'sigma', words: 'median of the stated σ', digits: 3}]);
export const batchRows = tableFigure('rows', 'rows', 'What became of each row?', 'batch.csv has all of them, with their values', [
  {name: 'camera', words: 'camera'}, {name: 'verdict', words: 'verdict'}, {name: 'exit_code', words: 'exit code'}, {name: 'seconds', words: 's', digits: 3}, {name: 'sentence', words: ''}, {name: 'folder', words: 'folder'}]);
