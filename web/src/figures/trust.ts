// Where can I trust a pixel? 3σ of projection over the image, and the share of the image under each size.
import {Chart, type Pen} from '../core/chart';
import type {Grid} from '../core/document';
import {el} from '../core/dom';
import {choice, legend, type Figure} from '../core/figure';
import {num} from '../core/format';
import {colourBar, drawContours, drawHeat, panelIn, valueAt, type Panel} from '../core/panel';
import {scale, yAxis, type Scale} from '../core/scale';
import {finite, quantile, scaled} from '../core/stats';
import {pixelHigh, pixelLow} from '../core/colours';
import {calibrateScene} from './calibrate_scene';

interface Map3 {
  words: string;
  grid: Grid;
  three: Float64Array; // 3σ, px
  sorted: number[];
}

function drawShare(pen: Pen, map: Map3, x: Scale, y: Scale, dash: number[]): void {
  const places: number[] = [], all = map.three.length;
  const clamp = (v: number) => Math.min(x.to, Math.max(x.from, x(v)));
  map.sorted.forEach((value, i) => places.push(clamp(value), y((100 * i) / all), clamp(value), y((100 * (i + 1)) / all)));
  if (places.length > 0) places.push(x.to, places[places.length - 1]!);
  pen.path(places, pen.c.ink, 1.8, dash);
}

function shareBelow(map: Map3, size_px: number): number {
  return (100 * map.sorted.filter((value) => value < size_px).length) / map.three.length;
}

export const trust: Figure = {
  id: 'trust', title: 'Where can I trust a pixel?', note: '3σ of projection, px · dots: corners', span: 9,
  draw(host, doc, selection) {
    const {size, corners} = calibrateScene(doc, selection);
    const maps: Map3[] = [];
    for (const [name, words] of [['sigma_infinity', 'at infinity'], ['sigma_working', 'at the working distance']] as const) {
      const grid = doc.pixelGrid(name), sigma = grid?.values('sigma_px');
      if (!grid || !sigma) continue;
      const three = scaled(sigma, 3);
      maps.push({words, grid, three, sorted: finite(three).sort((a, b) => a - b)});
    }
    if (maps.length === 0 || !size) return null;
    let shown = maps[0]!, panel: Panel | null = null;
    if (maps.length > 1) choice(host, 'where', maps.map((map) => map.words), (i) => ((shown = maps[i]!), map.redraw()));
    const words = () => `3σ of projection ${shown.words}: half of the image below ${num(quantile(shown.three, 0.5), 2)} px, worst ${num(quantile(shown.three, 1), 2)} px`;
    const split = el('div', {class: 'split'}), left = el('div', {class: 'wide'}), right = el('div');
    host.append(split);
    split.append(left, right);
    const map = new Chart(left, {height: 120, aspect: size.height / size.width, most: 430, label: words()}, (pen) => {
      panel = panelIn(size, 0, 0, pen.w, pen.h);
      drawHeat(pen, panel, shown.grid, shown.three);
      if (corners)
        for (let i = 0; i < corners.count; ++i) {
          if (!corners.isUsed[i]) continue;
          const [x, y] = panel.at(corners.u[i]!, corners.v[i]!);
          pen.rect(x - 0.6, y - 0.6, 1.2, 1.2, 'rgba(255,255,255,.6)');
        }
      drawContours(pen, panel, shown.grid, shown.three);
    });
    map.hover = (x, y) => {
      if (!panel?.holds(x, y)) return null;
      const [u, v] = panel.pixel(x, y), value = valueAt(shown.grid, shown.three, u, v);
      return [`u ${num(u, 4)}, v ${num(v, 4)} px`, `3σ ${num(value, 3)} px ${shown.words}`];
    };
    if (maps.length > 1) legend(right, maps.map((one, i) => ({words: one.words, colour: 'var(--ink)', look: i === 0 ? 'line' : 'dash'})));
    const share = new Chart(right, {height: 170, isFilling: true, label: 'Share of the image whose 3σ is below each size'}, (pen) => {
      const left = 46, right = pen.w - 10, bottom = pen.h - 44;
      const x = scale(pixelLow, pixelHigh, left, right, true), y = scale(0, 100, bottom, 22);
      yAxis(pen, y, left, right, {format: (v) => `${v} %`, wanted: 2, label: 'share of the image below …'});
      maps.forEach((one, i) => {
        drawShare(pen, one, x, y, i === 0 ? [] : [5, 4]);
      });
      colourBar(pen, left, right, bottom + 3, '3σ of projection, px');
    });
    share.hover = (x, y) => {
      const size_px = scale(pixelLow, pixelHigh, 46, share.box.clientWidth - 10, true).invert(x);
      if (y > share.box.clientHeight - 40 || size_px < pixelLow || size_px > pixelHigh) return null;
      return [`below ${num(size_px, 2)} px`, ...maps.map((one) => `${shareBelow(one, size_px).toFixed(0)} % of the image ${one.words}`)];
    };
    return {marks: maps.length, rows: maps.length, tables: [], words: words(),
      good: `Good: below a third of the accuracy that the task needs, everywhere it looks. Here 3σ is below 0.5 px in ${shareBelow(maps[0]!, 0.5).toFixed(0)} % of the image, and half of it is below ${num(quantile(maps[0]!.three, 0.5), 2)} px.`};
  },
};
