// A figure's frame: title, tools, what good looks like, the table behind it.
import type {Doc} from '../core/document';
import {button, el} from '../core/dom';
import type {Figure, View} from '../core/figure';
import type {Selection} from '../core/selection';
import {tableMarkup} from './tables';
import {saveImage} from './image_file';

export interface Card {
  figure: Figure;
  view: View;
  section: HTMLElement;
}

export function makeCard(figure: Figure, doc: Doc, selection: Selection, host: HTMLElement): Card | null {
  const body = el('div', {class: 'body'});
  const section = el('section', {class: 'card', id: `fig-${figure.id}`, style: `--span:${figure.span};--narrow:${figure.narrow ?? (figure.span <= 10 ? 9 : figure.span < 14 ? 12 : figure.span < 20 ? 15 : 24)}`, tabindex: -1});
  section.append(body);
  host.append(section); // before it draws: a canvas needs its width
  const view = figure.draw(body, doc, selection);
  if (!view) {
    section.remove();
    return null;
  }
  const card: Card = {figure, view, section};
  const title = view.title ?? figure.title, note = view.note ?? figure.note;
  section.dataset['marks'] = String(view.marks);
  section.dataset['rows'] = String(view.rows);
  section.setAttribute('aria-label', `${title} ${view.words}`);
  section.prepend(el('div', {class: 'title'}, el('h2', {}, title),
    el('span', {class: 'tools'},
      view.tables.length > 0 ? button('▤', 'The table behind this figure (t)', () => toggleTable(card)) : null,
      button('⛶', 'Full window (f)', () => toggleFull(card)),
      button('⤓', 'Save as PNG (s)', () => saveImage(card, doc))),
    note ? el('span', {class: 'note'}, note) : null));
  if (view.good) section.append(el('p', {class: 'good'}, view.good));
  return card;
}

export function toggleTable(card: Card): void {
  const there = card.section.querySelector('.behind');
  if (there) there.remove();
  else if (card.view.tables.length > 0)
    card.section.append(el('div', {class: 'behind'}, ...card.view.tables.map((table) => tableMarkup(table, 200))));
}

export function toggleFull(card: Card): void {
  const isFull = card.section.classList.toggle('full');
  document.body.style.overflow = isFull ? 'hidden' : '';
}
