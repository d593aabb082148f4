// Keys, the help that lists them, and the theme.
import {charts} from '../core/chart';
import {forgetPalette, palette} from '../core/colours';
import {el} from '../core/dom';
import type {Selection} from '../core/selection';
import {seriesPlots} from '../core/series';
import {tipWords} from '../core/tip';
import {views3} from '../core/view3';
import {toggleFull, toggleTable, type Card} from './card';
import {saveImage} from './image_file';
import type {Doc} from '../core/document';

export type KeyHelp = [string, string][];
const reportKeys: KeyHelp = [
  ['← →  or  j k', 'another photo, shot or view, worst first'], ['0', 'views as they were'], ['d', 'dark or light'],
  ['f', 'figure in the full window, and back'], ['s', 'save the figure as PNG'], ['t', 'the table behind the figure'],
  ['c', 'copy the value at the cursor'], ['Esc', 'close this help; leave the full window'], ['space', 'hold the figures while a run is live'], ['?', 'this help'],
  ['drag', 'zoom into a time axis (double click: all); turn a 3-D view (shift: move it)'],
];

/** Of the page that is shown: a capture has keys of its own, and becomes a report. */
export function showHelp(keys = reportKeys, remark = 'A key acts on the figure under the pointer. Bands, ellipses and “±” are 3σ everywhere.'): void {
  if (closeHelp()) return;
  const box = el('dialog', {class: 'help', 'aria-label': 'Keys'}, el('h2', {}, 'Keys'),
    el('table', {}, ...keys.map(([key, words]) => el('tr', {}, el('td', {}, el('kbd', {}, key)), el('td', {}, words)))), el('p', {class: 'good'}, remark));
  box.addEventListener('click', () => box.close());
  document.querySelector('dialog.help')?.remove();
  document.body.append(box);
  box.showModal();
}

/** Whether there was one to close. */
function closeHelp(): boolean {
  const box = document.querySelector<HTMLDialogElement>('dialog.help[open]');
  box?.close();
  return box !== null;
}

export function redrawAll(): void {
  forgetPalette();
  for (const view of views3) view.forget();
  for (const chart of charts) chart.redraw();
  for (const plot of seriesPlots) plot.redraw();
}

export function toggleTheme(): void {
  document.documentElement.dataset['theme'] = palette().isDark ? 'light' : 'dark';
  redrawAll();
}

function resetAll(): void {
  for (const view of views3) view.reset();
  for (const plot of seriesPlots) plot.reset();
}

/** Until the signal: a live page becomes a report, which has its own. */
export function listenToKeys(doc: Doc, selection: Selection, cards: Card[], signal?: AbortSignal, more: Record<string, () => void> = {}): void {
  let active: Card | null = null;
  for (const card of cards) {
    const touch = () => (active = card);
    card.section.addEventListener('pointerenter', touch);
    card.section.addEventListener('focusin', touch);
  }
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redrawAll, {signal});
  const actions: Record<string, () => void> = {
    ArrowRight: () => selection.step(1), j: () => selection.step(1),
    ArrowLeft: () => selection.step(-1), k: () => selection.step(-1),
    '0': resetAll, d: toggleTheme, '?': () => showHelp(),
    f: () => active && toggleFull(active),
    t: () => active && toggleTable(active),
    s: () => active && saveImage(active, doc),
    ...more,
    c: () => void navigator.clipboard?.writeText(tipWords()).catch(() => undefined),
    // By hand: what prevents the key from scrolling also keeps the browser from closing the dialog.
    Escape: () => closeHelp() || cards.filter((card) => card.section.classList.contains('full')).forEach(toggleFull),
  };
  document.addEventListener('keydown', (event) => {
    const target = event.target as HTMLElement | null;
    if (event.ctrlKey || event.metaKey || event.altKey || target?.matches('input, select, textarea')) return;
    const action = actions[event.key];
    if (!action) return;
    if (event.key.startsWith('Arrow') && selection.items.length === 0) return; // the page scrolls
    event.preventDefault();
    action();
  }, {signal});
}
