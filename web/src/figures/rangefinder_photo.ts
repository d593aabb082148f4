// Is the spot where the beam puts it? The photo with the beam's line, the spot seen and the spot predicted.
import {Chart, type Pen} from '../core/chart';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num} from '../core/format';
import {imageOf, whenImagesAreHere} from '../core/images';
import {ellipsePlaces, panelIn, type Panel} from '../core/panel';
import {pointAt, rangefinderScene, type RangefinderScene, type Shot} from './rangefinder_scene';
import {thumbnails} from './all_photos';

const yellow = '#ffd60a';

function beamLine(scene: RangefinderScene, panel: Panel, longest: number): number[] {
  const places: number[] = [];
  for (let k = 0; k <= 160; ++k) {
    const at = scene.lens!.project(pointAt(scene.beam!, 0.02 * (1.5 * longest / 0.02) ** (k / 160)));
    places.push(...(at ? panel.at(...at) : [NaN, NaN]));
  }
  return places;
}

/** Seen as a cross, predicted as a ring with the 3σ of their difference. */
function drawSpot(pen: Pen, panel: Panel, shot: Shot): void {
  const [x, y] = panel.at(shot.u, shot.v), [px, py] = panel.at(shot.u + shot.du, shot.v + shot.dv), k = panel.perPixel;
  if (shot.su > 0 && Number.isFinite(px)) pen.path(ellipsePlaces(px, py, shot.su ** 2, shot.cuv || 0, shot.sv ** 2, 3 * k), yellow, 1.4, [], true);
  for (const [colour, width] of [['#000', 4], ['#fff', 1.8]] as const)
    pen.line(x - 8, y, x + 8, y, colour, width), pen.line(x, y - 8, x, y + 8, colour, width);
  if (Number.isFinite(px)) pen.circle(px, py, 4.5, null, '#000', 3.5), pen.circle(px, py, 4.5, null, yellow, 1.8);
}

function drawInset(pen: Pen, scene: RangefinderScene, shot: Shot, whole: Panel, image: HTMLImageElement | null): void {
  const size = 0.3 * whole.w, half_px = Math.max(4 * Math.max(shot.su, shot.sv) || 0, 1.6 * Math.hypot(shot.du, shot.dv) || 0, 1), k = size / (2 * half_px);
  const [sx, sy] = whole.at(shot.u, shot.v), left = sx < whole.x + whole.w / 2 ? whole.x + whole.w - size - 8 : whole.x + 8, top = sy < whole.y + whole.h / 2 ? whole.y + whole.h - size - 8 : whole.y + 8;
  const panel: Panel = {x: left, y: top, w: size, h: size, perPixel: k, at: (u, v) => [left + size / 2 + (u - shot.u) * k, top + size / 2 + (v - shot.v) * k],
    pixel: (x, y) => [shot.u + (x - left - size / 2) / k, shot.v + (y - top - size / 2) / k], holds: () => false};
  pen.rect(left, top, size, size, '#262d35');
  pen.clipped(left, top, size, size, () => {
    if (image) {
      const perPixel = image.naturalWidth / scene.lens!.width;
      pen.g.drawImage(image, (shot.u + 0.5 - half_px) * perPixel, (shot.v + 0.5 - half_px) * perPixel, 2 * half_px * perPixel, 2 * half_px * perPixel, left, top, size, size);
    }
    if (scene.beam) { // the stretch that passes: the line of the whole image is too coarse here
      const places: number[] = [];
      for (let i = 0; i <= 60; ++i) {
        const at = scene.lens!.project(pointAt(scene.beam, shot.range_m * (0.5 + i / 60)));
        places.push(...(at ? panel.at(...at) : [NaN, NaN]));
      }
      pen.path(places, '#ff5a36', 1.6);
    }
    drawSpot(pen, panel, shot);
  });
  pen.rect(left, top, size, size, null, '#fff', 1.4);
  pen.text(`${num(2 * half_px, 2)} px across`, left + 8, top + 13, {size: 11, colour: '#fff', box: 'rgba(0,0,0,.7)'});
}

function drawRanges(pen: Pen, scene: RangefinderScene, panel: Panel, longest: number): void {
  let lastX = NaN, lastY = NaN, side = 1;
  for (const range of [0.2, 0.5, 1, 2, 5, 10, 20, 50]) {
    const at = range <= 1.5 * longest ? scene.lens!.project(pointAt(scene.beam!, range)) : null;
    if (!at) continue;
    const [x, y] = panel.at(...at);
    if (!panel.holds(x, y) || Math.hypot(x - lastX, y - lastY) < 14) continue;
    pen.circle(x, y, 3, '#ff5a36', '#fff', 1);
    pen.text(`${range} m`, x + side * 26, y - 8, {align: 'center', size: 10.5, weight: 650, colour: '#fff', box: 'rgba(0,0,0,.72)'});
    side = -side, lastX = x, lastY = y;
  }
}

export const rangefinderPhoto: Figure = {
  id: 'photo', title: 'Is the spot where the beam puts it?', note: 'px · ← → other shots', span: 10,
  draw(host, doc, selection) {
    const scene = rangefinderScene(doc, selection), {lens} = scene ?? {};
    if (!scene || !lens || !scene.shots.some((s) => Number.isFinite(s.u)) && !scene.beam) return null;
    const caption = el('p', {class: 'caption'}), longest = Math.max(0.5, ...scene.shots.slice(0, 5000).map((s) => (s.isUsed ? s.range_m || 0 : 0)));
    host.append(caption);
    const chart = new Chart(host, {height: 200, aspect: lens.height / lens.width, most: 640}, (pen) => {
      const shot = scene.shots[selection.item], panel = panelIn(lens, 0, 0, pen.w, pen.h), image = shot ? imageOf(shot.name, () => chart.redraw()) : null;
      if (image) pen.g.drawImage(image, panel.x, panel.y, panel.w, panel.h);
      else pen.rect(panel.x, panel.y, panel.w, panel.h, '#39424c');
      pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
        for (const one of scene.shots) if (Number.isFinite(one.u)) pen.circle(...panel.at(one.u, one.v), 1.6, 'rgba(255,255,255,.7)');
        if (scene.beam) pen.path(beamLine(scene, panel, longest), '#ff5a36', 1.6), drawRanges(pen, scene, panel, longest);
        if (shot && Number.isFinite(shot.u)) drawSpot(pen, panel, shot);
      });
      scene.shots.forEach((one, i) => Number.isFinite(one.u) && pen.hit({x: panel.at(one.u, one.v)[0], y: panel.at(one.u, one.v)[1], r: 3, pick: () => selection.choose(i),
        tip: () => [one.name, `seen at ${num(one.u, 5)}, ${num(one.v, 5)} px`, `predicted − seen ${num(one.du, 3)}, ${num(one.dv, 3)} px`]}));
      if (shot && Number.isFinite(shot.u)) drawInset(pen, scene, shot, panel, image);
    });
    const update = () => {
      const shot = scene.shots[selection.item];
      caption.replaceChildren(...(shot ? [el('b', {}, shot.name), ` · ${num(shot.range_m, 4)} m` + (Number.isFinite(shot.du) ? ` · spot predicted ${num(Math.hypot(shot.du, shot.dv), 2)} px from where it was seen` : ' · no spot')] : ['no shot chosen']));
      chart.redraw();
    };
    selection.on(update);
    whenImagesAreHere(update);
    update();
    const marks = scene.shots.filter((s) => Number.isFinite(s.u)).length;
    return {marks, rows: marks, tables: [scene.table], words: caption.textContent ?? '', good: 'Good: the seen spot (cross) inside the yellow 3σ of the predicted one (ring), on the line. Dots: spots of all shots.'};
  },
};

export const rangefinderShots: Figure = {
  id: 'all-photos', title: 'Which shots are there?', note: 'click to choose · worst first', span: 24,
  draw(host, doc, selection) {
    const scene = rangefinderScene(doc, selection);
    if (!scene || scene.shots.length < 2) return null;
    const marks = thumbnails(host, selection, scene.worstFirst.slice(0, 300), (i) => `${scene.shots[i]!.name} · ${num(scene.shots[i]!.range_m, 3)} m${scene.shots[i]!.isUsed ? '' : ' · not used'}`, (i) => scene.shots[i]!.name);
    return {marks, rows: Math.min(300, scene.shots.length), tables: [scene.table], words: `${marks} shots`};
  },
};
