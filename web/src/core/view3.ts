// A 3-D figure: built when it comes near the window, drawn on demand; without WebGL flat from three sides.
import {Vector3, type Scene} from 'three';
import {Chart, type ChartLook, type Pen} from './chart';
import {num} from './format';
import {cssOf, dispose, glRenderer, Orbit, sceneOf} from './gl';
import {drawFlat} from './flat';
import {imageOf, whenImagesAreHere} from './images';
import type {V3} from './rigid';
import {roundDown125} from './stats';
import {ballOf, World, type Touch} from './world';

export interface View3Look extends ChartLook {
  up: V3;
  ahead: V3; // what an eye at yaw 0 looks along
  yaw: number;
  pitch: number;
  note?: string; // at the lower right
  hasNoBar?: boolean;
}

interface Polygon {
  places: [number, number][];
  depth: number;
  touch: Touch;
}

export const views3 = new Set<View3>();

export class View3 {
  readonly chart: Chart;
  readonly isFlat: boolean;
  world: World;
  private orbit: Orbit;
  private scene: Scene | null = null;
  private isNear = false;
  private isFitted = false;
  private pending = 0;
  private polygons: Polygon[] = [];

  constructor(host: HTMLElement, private readonly look: View3Look, private readonly make: () => World) {
    this.world = make();
    this.isFlat = glRenderer() === null;
    this.orbit = this.home();
    this.chart = new Chart(host, look, (pen) => this.draw(pen));
    this.chart.hover = (x, y) => this.under(x, y)?.tip() ?? null;
    this.chart.pick = (x, y) => this.under(x, y)?.pick?.();
    this.chart.box.classList.add('view3');
    new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting) || this.isNear) return;
      // Behind what is read first, which has been painted by then, and once for all: images may lie in it.
      whenImagesAreHere(() => requestAnimationFrame(() => setTimeout(() => this.wake(), 150)));
    }, {rootMargin: '300px'}).observe(this.chart.box);
    if (!this.isFlat) this.listen();
    views3.add(this);
  }
  private home(): Orbit {
    return new Orbit(this.look.up, this.look.ahead, this.look.yaw, this.look.pitch);
  }
  /** Draws even where it is far from the window: for paper and saved images. */
  wake(): void {
    if (this.isNear) return;
    this.isNear = true;
    this.chart.redraw();
  }
  /** What is shown has changed. */
  refresh(): void {
    this.pending ||= requestAnimationFrame(() => { // once for many keys in a row
      this.pending = 0;
      this.world = this.make();
      this.forget();
      this.chart.redraw();
    });
  }
  /** The first look again, at what is there now. */
  refit(): void {
    this.isFitted = false;
  }
  forget(): void {
    if (this.scene) dispose(this.scene);
    this.scene = null;
  }
  reset(): void {
    this.orbit = this.home();
    this.isFitted = false;
    this.chart.redraw();
  }

  private draw(pen: Pen): void {
    this.polygons = [];
    pen.rect(0, 0, pen.w, pen.h, pen.c.panel);
    if (this.isFlat) {
      drawFlat(pen, this.world, this.look.up, this.look.ahead);
      return;
    }
    if (!this.isNear) {
      pen.text('3-D, drawn when looked at', pen.w / 2, pen.h / 2, {align: 'center', colour: pen.c.soft});
      return;
    }
    this.drawScene(pen);
  }
  private drawScene(pen: Pen): void {
    const gl = glRenderer(), ratio = pen.g.getTransform().a;
    if (!gl) return;
    if (!this.isFitted) this.fit(pen.w / pen.h);
    this.orbit.place(pen.w / pen.h);
    this.scene ??= sceneOf(this.world, (name) => imageOf(name, () => (this.forget(), this.chart.redraw())), ratio);
    gl.setSize(Math.round(pen.w * ratio), Math.round(pen.h * ratio), false);
    gl.render(this.scene, this.orbit.camera);
    pen.g.drawImage(gl.domElement, 0, 0, pen.w, pen.h);
    this.drawWords(pen);
    this.collect(pen);
  }
  private project(p: V3, pen: Pen): [number, number, number] {
    const v = new Vector3(...p).project(this.orbit.camera);
    return [(v.x * 0.5 + 0.5) * pen.w, (0.5 - v.y * 0.5) * pen.h, v.z];
  }
  private fit(aspect: number): void {
    const ball = ballOf(this.world.frame);
    this.orbit.target = ball.middle;
    this.orbit.distance = (1.1 * ball.radius) / Math.sin((this.orbit.camera.fov * Math.PI) / 360);
    const unitPen = {w: 2, h: 2} as Pen;
    for (let pass = 0; pass < 4 && this.world.frame.length > 1; ++pass) {
      this.orbit.place(aspect);
      const seen = this.world.frame.map((p) => this.project(p, unitPen)).filter(([x, y]) => Number.isFinite(x + y));
      const xs = seen.map(([x]) => x - 1), ys = seen.map(([, y]) => y - 1);
      const [left, right] = [Math.min(...xs), Math.max(...xs)], [top, bottom] = [Math.min(...ys), Math.max(...ys)];
      const height = 600;
      this.orbit.pan(-0.25 * (left + right) * height * aspect, -0.25 * (top + bottom) * height, height);
      this.orbit.distance *= Math.max(0.2, Math.min(3, Math.max((right - left) / 2 / 0.9, (bottom - top) / 2 / 0.84)));
    }
    this.isFitted = true;
  }
  private drawWords(pen: Pen): void {
    for (const label of this.world.labels) {
      const [x, y, depth] = this.project(label.at, pen);
      if (depth > 1 || x < 0 || x > pen.w || y < 0 || y > pen.h) continue;
      pen.text(label.text, x, y, {align: 'center', size: 12, weight: 700, colour: cssOf(label.colour)});
    }
    const camera = this.orbit.camera;
    const perPixel = (2 * this.orbit.distance * Math.tan((camera.fov * Math.PI) / 360)) / pen.h;
    const bar_m = roundDown125(90 * perPixel);
    if (!this.look.hasNoBar) pen.scaleBar(14, pen.h - 16, bar_m / perPixel, bar_m < 0.1 ? `${num(1e3 * bar_m, 2)} mm` : `${num(bar_m, 2)} m`);
    if (this.look.note) pen.text(this.look.note, pen.w - 12, pen.h - 16, {align: 'right', size: 11, colour: pen.c.soft});
  }
  private collect(pen: Pen): void {
    for (const face of this.world.faces) {
      if (!face.touch) continue;
      const places = face.places.map((p) => this.project(p, pen));
      const depth = places.reduce((sum, p) => sum + p[2], 0) / places.length;
      if (depth < 1) this.polygons.push({places: places.map(([x, y]) => [x, y]), depth, touch: face.touch});
    }
    this.polygons.sort((a, b) => a.depth - b.depth);
    for (const dot of this.world.dots) {
      if (!dot.touch) continue;
      const [x, y, depth] = this.project(dot.at, pen);
      if (depth < 1) pen.hit({x, y, r: dot.size / 2, ...dot.touch});
    }
  }
  private under(x: number, y: number): Touch | null {
    return this.polygons.find((polygon) => holds(polygon.places, x, y))?.touch ?? null;
  }

  private listen(): void {
    const canvas = this.chart.canvas;
    let down: {x: number; y: number; isPan: boolean} | null = null, moved = 0, frame = 0;
    const later = () => {
      frame ||= requestAnimationFrame(() => ((frame = 0), this.chart.redraw()));
    };
    canvas.tabIndex = 0;
    canvas.addEventListener('pointerdown', (event) => {
      down = {x: event.clientX, y: event.clientY, isPan: event.shiftKey || event.button === 2};
      moved = 0;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener('pointermove', (event) => {
      if (!down) return;
      const dx = event.clientX - down.x, dy = event.clientY - down.y;
      moved += Math.abs(dx) + Math.abs(dy);
      if (down.isPan) this.orbit.pan(dx, dy, this.chart.box.clientHeight);
      else this.orbit.rotate(dx, dy);
      down.x = event.clientX, down.y = event.clientY;
      later();
    });
    canvas.addEventListener('pointerup', () => (down = null));
    canvas.addEventListener('click', (event) => moved > 4 && event.stopImmediatePropagation(), true);
    canvas.addEventListener('contextmenu', (event) => event.preventDefault());
    canvas.addEventListener('dblclick', () => this.reset());
    // Only after a click: a page that scrolls must not be caught by a figure.
    canvas.addEventListener('wheel', (event) => {
      if (document.activeElement !== canvas && !event.ctrlKey) return;
      event.preventDefault();
      this.orbit.zoom(Math.exp(event.deltaY * 0.001));
      later();
    }, {passive: false});
  }
}

function holds(places: [number, number][], x: number, y: number): boolean {
  let isInside = false;
  for (let i = 0, j = places.length - 1; i < places.length; j = i++) {
    const [xi, yi] = places[i]!, [xj, yj] = places[j]!;
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) isInside = !isInside;
  }
  return isInside;
}
