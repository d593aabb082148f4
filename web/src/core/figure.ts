// What a figure is: one file each, `draw` puts it into its card.
import type {Doc, Table} from './document';
import {el} from './dom';
import type {Selection} from './selection';

/** What stands in the card. */
export interface View {
  marks: number; // drawn
  rows: number; // of the table that marks stand for
  tables: Table[]; // behind the figure
  words: string; // its conclusion, for who does not see it
  good?: string; // what good looks like, and what it is here
  note?: string; // beside the title: units, how to read
  title?: string; // where it depends on the data
  /** Middle of places whose value is known, in the page's coordinates: for tests. */
  chosen?: () => void;
}

export interface Figure {
  id: string; // checks link to it
  title: string; // the question that it answers
  note?: string;
  span: number; // of 24 columns
  narrow?: number; // on the first screen of a narrow window
  isOptional?: boolean; // not missed where the document has nothing for it
  /** Null where the document has no table for it. */
  draw(host: HTMLElement, document: Doc, selection: Selection): View | null;
}

export interface Key {
  words: string;
  colour: string; // a CSS colour, or var(--…)
  look?: 'line' | 'dash' | 'dot' | 'square' | 'band' | 'ring' | 'cross';
}

/** Marks and what they mean, above a figure. */
export function legend(host: HTMLElement, keys: Key[]): void {
  host.append(el('ul', {class: 'legend'}, ...keys.map((key) =>
    el('li', {}, el('i', {class: `key ${key.look ?? 'line'}`, style: `--key:${key.colour}`}), key.words))));
}

/** A choice of one of a few words, above a figure. */
export function choice(host: HTMLElement, label: string, words: string[], choose: (index: number) => void): void {
  const row = el('div', {class: 'choice', role: 'group', 'aria-label': label});
  words.forEach((word, index) => {
    const made = el('button', {type: 'button', 'aria-pressed': index === 0 ? 'true' : 'false'}, word);
    made.addEventListener('click', () => {
      for (const other of row.children) other.setAttribute('aria-pressed', String(other === made));
      choose(index);
    });
    row.append(made);
  });
  host.append(row);
}
