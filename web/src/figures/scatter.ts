// Dots over two values: shared by residuals against angles, coverage and paths from above.
import {Chart, type Pen} from '../core/chart';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent} from '../core/stats';

export interface ScatterDot {
  x: number; y: number;
  colour: (pen: Pen) => string;
  size: number;
  shape?: 'disc' | 'square' | 'cross' | 'up' | 'down';
  tip: () => string[];
  pick?: () => void;
  isChosen?: () => boolean;
}
export interface ScatterLook {
  xLabel: string; yLabel: string;
  height: number;
  isFilling?: boolean;
  isSquare?: boolean; // the same unit both ways
  label: string;
  zero?: boolean; // y about zero
  below?: (pen: Pen, x: (v: number) => number, y: (v: number) => number) => void;
  include?: [number, number][];
}

export function scatter(host: HTMLElement, dots: ScatterDot[], look: ScatterLook): Chart {
  const more = look.include ?? [], xs = extent(dots.map((d) => d.x), more.map(([x]) => x)) ?? [-1, 1], ys = extent(dots.map((d) => d.y), more.map(([, y]) => y)) ?? [-1, 1];
  const pad = (ends: [number, number], share: number): [number, number] => {
    const margin = share * (ends[1] - ends[0]) || Math.abs(ends[0]) * 0.1 || 1;
    return [ends[0] - margin, ends[1] + margin];
  };
  let [x0, x1] = pad(xs, 0.07), [y0, y1] = look.zero ? pad([-Math.max(-ys[0], ys[1]), Math.max(-ys[0], ys[1])], 0.08) : pad(ys, 0.09);
  return new Chart(host, {height: look.height, isFilling: look.isFilling, label: look.label}, (pen) => {
    const left = 52, right = pen.w - 12, top = 22, bottom = pen.h - 42;
    let [a0, a1, b0, b1] = [x0, x1, y0, y1];
    if (look.isSquare) {
      const per = Math.max((x1 - x0) / (right - left), (y1 - y0) / (bottom - top)), mx = (x0 + x1) / 2, my = (y0 + y1) / 2;
      [a0, a1, b0, b1] = [mx - (per * (right - left)) / 2, mx + (per * (right - left)) / 2, my - (per * (bottom - top)) / 2, my + (per * (bottom - top)) / 2];
    }
    const x = scale(a0, a1, left, right), y = scale(b0, b1, bottom, top);
    yAxis(pen, y, left, right, {label: look.yLabel});
    xAxis(pen, x, top, bottom, {label: look.xLabel});
    pen.clipped(left - 8, top - 8, right - left + 16, bottom - top + 16, () => {
      look.below?.(pen, x, y);
      for (const dot of dots) if (Number.isFinite(dot.x + dot.y)) drawDot(pen, dot, x(dot.x), y(dot.y));
    });
  });
}

function drawDot(pen: Pen, dot: ScatterDot, x: number, y: number): void {
  const r = dot.size, colour = dot.colour(pen);
  if (dot.isChosen?.()) pen.circle(x, y, r + 4, null, pen.c.orange, 2.5);
  if (dot.shape === 'square') pen.rect(x - r, y - r, 2 * r, 2 * r, colour);
  else if (dot.shape === 'cross') pen.cross(x, y, r, colour, 1.8);
  else if (dot.shape === 'up') pen.fill([x - r, y + r, x + r, y + r, x, y - r], colour);
  else if (dot.shape === 'down') pen.fill([x - r, y - r, x + r, y - r, x, y + r], colour);
  else pen.circle(x, y, r, colour, r >= 5 ? pen.c.soft : null, 1); // a rim: a colour may be as dark as the ground
  pen.hit({x, y, r, tip: dot.tip, pick: dot.pick});
}
