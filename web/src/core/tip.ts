// The one box of words beside the pointer.
import {el} from './dom';

let box: HTMLDivElement | null = null;
let words = '';

export function showTip(lines: string[], x: number, y: number): void {
  if (!box) document.body.append((box = el('div', {class: 'tip', role: 'status'})));
  words = lines.join('\n');
  box.textContent = words;
  box.hidden = false;
  const w = box.offsetWidth, h = box.offsetHeight;
  box.style.left = `${Math.max(4, x + 14 + w > window.innerWidth ? x - w - 12 : x + 14)}px`;
  box.style.top = `${Math.max(4, y + 16 + h > window.innerHeight ? y - h - 10 : y + 16)}px`;
}
export function hideTip(): void {
  if (box) box.hidden = true;
}
/** What stands beside the pointer, to be copied. */
export function tipWords(): string {
  return box && !box.hidden ? words : '';
}
