// The page of one run: reads the document, draws the figures of its command.
import {isCapture, showCapture} from './capture/page';
import {charts} from './core/chart';
import {readDocument, type Doc} from './core/document';
import {el} from './core/dom';
import type {Figure} from './core/figure';
import {findImages} from './core/images';
import {Selection} from './core/selection';
import {views3} from './core/view3';
import {figuresOf} from './figures/all';
import {isLive, showLive} from './live/page';
import {makeCard, type Card} from './page/card';
import {header} from './page/header';
import {listenToKeys} from './page/keys';
import {listenToPrinting} from './page/print';
import {provenance} from './page/provenance';
import {fillRows} from './page/rows';
import {dataSection} from './page/tables';

interface Drawn {
  cards: Card[];
  leftOut: string[];
  failed: string[];
}

function drawFigure(figure: Figure, doc: Doc, selection: Selection, host: HTMLElement, drawn: Drawn, isFirst: boolean): void {
  try {
    const card = makeCard(figure, doc, selection, host);
    if (card) drawn.cards.push(card), card.section.classList.toggle('first', isFirst);
    else if (!figure.isOptional) drawn.leftOut.push(figure.title);
  } catch (error) {
    // One figure must not take the page with it; what failed is said below, and in the console.
    host.querySelector(`#fig-${figure.id}`)?.remove();
    drawn.failed.push(figure.title);
    console.error(`figure ${figure.id}:`, error);
  }
}

const maxAtOnce_ms = 600; // of drawing, before the browser may show what stands and listen to its user

/** One by one, and between them the browser shows what there is: the answer is read while the rest is drawn. */
async function drawFigures(figures: Figure[], draw: (figure: Figure) => void): Promise<void> {
  let begun = performance.now();
  for (const figure of figures) {
    draw(figure);
    if (performance.now() - begun < maxAtOnce_ms) continue;
    await new Promise((shown) => {
      requestAnimationFrame(() => setTimeout(shown));
      setTimeout(shown, 200); // a page in the background has no frames
    });
    begun = performance.now();
  }
}

function showBelow(doc: Doc, {leftOut, failed}: Drawn, host: HTMLElement): void {
  host.append(el('div', {class: 'below'},
    failed.length > 0 ? el('p', {class: 'left-out', 'data-failed': failed.length}, `Could not be drawn: ${failed.join(' · ')}`) : null,
    leftOut.length > 0 ? el('p', {class: 'left-out'}, `Left out, as this run has no data for them: ${leftOut.join(' · ')}`) : null,
    dataSection(doc), provenance(doc)));
}

async function showReport(doc: Doc, host: HTMLElement): Promise<void> {
  const main = el('main'), selection = new Selection(), drawn: Drawn = {cards: [], leftOut: [], failed: []};
  const top = header(doc, new Set());
  host.append(top, main);
  // For tests: where marks lie.
  (window as unknown as Record<string, unknown>)['alidade'] = {doc, selection, cards: drawn.cards, charts, views3};
  const {figures, first} = figuresOf(doc);
  await drawFigures(figures, (figure) => drawFigure(figure, doc, selection, main, drawn, first.has(figure)));
  fillRows(drawn.cards);
  top.replaceWith(header(doc, new Set(drawn.cards.map((card) => card.figure.id)))); // checks lead to figures now
  showBelow(doc, drawn, host);
  listenToKeys(doc, selection, drawn.cards);
}

const documentIsRead = new Promise<void>((read) => {
  if (document.readyState === 'loading') addEventListener('DOMContentLoaded', () => read());
  else read();
});

async function start(): Promise<void> {
  const doc = readDocument(document.getElementById('result')?.textContent ?? '');
  const host = document.getElementById('page')!;
  void documentIsRead.then(findImages);
  listenToPrinting();
  if (isCapture(doc)) showCapture(doc, host, (result) => void showReport(result, host));
  else if (isLive(doc)) showLive(doc, host, (result) => void showReport(result, host));
  else await showReport(doc, host);
  await documentIsRead;
  document.documentElement.dataset['ready'] = '1';
}

void start();
