// A figure as PNG, twice as fine as on the screen, with its title and where it comes from.
import {charts} from '../core/chart';
import {palette} from '../core/colours';
import type {Doc} from '../core/document';
import {download} from '../core/dom';
import {views3} from '../core/view3';
import type {Card} from './card';

/** Texts of a card where they stand, as a canvas has no markup. */
function drawTexts(g: CanvasRenderingContext2D, section: HTMLElement, left: number, top: number): void {
  const walker = document.createTreeWalker(section, NodeFilter.SHOW_TEXT), range = document.createRange();
  while (walker.nextNode()) {
    const node = walker.currentNode as Text, parent = node.parentElement;
    if (!parent || !node.data.trim() || parent.closest('.tools, .u-hz')) continue;
    const style = getComputedStyle(parent);
    g.font = `${style.fontWeight} ${style.fontSize} ${style.fontFamily}`;
    g.fillStyle = style.color;
    g.textBaseline = 'middle';
    for (const word of node.data.matchAll(/\S+/g)) {
      range.setStart(node, word.index ?? 0);
      range.setEnd(node, (word.index ?? 0) + word[0].length);
      const box = range.getBoundingClientRect();
      if (box.width > 0) g.fillText(word[0], box.left - left, (box.top + box.bottom) / 2 - top);
    }
  }
}

export function saveImage(card: Card, doc: Doc): void {
  for (const view of views3) if (card.section.contains(view.chart.box)) view.wake();
  for (const chart of charts) if (card.section.contains(chart.box)) chart.redrawFor(2);
  const box = card.section.getBoundingClientRect(), canvas = document.createElement('canvas'), foot = 22;
  canvas.width = 2 * box.width;
  canvas.height = 2 * (box.height + foot);
  const g = canvas.getContext('2d');
  if (!g) return;
  g.scale(2, 2);
  g.fillStyle = palette().card;
  g.fillRect(0, 0, box.width, box.height + foot);
  for (const part of card.section.querySelectorAll<HTMLCanvasElement | HTMLImageElement>('canvas, img')) {
    const at = part.getBoundingClientRect();
    if (at.width > 0) g.drawImage(part, at.left - box.left, at.top - box.top, at.width, at.height);
  }
  for (const key of card.section.querySelectorAll<HTMLElement>('.key')) {
    const at = key.getBoundingClientRect();
    g.fillStyle = getComputedStyle(key).getPropertyValue('border-top-color') || palette().ink;
    g.fillRect(at.left - box.left, at.top - box.top, at.width, Math.max(2, at.height));
  }
  drawTexts(g, card.section, box.left, box.top);
  g.font = '11px system-ui, sans-serif';
  g.fillStyle = palette().soft;
  g.fillText(`alidade ${doc.version} ${doc.command} · ${doc.createdUtc} · ${doc.sentence}`, 14, box.height + foot / 2, box.width - 28);
  for (const chart of charts) if (card.section.contains(chart.box)) chart.redrawFor(0);
  canvas.toBlob((blob) => blob && download(`${doc.command.replace(/ /g, '-')}-${card.figure.id}.png`, 'image/png', blob));
}
