// Which photos fit worst? RMS of each, worst first; unused ones hatched, with the reason.
import {Chart, type Pen} from '../core/chart';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num, rounded, shortened} from '../core/format';
import {scale, yAxis} from '../core/scale';
import {calibrateScene, type Scene} from './calibrate_scene';

function hatched(pen: Pen, x: number, y: number, w: number, h: number): void {
  pen.clipped(x, y, w, h, () => {
    for (let at = x - h; at < x + w; at += 6) pen.line(at, y + h, at + h, y, pen.c.soft, 1.4);
  });
  pen.rect(x, y, w, h, null, pen.c.soft, 0.8);
}

function reasons(scene: Scene): HTMLElement | null {
  if (scene.unused.length === 0) return null;
  const most = 200;
  return el('details', {class: 'reasons', open: scene.unused.length <= 6},
    el('summary', {}, `${scene.unused.length} not used, and why`),
    el('ul', {}, ...scene.unused.slice(0, most).map((i) => el('li', {}, el('b', {}, scene.photos[i]!.name || '–'), ' ' + (scene.photos[i]!.reason || 'no reason given'))),
      scene.unused.length > most ? el('li', {}, `… and ${scene.unused.length - most} more`) : null));
}

export const worstPhotos: Figure = {
  id: 'photos', title: 'Which photos fit worst?', note: 'RMS per corner, px · click a bar, or ← →', span: 24,
  draw(host, doc, selection) {
    const scene = calibrateScene(doc, selection), order = [...scene.worstFirst, ...scene.unused];
    if (order.length === 0) return null;
    const all = doc.estimate('rms_px'), worst = scene.worstFirst.length > 0 ? scene.photos[scene.worstFirst[0]!]! : null;
    const label = worst ? `${scene.worstFirst.length} photos by RMS, worst first: ${worst.name} with ${num(worst.rms_px, 3)} px` : 'No photo was used';
    const why = reasons(scene);
    if (!worst) {
      if (why) host.append(why);
      return {title: 'Why was no photo used?', note: '', marks: order.length, rows: order.length, tables: [doc.table('photos')!], words: label};
    }
    const chart = new Chart(host, {height: 150, label}, (pen) => {
      const left = 46, right = pen.w - 8, top = 20, bottom = pen.h - 20;
      const high = 1.1 * Math.max(worst?.rms_px ?? 0, all > 0 ? all : 0, 1e-6), y = scale(0, high, bottom, top);
      yAxis(pen, y, left, right, {wanted: 4});
      const pitch = Math.min(120, (right - left) / order.length), gap = pitch > 12 ? 3 : pitch > 4 ? 1 : 0;
      order.forEach((index, place) => {
        const photo = scene.photos[index]!, x = left + pitch * place, w = Math.max(0.5, pitch - gap);
        const isUsed = photo.isUsed && photo.rms_px >= 0, top_ = isUsed ? y(photo.rms_px) : y(0.14 * high);
        const isChosen = index === selection.item;
        if (isUsed) pen.rect(x, top_, w, bottom - top_, isChosen ? pen.c.orange : pen.c.blue);
        else hatched(pen, x, top_, w, bottom - top_);
        if (isChosen) pen.rect(x, bottom + 1, w, 3, pen.c.orange);
        if (pitch > 40 && isUsed) pen.text(rounded(photo.rms_px, 3), x + w / 2, bottom - 10, {align: 'center', size: 11, weight: 650, colour: bottom - top_ > 20 ? pen.c.card : pen.c.ink});
        if (pitch > 40) pen.text(shortened(photo.name.replace(/\.\w+$/, ''), Math.floor(pitch / 7.5)), x + w / 2, bottom + 12, {align: 'center', size: 11, colour: isChosen ? pen.c.ink : pen.c.soft});
        pen.hit({x: x + pitch / 2, y: (top + bottom) / 2, w: pitch, h: bottom - top + 30, pick: () => selection.choose(index),
          tip: () => [photo.name, isUsed ? `RMS ${num(photo.rms_px, 4)} px, ${photo.corners.length} corners` : `not used: ${photo.reason || '–'}`]});
      });
      if (pitch <= 40) pen.text(`${order.length} photos, worst first`, (left + right) / 2, bottom + 12, {align: 'center', size: 11, colour: pen.c.soft});
      if (all > 0) pen.line(left, y(all), right, y(all), pen.c.ink, 1.2, [5, 4]), pen.text(`all ${rounded(all, 3)}`, right, y(all) - 8, {align: 'right', size: 11, box: pen.c.card});
    });
    selection.on(() => chart.redraw());
    if (why) host.append(why);
    return {marks: order.length, rows: scene.photos.length, tables: [doc.table('photos')!], words: label,
      good: worst ? 'Good: all about alike. A bar that stands out is a blurred photo, a bent board or a wrong corner: look at it below.' : undefined};
  },
};
