// Rows of cards as wide as the page: where a figure was omitted, the others of its row take its place.
import type {Card} from './card';

const columns = 24;

export function fillRows(cards: Card[]): void {
  let row: Card[] = [], used = 0;
  const close = () => {
    const spare = columns - used, upTo = (count: number) => Math.round((spare * count) / row.length);
    if (spare > 0) row.forEach((card, i) => card.section.style.setProperty('--span', String(card.figure.span + upTo(i + 1) - upTo(i))));
    row = [], used = 0;
  };
  for (const card of cards) {
    if (used + card.figure.span > columns) close();
    row.push(card), used += card.figure.span;
  }
  close();
}
