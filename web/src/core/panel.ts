// Drawing in the coordinates of an image: pixels, size in colour, contours, fields of arrows.
import type {Pen} from './chart';
import {cividis, css, directionColour, pixelHigh, pixelLevels, pixelLow, pixelShare} from './colours';
import {contourSegments, type Segment} from './contour';
import type {Grid} from './document';
import {num} from './format';
import {scale, type Scale} from './scale';
import {roundDown125} from './stats';

/** A image on paper; pixel (0, 0) is the centre of its first pixel. */
export interface Panel {
  x: number; y: number; w: number; h: number;
  perPixel: number;
  at(u: number, v: number): [number, number];
  pixel(x: number, y: number): [number, number];
  holds(x: number, y: number): boolean;
}

export function panelIn(size: {width: number; height: number}, x: number, y: number, w: number, h: number): Panel {
  const perPixel = Math.min(w / size.width, h / size.height);
  const width = perPixel * size.width, height = perPixel * size.height;
  const left = x + (w - width) / 2, top = y + (h - height) / 2;
  return {x: left, y: top, w: width, h: height, perPixel,
    at: (u, v) => [left + (u + 0.5) * perPixel, top + (v + 0.5) * perPixel],
    pixel: (px, py) => [(px - left) / perPixel - 0.5, (py - top) / perPixel - 0.5],
    holds: (px, py) => px >= left && px <= left + width && py >= top && py <= top + height};
}

/** Values between the grid's points; NaN outside. */
export function valueAt(grid: Grid, values: Float64Array, u: number, v: number): number {
  const x = (u - grid.u0) / grid.du, y = (v - grid.v0) / grid.dv;
  const i = Math.min(grid.cols - 2, Math.max(0, Math.floor(x))), j = Math.min(grid.rows - 2, Math.max(0, Math.floor(y)));
  const a = x - i, b = y - j;
  if (a < -0.6 || a > 1.6 || b < -0.6 || b > 1.6) return NaN;
  const at = (c: number, r: number) => values[(j + r) * grid.cols + i + c]!;
  return (1 - b) * ((1 - a) * at(0, 0) + a * at(1, 0)) + b * ((1 - a) * at(0, 1) + a * at(1, 1));
}

export function drawHeat(pen: Pen, panel: Panel, grid: Grid, values: Float64Array): void {
  const image = document.createElement('canvas');
  image.width = grid.cols;
  image.height = grid.rows;
  const g = image.getContext('2d');
  if (!g) return;
  const data = g.createImageData(grid.cols, grid.rows);
  for (let i = 0; i < values.length; ++i) {
    const colour = cividis(pixelShare(values[i]!));
    data.data.set(colour, 4 * i);
    data.data[4 * i + 3] = Number.isFinite(values[i]) ? 255 : 0;
  }
  g.putImageData(data, 0, 0);
  const [x, y] = panel.at(grid.u0 - grid.du / 2, grid.v0 - grid.dv / 2);
  pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
    pen.g.imageSmoothingEnabled = true;
    pen.g.drawImage(image, x, y, grid.cols * grid.du * panel.perPixel, grid.rows * grid.dv * panel.perPixel);
  });
}

/** Contours at the levels that all reports share, each labelled once where no other label stands. */
export function drawContours(pen: Pen, panel: Panel, grid: Grid, values: Float64Array, lowest = pixelLow): number {
  const labels: [number, number][] = [];
  let drawn = 0;
  pixelLevels.forEach((level, index) => {
    if (level < lowest) return;
    const segments = contourSegments(grid, values, level);
    if (segments.length === 0) return;
    ++drawn;
    pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
      pen.g.beginPath();
      for (const [u1, v1, u2, v2] of segments) {
        pen.g.moveTo(...panel.at(u1, v1));
        pen.g.lineTo(...panel.at(u2, v2));
      }
      pen.g.strokeStyle = 'rgba(255,255,255,.92)';
      pen.g.lineWidth = 1.2;
      pen.g.stroke();
    });
    label(pen, panel, segments, `${num(level, 2)} px`, labels, index);
  });
  return drawn;
}

function label(pen: Pen, panel: Panel, segments: Segment[], words: string, taken: [number, number][], index: number): void {
  const half = pen.width(words, 10.5, 700) / 2 + 9;
  // Labels stand at the lower right, each a little further round, so that they do not pile up.
  const turn = 0.5 + 0.55 * index, dx = Math.cos(turn), dy = Math.sin(turn);
  const middle: [number, number] = [panel.x + panel.w / 2, panel.y + panel.h / 2];
  const places = segments.map(([u1, v1, u2, v2]) => panel.at((u1 + u2) / 2, (v1 + v2) / 2))
    .filter(([x, y]) => x > panel.x + half && x < panel.x + panel.w - half && y > panel.y + 9 && y < panel.y + panel.h - 9);
  places.sort((a, b) => facing(b, middle, dx, dy) - facing(a, middle, dx, dy));
  const free = places.find(([x, y]) => taken.every(([tx, ty]) => Math.abs(tx - x) > 2 * half || Math.abs(ty - y) > 18));
  if (!free) return;
  taken.push(free);
  pen.text(words, free[0], free[1], {align: 'center', size: 10.5, weight: 700, colour: '#fff', box: 'rgba(12,16,22,.85)'});
}
function facing(place: [number, number], middle: [number, number], dx: number, dy: number): number {
  const x = place[0] - middle[0], y = place[1] - middle[1];
  return (x * dx + y * dy) / (Math.hypot(x, y) || 1);
}

export interface ArrowField {
  magnification: number;
  drawn: number;
}

/** Arrows of a field, thinned to about `across` columns; magnified so that the larger quarter reads well. */
export function drawArrows(pen: Pen, panel: Panel, grid: Grid, du: Float64Array, dv: Float64Array,
                           magnification: number, across: number): number {
  const every = Math.max(1, Math.round(grid.cols / across)), first = Math.floor(every / 2);
  const longest = 0.14 * panel.w;
  let drawn = 0;
  pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
    for (let row = first; row < grid.rows; row += every)
      for (let col = first; col < grid.cols; col += every) {
        const i = row * grid.cols + col, factor = magnification * panel.perPixel;
        const [x, y] = panel.at(grid.u0 + col * grid.du, grid.v0 + row * grid.dv);
        const dx = du[i]! * factor, dy = dv[i]! * factor;
        if (!(Math.hypot(dx, dy) < longest)) continue;
        pen.arrow(x, y, x + dx, y + dy, 'rgba(0,0,0,.55)', 3, 6);
        pen.arrow(x, y, x + dx, y + dy, '#fff', 1.3, 5);
        ++drawn;
      }
  });
  return drawn;
}

/** A round factor that draws `size_px` about `length` long, and a bar of a round size to go with it. */
export function magnificationFor(panel: Panel, size_px: number, length: number): {factor: number; bar_px: number; barLength: number} {
  const factor = size_px > 0 ? Math.max(1, roundDown125(length / (size_px * panel.perPixel))) : 1;
  const bar_px = roundDown125(40 / (factor * panel.perPixel));
  return {factor, bar_px, barLength: bar_px * factor * panel.perPixel};
}

/** Colours of sizes in px, with its ticks and what it is; its scale is that of every report. */
export function colourBar(pen: Pen, left: number, right: number, top: number, words: string): Scale {
  const x = scale(pixelLow, pixelHigh, left, right, true);
  const steps = Math.max(2, Math.round(right - left));
  for (let i = 0; i < steps; ++i)
    pen.rect(left + i, top, 1.6, 9, css(cividis(i / (steps - 1))));
  for (const tick of [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10])
    pen.text(num(tick, 2), x(tick), top + 19, {align: 'center', size: 11, colour: pen.c.soft});
  pen.text(words, (left + right) / 2, top + 35, {align: 'center', size: 11.5, colour: pen.c.soft});
  return x;
}

/** The wheel that tells colours of directions. */
export function directionWheel(pen: Pen, x: number, y: number, r: number): void {
  for (let i = 0; i < 48; ++i) {
    const turn = (i / 48) * 2 * Math.PI;
    pen.g.beginPath();
    pen.g.arc(x, y, r, turn, turn + 0.15);
    pen.g.strokeStyle = css(directionColour(Math.cos(turn + 0.07), Math.sin(turn + 0.07)));
    pen.g.lineWidth = 6;
    pen.g.stroke();
  }
  pen.text('dir', x, y, {align: 'center', size: 10, colour: pen.c.soft});
}

/** 3σ ellipse of a 2×2 covariance, as places. */
export function ellipsePlaces(x: number, y: number, xx: number, xy: number, yy: number, factor: number): number[] {
  const half = 0.5 * (xx + yy), spread = Math.hypot(0.5 * (xx - yy), xy), turn = 0.5 * Math.atan2(2 * xy, xx - yy);
  const major = factor * Math.sqrt(Math.max(0, half + spread)), minor = factor * Math.sqrt(Math.max(0, half - spread));
  const places: number[] = [];
  for (let i = 0; i < 40; ++i) {
    const a = major * Math.cos((i / 40) * 2 * Math.PI), b = minor * Math.sin((i / 40) * 2 * Math.PI);
    places.push(x + a * Math.cos(turn) - b * Math.sin(turn), y + a * Math.sin(turn) + b * Math.cos(turn));
  }
  return places;
}
