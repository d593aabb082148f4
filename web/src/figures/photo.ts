// This photo: how far off is each corner? Arrows found → predicted, magnified, with each corner's 3σ.
import {Chart, type Pen} from '../core/chart';
import {css, directionColour} from '../core/colours';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num, rounded} from '../core/format';
import {imageOf, whenImagesAreHere} from '../core/images';
import {ellipsePlaces, magnificationFor, panelIn, type Panel} from '../core/panel';
import {lengths, quantile, roundDown125} from '../core/stats';
import {calibrateScene, type Corners, type Photo} from './calibrate_scene';

/** Without an answer, or in a photo that was not used, no corner was judged: each is shown as it was found. */
function drawFound(pen: Pen, panel: Panel, c: Corners, i: number): void {
  const [x, y] = panel.at(c.u[i]!, c.v[i]!);
  pen.circle(x, y, 4, null, '#000', 3.4), pen.circle(x, y, 4, null, '#ffd60a', 1.7);
  pen.hit({x, y, r: 6, tip: () => [`corner ${c.table.text('col', i)}, ${c.table.text('row', i)} at ${num(c.u[i]!, 5)}, ${num(c.v[i]!, 5)} px`, 'as found', `σ ${num(c.su[i]!, 2)}, ${num(c.sv[i]!, 2)} px`]});
}

function drawCorner(pen: Pen, panel: Panel, c: Corners, i: number, factor: number): void {
  const [x, y] = panel.at(c.u[i]!, c.v[i]!), k = factor * panel.perPixel;
  const name = `corner ${c.table.text('col', i)}, ${c.table.text('row', i)}`;
  if (!c.isUsed[i]) {
    pen.cross(x, y, 6, '#000', 4);
    pen.cross(x, y, 6, '#ff7b5a', 2);
    pen.hit({x, y, r: 7, tip: () => [name, 'rejected', `residual ${num(c.du[i]!, 3)}, ${num(c.dv[i]!, 3)} px`]});
    return;
  }
  const su = c.su[i]!, sv = c.sv[i]!;
  if (su > 0 && sv > 0)
    pen.path(ellipsePlaces(x, y, su * su, (c.corr[i] || 0) * su * sv, sv * sv, 3 * k), 'rgba(255,214,10,.8)', 1.1, [], true);
  pen.arrow(x, y, x + k * c.du[i]!, y + k * c.dv[i]!, 'rgba(0,0,0,.75)', 4.2, 7);
  pen.arrow(x, y, x + k * c.du[i]!, y + k * c.dv[i]!, '#fff', 1.7, 6);
  pen.circle(x, y, 3.4, css(directionColour(c.du[i]!, c.dv[i]!)), '#000', 0.8);
  pen.hit({x, y, r: 6, tip: () => [`${name} at ${num(c.u[i]!, 5)}, ${num(c.v[i]!, 5)} px`, `residual ${rounded(c.du[i]!, 3)}, ${rounded(c.dv[i]!, 3)} px`, `σ ${num(su, 2)}, ${num(sv, 2)} px`]});
}

function captionOf(photo: Photo | undefined, isAnswer: boolean, isThinned: boolean): (string | HTMLElement)[] {
  if (!photo) return ['no photo chosen'];
  const found = photo.corners.length > 0 ? ` · ${photo.corners.length} corners found` : '';
  if (!isAnswer) return [el('b', {}, photo.name), found || ' · no corner was found', photo.reason ? ` · ${photo.reason}` : ''];
  return [el('b', {}, photo.name), photo.isUsed && photo.rms_px >= 0 ? ` · RMS ${rounded(photo.rms_px, 3)} px · ${photo.corners.length} corners${isThinned ? ' shown of more' : ''}` : ` · not used: ${photo.reason || '–'}${found}`];
}

export const photo: Figure = {
  id: 'photo', title: 'This photo: how far off is each corner?', note: 'found → predicted · yellow: each corner’s 3σ · ← →', span: 12,
  draw(host, doc, selection) {
    const scene = calibrateScene(doc, selection), {size, corners} = scene;
    if (!size || scene.photos.length === 0) return null;
    let factor = 0;
    const caption = el('p', {class: 'caption'}), slider = el('input', {type: 'range', min: 0, max: 100, value: 50, 'aria-label': 'magnification'});
    const shownFactor = el('span');
    host.append(el('div', {class: 'headline'}, caption, corners && doc.isAnswer ? el('label', {class: 'slide'}, 'arrows', slider, shownFactor) : null));
    const typical = corners ? quantile(lengths(corners.du, corners.dv).filter((_, i) => corners.isUsed[i] === 1), 0.95) : NaN;
    const chart = new Chart(host, {height: 200, aspect: size.height / size.width, most: doc.isAnswer ? 760 : 460}, (pen) => {
      const chosen = scene.photos[selection.item], panel = panelIn(size, 0, 0, pen.w, pen.h);
      const image = chosen ? imageOf(chosen.name, () => chart.redraw()) : null;
      if (image) pen.g.drawImage(image, panel.x, panel.y, panel.w, panel.h);
      else pen.rect(panel.x, panel.y, panel.w, panel.h, '#39424c');
      if (!corners || !chosen) return;
      factor = magnificationFor(panel, typical, 0.055 * panel.w).factor * 10 ** ((Number(slider.value) - 50) / 50);
      shownFactor.textContent = `×${num(factor, 2)}`;
      const isJudged = doc.isAnswer && chosen.isUsed;
      for (const i of chosen.corners) isJudged ? drawCorner(pen, panel, corners, i, factor) : drawFound(pen, panel, corners, i);
      if (chosen.corners.length === 0 || !isJudged) return;
      const bar_px = roundDown125(80 / (factor * panel.perPixel));
      pen.scaleBar(panel.x + 20, panel.y + panel.h - 22, bar_px * factor * panel.perPixel, `${num(bar_px, 2)} px`, true);
    });
    const update = () => {
      caption.replaceChildren(...captionOf(scene.photos[selection.item], doc.isAnswer, !!corners?.table.thinned));
      chart.label = `Residual arrows in the photo. ${caption.textContent}`;
      chart.redraw();
    };
    slider.addEventListener('input', () => chart.redraw());
    selection.on(update);
    whenImagesAreHere(update);
    update();
    const marks = scene.photos[selection.item]?.corners.length ?? 0;
    return {marks, rows: marks, tables: corners ? [corners.table] : [], words: caption.textContent ?? '',
      title: doc.isAnswer ? undefined : 'This photo: which corners were found?', note: doc.isAnswer ? undefined : 'rings: corners as found · ← →',
      good: corners && !doc.isAnswer ? 'There is no answer to judge corners by: rings show where each was found.' : corners ? 'Good: arrows of no common direction, most within their 3σ. Crosses: corners rejected; rings: corners of a photo that was not used.' : 'No corners are drawn: this run has no camera to draw them by.'};
  },
};
