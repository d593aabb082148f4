// A world without WebGL: lines, faces and dots, flat, from three sides.
import type {Pen} from './chart';
import {num} from './format';
import {cssOf} from './gl';
import {cross, dot, mul, unit, type V3} from './rigid';
import {roundDown125} from './stats';
import {ballOf, type World} from './world';

interface Side {
  words: string;
  right: V3;
  down: V3;
}

export function drawFlat(pen: Pen, world: World, up: V3, ahead: V3): void {
  const side = unit(cross(ahead, up)), down = mul(up, -1);
  const sides: Side[] = [{words: 'from behind', right: side, down}, {words: 'from above', right: side, down: mul(ahead, -1)},
    {words: 'from the side', right: ahead, down}];
  const isWide = pen.w > 1.2 * pen.h;
  sides.forEach((one, i) => {
    const w = isWide ? pen.w / 3 : pen.w, h = isWide ? pen.h : pen.h / 3;
    drawSide(pen, world, one, isWide ? i * w : 0, isWide ? 0 : i * h, w, h);
  });
}

function drawSide(pen: Pen, world: World, side: Side, left: number, top: number, w: number, h: number): void {
  const ball = ballOf(world.frame), points = world.frame.length > 1 ? world.frame : [ball.middle];
  const xs = points.map((p) => dot(p, side.right)), ys = points.map((p) => dot(p, side.down));
  const [x0, x1, y0, y1] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const perMetre = Math.min((w - 30) / Math.max(1e-9, x1 - x0), (h - 70) / Math.max(1e-9, y1 - y0));
  const at = (p: V3): [number, number] => [left + w / 2 + (dot(p, side.right) - (x0 + x1) / 2) * perMetre,
    top + h / 2 + (dot(p, side.down) - (y0 + y1) / 2) * perMetre];
  pen.rect(left + 2, top + 2, w - 4, h - 4, null, pen.c.grid);
  pen.text(side.words, left + 12, top + 16, {size: 11.5, colour: pen.c.soft});
  pen.clipped(left, top, w, h, () => {
    for (const face of world.faces) {
      pen.g.globalAlpha = Math.min(1, face.opacity);
      pen.fill(face.places.flatMap(at), cssOf(face.colour));
      pen.g.globalAlpha = 1;
      if (face.touch) {
        const places = face.places.map(at), mean = (k: 0 | 1) => places.reduce((sum, p) => sum + p[k], 0) / places.length;
        pen.hit({x: mean(0), y: mean(1), r: 8, ...face.touch});
      }
    }
    for (const {look, places} of world.lines.values()) {
      const flat: number[] = [];
      for (let i = 0; i + 5 < places.length; i += 6)
        flat.push(...at([places[i]!, places[i + 1]!, places[i + 2]!]), ...at([places[i + 3]!, places[i + 4]!, places[i + 5]!]), NaN, NaN);
      pen.g.globalAlpha = look.opacity;
      pen.path(flat, cssOf(look.colour), look.width);
      pen.g.globalAlpha = 1;
    }
    for (const one of world.dots) {
      const [x, y] = at(one.at);
      pen.circle(x, y, one.size / 2, cssOf(one.colour));
      if (one.touch) pen.hit({x, y, r: one.size / 2, ...one.touch});
    }
    for (const label of world.labels) pen.text(label.text, ...at(label.at), {size: 11, weight: 700, align: 'center', colour: cssOf(label.colour)});
  });
  const bar_m = roundDown125(60 / perMetre);
  pen.scaleBar(left + 12, top + h - 14, bar_m * perMetre, bar_m < 0.1 ? `${num(1e3 * bar_m, 2)} mm` : `${num(bar_m, 2)} m`);
}
