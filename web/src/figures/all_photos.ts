// Is it the same in every photo? All of them small, worst first; also a choice of shots.
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num} from '../core/format';
import {hasImage, imageOf, whenImagesAreHere} from '../core/images';
import type {Selection} from '../core/selection';
import {calibrateScene} from './calibrate_scene';

const maxThumbs = 1000;

/** Thumbnails that choose; each image is decoded when it comes into sight. */
export function thumbnails(host: HTMLElement, selection: Selection, items: number[], words: (item: number) => string, name: (item: number) => string): number {
  const box = el('div', {class: 'thumbs', role: 'group', 'aria-label': 'choose'}), buttons = new Map<number, HTMLButtonElement>();
  const observer = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      const button = entry.target as HTMLButtonElement, item = Number(button.dataset['item']);
      if (!entry.isIntersecting) continue;
      observer.unobserve(button);
      const show = () => {
        const image = imageOf(name(item), show);
        if (image) button.firstElementChild?.replaceWith(el('img', {src: image.src, alt: ''}));
      };
      show();
    }
  }, {rootMargin: '200px'});
  for (const item of items.slice(0, maxThumbs)) {
    const button = el('button', {type: 'button', title: words(item), 'data-item': item}, el('span', {class: 'empty'}), el('span', {}, words(item)));
    button.addEventListener('click', () => selection.choose(item));
    buttons.set(item, button);
    box.append(button);
  }
  const mark = () => buttons.forEach((button, item) => button.setAttribute('aria-pressed', String(item === selection.item)));
  selection.on(mark);
  mark();
  host.append(box);
  whenImagesAreHere(() => {
    const has = items.some((item) => hasImage(name(item)));
    for (const button of buttons.values()) has ? observer.observe(button) : button.firstElementChild?.remove();
  });
  return buttons.size;
}

export const allPhotos: Figure = {
  id: 'all-photos', title: 'Is it the same in every photo?', note: 'click to choose · worst first', span: 24,
  draw(host, doc, selection) {
    const scene = calibrateScene(doc, selection), order = [...scene.worstFirst, ...scene.unused];
    if (order.length < 2) return null;
    const marks = thumbnails(host, selection, order, (i) => {
      const photo = scene.photos[i]!;
      return `${photo.name} · ${photo.isUsed ? `${num(photo.rms_px, 3)} px` : 'not used'}`;
    }, (i) => scene.photos[i]!.name);
    return {marks, rows: Math.min(maxThumbs, order.length), tables: [doc.table('photos')!], words: `${marks} photos`};
  },
};
