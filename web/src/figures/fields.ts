// Two cameras' difference over the image: size in colour, contours, arrows; beside it what σ predicts.
import {Chart} from '../core/chart';
import type {Grid} from '../core/document';
import {el} from '../core/dom';
import {num} from '../core/format';
import {colourBar, drawArrows, drawContours, drawHeat, magnificationFor, panelIn, valueAt, type Panel} from '../core/panel';
import {quantile} from '../core/stats';

export interface Field {
  title: string;
  grid: Grid;
  size: {width: number; height: number};
  values: Float64Array; // px
  du?: Float64Array;
  dv?: Float64Array;
}

export function sizeOfGrid(grid: Grid): {width: number; height: number} {
  return {width: grid.u0 + grid.du * (grid.cols - 1) + 1, height: grid.v0 + grid.dv * (grid.rows - 1) + 1};
}

/** One map with its colours, contours and arrows. */
export function drawField(host: HTMLElement, field: Field, lowest: number, most = 640): Chart {
  const {grid, size, values} = field, hasArrows = field.du && field.dv;
  host.append(el('p', {class: 'caption'}, field.title));
  let panel: Panel | null = null;
  const label = `${field.title}: half below ${num(quantile(values, 0.5), 2)} px, at most ${num(quantile(values, 1), 2)} px`;
  const chart = new Chart(host, {height: 120, aspect: size.height / size.width + (hasArrows ? 0.06 : 0), most, label}, (pen) => {
    panel = panelIn(size, 0, 0, pen.w, pen.h - (hasArrows ? 26 : 0));
    drawHeat(pen, panel, grid, values);
    drawContours(pen, panel, grid, values, lowest);
    if (!field.du || !field.dv) return;
    const {factor, bar_px, barLength} = magnificationFor(panel, quantile(values, 0.7), 0.06 * panel.w);
    drawArrows(pen, panel, grid, field.du, field.dv, factor, 11);
    pen.scaleBar(4, panel.y + panel.h + 15, barLength, `${num(bar_px, 2)} px, arrows ×${num(factor, 3)}; far longer ones omitted`);
  });
  chart.hover = (x, y) => {
    if (!panel?.holds(x, y)) return null;
    const [u, v] = panel.pixel(x, y);
    return [`u ${num(u, 4)}, v ${num(v, 4)} px`, `${num(valueAt(grid, values, u, v), 3)} px`];
  };
  return chart;
}

export function colourKey(host: HTMLElement, words: string): void {
  new Chart(host, {height: 46, label: words}, (pen) => void colourBar(pen, Math.max(20, pen.w / 2 - 260), Math.min(pen.w - 20, pen.w / 2 + 260), 2, words));
}

/** Share of the grid where the first is not above the second; counting only. */
export function shareNotAbove(a: Float64Array, b: Float64Array): number {
  let known = 0, below = 0;
  for (let i = 0; i < a.length; ++i) {
    if (!Number.isFinite(a[i]! + b[i]!)) continue;
    ++known;
    if (a[i]! <= b[i]!) ++below;
  }
  return known > 0 ? below / known : NaN;
}
