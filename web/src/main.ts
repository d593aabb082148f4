// The page of one run: reads the document, draws the figures of its command.
import {charts} from './core/chart';
import {readDocument, type Doc} from './core/document';
import {el} from './core/dom';
import type {Figure} from './core/figure';
import {findPictures} from './core/images';
import {Selection} from './core/selection';
import {views3} from './core/view3';
import {figuresOf} from './figures/all';
import {isLive, showLive} from './live/page';
import {makeCard, type Card} from './page/card';
import {header} from './page/header';
import {listenToKeys} from './page/keys';
import {listenToPrinting} from './page/print';
import {provenance} from './page/provenance';
import {dataSection} from './page/tables';

function drawFigures(figures: Figure[], doc: Doc, selection: Selection, host: HTMLElement) {
  const cards: Card[] = [], leftOut: string[] = [], failed: string[] = [];
  for (const figure of figures) {
    try {
      const card = makeCard(figure, doc, selection, host);
      if (card) cards.push(card);
      else leftOut.push(figure.title);
    } catch (error) {
      // One figure must not take the page with it; what failed is said below, and in the console.
      host.querySelector(`#fig-${figure.id}`)?.remove();
      failed.push(figure.title);
      console.error(`figure ${figure.id}:`, error);
    }
  }
  return {cards, leftOut, failed};
}

function showReport(doc: Doc, host: HTMLElement): void {
  const main = el('main'), selection = new Selection();
  host.append(main);
  const {cards, leftOut, failed} = drawFigures(figuresOf(doc), doc, selection, main);
  host.prepend(header(doc, new Set(cards.map((card) => card.figure.id))));
  const below = el('div', {class: 'below'},
    failed.length > 0 ? el('p', {class: 'left-out', 'data-failed': failed.length}, `Could not be drawn: ${failed.join(' · ')}`) : null,
    leftOut.length > 0 ? el('p', {class: 'left-out'}, `Left out, as this run has no data for them: ${leftOut.join(' · ')}`) : null,
    dataSection(doc), provenance(doc));
  host.append(below);
  listenToKeys(doc, selection, cards);
  // For tests: where marks lie.
  (window as unknown as Record<string, unknown>)['alidade'] = {doc, selection, cards, charts, views3};
}

function start(): void {
  const doc = readDocument(document.getElementById('result')?.textContent ?? '');
  const host = document.getElementById('page')!;
  listenToPrinting();
  if (isLive(doc)) showLive(doc, host, (result) => showReport(result, host));
  else showReport(doc, host);
  const whole = () => {
    findPictures();
    document.documentElement.dataset['ready'] = '1';
  };
  if (document.readyState === 'loading') addEventListener('DOMContentLoaded', whole);
  else whole();
}

start();
