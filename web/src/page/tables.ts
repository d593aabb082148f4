// The numbers behind the figures: first rows on the page, all of them as a file.
import type {Cell, Doc, Table} from '../core/document';
import {button, download, el} from '../core/dom';
import {counted, num} from '../core/format';

function cellText(cell: Cell): string {
  if (cell === null || cell === '') return '–';
  if (typeof cell === 'boolean') return cell ? 'yes' : 'no';
  return typeof cell === 'number' ? num(cell, 6) : cell;
}

export function csvOf(table: Table): string {
  const quoted = (cell: Cell) => {
    const text = cell === null ? '' : String(cell);
    return /[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text;
  };
  const lines = [table.names.map(quoted).join(',')];
  for (let row = 0; row < table.rows; ++row) lines.push(table.names.map((name) => quoted(table.cell(name, row))).join(','));
  return lines.join('\n') + '\n';
}

export function tableMarkup(table: Table, most: number): HTMLElement {
  const shown = Math.min(most, table.rows), body = el('tbody');
  for (let row = 0; row < shown; ++row)
    body.append(el('tr', {}, ...table.names.map((name) => {
      const cell = table.cell(name, row);
      return el('td', {class: typeof cell === 'string' ? 'word' : null}, cellText(cell));
    })));
  const thinned = table.thinned ? `; thinned from ${table.thinned.from} rows: ${table.thinned.how}` : '';
  return el('div', {},
    el('p', {class: 'caption'}, button(`⤓ ${table.name}.csv`, `Download ${table.name}`, () => download(`${table.name}.csv`, 'text/csv', csvOf(table))),
      ` ${shown < table.rows ? `the first ${shown} of ` : ''}${counted(table.rows, 'row')}${thinned}`),
    el('div', {class: 'scroll'}, el('table', {class: 'data'},
      el('thead', {}, el('tr', {}, ...table.names.map((name) => el('th', {}, name)))), body)));
}

/** All tables, each filled when it is first opened. */
export function dataSection(doc: Doc): HTMLElement | null {
  const tables = [...doc.tables.values()].filter((table) => table.rows > 0);
  if (tables.length === 0) return null;
  return el('section', {class: 'card', id: 'data'},
    el('div', {class: 'title'}, el('h2', {}, 'Data behind the figures'),
      el('span', {class: 'note'}, doc.files.length > 0 ? `beside this page: ${doc.files.join(', ')}` : '')),
    ...tables.map((table) => {
      const details = el('details', {}, el('summary', {}, `${table.name} · ${counted(table.rows, 'row')}`));
      details.addEventListener('toggle', () => {
        if (details.open && details.childElementCount === 1) details.append(tableMarkup(table, 60));
      });
      return details;
    }));
}
