// What a 3-D figure shows, as plain data: drawn by WebGL, or flat from three sides without it.
import type {ColourName, Rgb} from './colours';
import {add, cross, isFinite3, mul, norm, sub, unit, type Pose, type V3, move} from './rigid';

export type Colour = ColourName | Rgb;

export interface LineLook {
  colour: Colour;
  width?: number; // px
  opacity?: number;
}
export interface Lines {
  look: Required<LineLook>;
  places: number[]; // pairs of points: 6 numbers a segment
}
export interface Touch {
  tip: () => string[];
  pick?: () => void;
}
export interface Face {
  places: V3[]; // a convex polygon
  colour: Colour;
  opacity: number;
  touch: Touch | null;
}
export interface Dot {
  at: V3;
  colour: Colour;
  size: number; // px, across
  touch: Touch | null;
}
export interface Label {
  at: V3;
  text: string;
  colour: Colour;
}
export interface Texture {
  corners: [V3, V3, V3, V3]; // as the image's: top left, top right, bottom right, bottom left
  name: string;
}

export class World {
  readonly lines = new Map<string, Lines>();
  readonly faces: Face[] = [];
  readonly dots: Dot[] = [];
  readonly labels: Label[] = [];
  readonly textures: Texture[] = [];
  /** Points that a first look must hold. */
  readonly frame: V3[] = [];
  marks = 0;

  line(points: V3[], look: LineLook, isClosed = false): void {
    const places = this.lines_(look);
    for (let i = 0; i + 1 < points.length + (isClosed ? 1 : 0); ++i) {
      const a = points[i]!, b = points[(i + 1) % points.length]!;
      if (isFinite3(a) && isFinite3(b)) places.push(...a, ...b);
    }
  }
  private lines_(look: LineLook): number[] {
    const full = {width: 1.5, opacity: 1, ...look}, key = `${String(full.colour)} ${full.width} ${full.opacity}`;
    let lines = this.lines.get(key);
    if (!lines) this.lines.set(key, (lines = {look: full, places: []}));
    return lines.places;
  }
  face(places: V3[], colour: Colour, opacity: number, touch: Touch | null = null): void {
    if (places.every(isFinite3)) this.faces.push({places, colour, opacity, touch});
  }
  dot(at: V3, colour: Colour, size: number, touch: Touch | null = null): void {
    if (isFinite3(at)) this.dots.push({at, colour, size, touch});
  }
  label(at: V3, text: string, colour: Colour = 'ink'): void {
    if (isFinite3(at)) this.labels.push({at, text, colour});
  }
  hold(...points: V3[]): void {
    for (const point of points) if (isFinite3(point)) this.frame.push(point);
  }
  /** Three rings and a faint skin; `axes`: half-axes. */
  ellipsoid(centre: V3, axes: V3[], colour: Colour, opacity = 0.16): void {
    const [a, b, c] = axes as [V3, V3, V3];
    if (!isFinite3(centre) || !axes.every(isFinite3)) return;
    const at = (p: V3, q: V3, turn: number) => add(centre, add(mul(p, Math.cos(turn)), mul(q, Math.sin(turn))));
    for (const [p, q] of [[a, b], [a, c], [b, c]] as [V3, V3][])
      this.line(Array.from({length: 36}, (_, i) => at(p, q, (i / 36) * 2 * Math.PI)), {colour, width: 1.2, opacity: 0.9}, true);
    const skin = (i: number, j: number): V3 => {
      const polar = (i / 8) * Math.PI, around = (j / 14) * 2 * Math.PI;
      return add(centre, add(mul(c, Math.cos(polar)), mul(add(mul(a, Math.cos(around)), mul(b, Math.sin(around))), Math.sin(polar))));
    };
    if (opacity > 0)
      for (let i = 0; i < 8; ++i)
        for (let j = 0; j < 14; ++j) this.face([skin(i, j), skin(i, j + 1), skin(i + 1, j + 1), skin(i + 1, j)], colour, opacity);
  }
  /** x orange, y green, z blue. */
  axes(pose: Pose, length: number, isNamed = true): void {
    (['x', 'y', 'z'] as const).forEach((name, k) => {
      const tip = move(pose, ([0, 1, 2].map((i) => (i === k ? length : 0)) as V3));
      const colour = (['orange', 'green', 'blue'] as const)[k]!;
      this.line([pose.t, tip], {colour, width: 2.4});
      if (isNamed) this.label(move(pose, ([0, 1, 2].map((i) => (i === k ? length * 1.22 : 0)) as V3)), name, colour);
    });
  }
  /** A camera: its pyramid of sight down to `depth`. Corners of the image plane come back. */
  frustum(pose: Pose, half: [number, number], depth: number, look: LineLook): [V3, V3, V3, V3] {
    const corners = ([[-1, -1], [1, -1], [1, 1], [-1, 1]] as const).map(([x, y]) =>
      move(pose, [x * half[0] * depth, y * half[1] * depth, depth])) as [V3, V3, V3, V3];
    this.line(corners, look, true);
    for (const corner of corners) this.line([pose.t, corner], look);
    return corners;
  }
}

/** Two directions across a third. */
export function across(direction: V3): [V3, V3] {
  const d = unit(direction), other: V3 = Math.abs(d[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
  const a = unit(cross(d, other));
  return [a, cross(d, a)];
}

/** Middle and radius of points; those far out by themselves do not count (quantiles of 1 %). */
export function ballOf(points: V3[]): {middle: V3; radius: number} {
  if (points.length === 0) return {middle: [0, 0, 0], radius: 1};
  const middle = [0, 1, 2].map((k) => {
    const values = points.map((p) => p[k]!).sort((a, b) => a - b);
    const cut = Math.floor(values.length * 0.01);
    return 0.5 * (values[cut]! + values[values.length - 1 - cut]!);
  }) as V3;
  const far = points.map((p) => norm(sub(p, middle))).sort((a, b) => a - b);
  return {middle, radius: far[Math.floor(0.99 * (far.length - 1))] || 1};
}
