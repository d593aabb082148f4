// A canvas that is drawn again for each size, theme and for paper, and that knows what lies under the pointer.
import {palette, type Palette} from './colours';
import {el} from './dom';
import {hideTip, showTip} from './tip';

export interface TextLook {
  align?: CanvasTextAlign;
  colour?: string;
  size?: number;
  weight?: number;
  box?: string; // filled behind
  turn?: number; // radians
}

/** Something that the pointer can find: a disc (r) or a box (w, h) around x, y. */
export interface Hit {
  x: number;
  y: number;
  r?: number;
  w?: number;
  h?: number;
  tip: () => string[];
  pick?: () => void;
}

const family = 'system-ui, "DejaVu Sans", "Segoe UI", sans-serif';

export class Pen {
  readonly hits: Hit[] = [];
  constructor(readonly g: CanvasRenderingContext2D, readonly w: number, readonly h: number, readonly c: Palette) {}

  hit(one: Hit): void {
    this.hits.push(one);
  }
  line(x1: number, y1: number, x2: number, y2: number, colour: string, width = 1, dash: number[] = []): void {
    this.path([x1, y1, x2, y2], colour, width, dash);
  }
  /** x, y, x, y, …; broken at NaN. */
  path(places: ArrayLike<number>, colour: string, width = 1.5, dash: number[] = [], isClosed = false): void {
    this.trace(places, isClosed);
    this.g.strokeStyle = colour;
    this.g.lineWidth = width;
    this.g.setLineDash(dash);
    this.g.stroke();
    this.g.setLineDash([]);
  }
  fill(places: ArrayLike<number>, colour: string): void {
    this.trace(places, true);
    this.g.fillStyle = colour;
    this.g.fill();
  }
  private trace(places: ArrayLike<number>, isClosed: boolean): void {
    this.g.beginPath();
    let isDown = false;
    for (let i = 0; i + 1 < places.length; i += 2) {
      const x = places[i]!, y = places[i + 1]!;
      if (!Number.isFinite(x) || !Number.isFinite(y)) isDown = false;
      else if (isDown) this.g.lineTo(x, y);
      else this.g.moveTo(x, y), (isDown = true);
    }
    if (isClosed) this.g.closePath();
  }
  rect(x: number, y: number, w: number, h: number, fill: string | null, stroke: string | null = null, width = 1): void {
    if (fill) this.g.fillStyle = fill, this.g.fillRect(x, y, w, h);
    if (stroke) this.g.strokeStyle = stroke, (this.g.lineWidth = width), this.g.strokeRect(x, y, w, h);
  }
  circle(x: number, y: number, r: number, fill: string | null, stroke: string | null = null, width = 1.5): void {
    this.g.beginPath();
    this.g.arc(x, y, Math.max(0, r), 0, 7);
    if (fill) this.g.fillStyle = fill, this.g.fill();
    if (stroke) this.g.strokeStyle = stroke, (this.g.lineWidth = width), this.g.stroke();
  }
  cross(x: number, y: number, r: number, colour: string, width = 1.5): void {
    this.line(x - r, y - r, x + r, y + r, colour, width);
    this.line(x - r, y + r, x + r, y - r, colour, width);
  }
  arrow(x1: number, y1: number, x2: number, y2: number, colour: string, width = 1.4, head = 5): void {
    const length = Math.hypot(x2 - x1, y2 - y1);
    if (!(length > 0.3)) return;
    const size = Math.min(head, 0.6 * length), dx = (x2 - x1) / length, dy = (y2 - y1) / length;
    this.line(x1, y1, x2, y2, colour, width);
    this.path([x2 - size * (dx + 0.5 * dy), y2 - size * (dy - 0.5 * dx), x2, y2,
      x2 - size * (dx - 0.5 * dy), y2 - size * (dy + 0.5 * dx)], colour, width);
  }
  font(size: number, weight = 400): string {
    return `${weight} ${size}px ${family}`;
  }
  width(text: string, size = 12, weight = 400): number {
    this.g.font = this.font(size, weight);
    return this.g.measureText(text).width;
  }
  text(text: string, x: number, y: number, look: TextLook = {}): void {
    const size = look.size ?? 12, align = look.align ?? 'left', g = this.g;
    g.font = this.font(size, look.weight);
    g.textBaseline = 'middle';
    g.textAlign = align;
    if (look.box) {
      const w = g.measureText(text).width + 8, left = align === 'center' ? x - w / 2 : align === 'right' ? x - w + 4 : x - 4;
      this.rect(left, y - size * 0.75, w, size * 1.5, look.box);
    }
    g.fillStyle = look.colour ?? this.c.ink;
    if (look.turn) {
      g.save();
      g.translate(x, y);
      g.rotate(look.turn);
      g.fillText(text, 0, 0);
      g.restore();
    } else {
      g.fillText(text, x, y);
    }
  }
  clipped(x: number, y: number, w: number, h: number, draw: () => void): void {
    this.g.save();
    this.g.beginPath();
    this.g.rect(x, y, w, h);
    this.g.clip();
    draw();
    this.g.restore();
  }
  /** A bar of so many units with words, as on a map. */
  scaleBar(x: number, y: number, length: number, words: string, isOnImage = false): void {
    const colour = isOnImage ? '#fff' : this.c.ink;
    if (isOnImage) this.rect(x - 8, y - 12, length + this.width(words, 11.5) + 22, 24, 'rgba(20,24,29,.78)');
    this.line(x, y, x + length, y, colour, 2);
    this.line(x, y - 4, x, y + 4, colour, 1.5);
    this.line(x + length, y - 4, x + length, y + 4, colour, 1.5);
    this.text(words, x + length + 7, y, {size: 11.5, colour});
  }
}

export interface ChartLook {
  height: number; // px at least
  aspect?: number; // height / width instead of a fixed height
  most?: number; // px, of a height by aspect
  isFilling?: boolean; // grows with its card
  label?: string;
}

/** All charts of the page, to be drawn again when the theme changes or for paper. */
export const charts = new Set<Chart>();

export class Chart {
  readonly box: HTMLDivElement;
  readonly canvas: HTMLCanvasElement;
  hits: Hit[] = [];
  /** What is under a place where no hit lies. */
  hover: ((x: number, y: number) => string[] | null) | null = null;
  pick: ((x: number, y: number) => void) | null = null;
  private shown: Hit | null = null;
  private ratio = 0; // of paper; 0: of the screen

  constructor(host: HTMLElement, private readonly look: ChartLook, private readonly draw: (pen: Pen) => void) {
    this.canvas = el('canvas', {role: 'img', 'aria-label': look.label});
    this.box = el('div', {class: look.isFilling ? 'chart filling' : 'chart'}, this.canvas);
    host.append(this.box);
    charts.add(this);
    let width = 0, height = 0;
    new ResizeObserver(() => {
      const w = this.box.clientWidth;
      if (look.aspect) this.box.style.height = `${this.heightFor(w)}px`;
      if (w === width && this.box.clientHeight === height) return;
      width = w, height = this.box.clientHeight;
      this.redraw();
    }).observe(this.box);
    this.box.style.minHeight = `${look.height}px`;
    this.canvas.addEventListener('pointermove', (event) => this.point(event));
    this.canvas.addEventListener('pointerleave', () => (hideTip(), (this.shown = null)));
    this.canvas.addEventListener('click', (event) => this.click(event));
  }
  private heightFor(width: number): number {
    return Math.round(Math.min(this.look.most ?? 1e4, Math.max(this.look.height, width * (this.look.aspect ?? 0))));
  }
  set label(words: string) {
    this.canvas.setAttribute('aria-label', words);
  }

  redraw(): void {
    const w = this.box.clientWidth, h = this.box.clientHeight;
    if (w < 10 || h < 10) return;
    const ratio = this.ratio || Math.min(3, window.devicePixelRatio || 1);
    this.canvas.width = Math.round(w * ratio);
    this.canvas.height = Math.round(h * ratio);
    const g = this.canvas.getContext('2d');
    if (!g) return;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, w, h);
    g.lineJoin = 'round';
    const pen = new Pen(g, w, h, palette());
    this.draw(pen);
    this.hits = pen.hits;
  }
  /** Drawn finer, for paper. */
  redrawFor(ratio: number): void {
    this.ratio = ratio;
    if (this.look.aspect && ratio) this.box.style.height = `${this.heightFor(this.box.clientWidth)}px`;
    this.redraw();
  }

  find(x: number, y: number): Hit | null {
    let best: Hit | null = null, nearest = Infinity;
    for (const hit of this.hits) {
      if (hit.w !== undefined) {
        if (Math.abs(x - hit.x) > hit.w / 2 || Math.abs(y - hit.y) > (hit.h ?? hit.w) / 2 || nearest < 1e3) continue;
        best = hit;
      } else {
        const distance = Math.hypot(x - hit.x, y - hit.y);
        if (distance <= Math.max(6, (hit.r ?? 4) + 3) && distance < nearest) best = hit, (nearest = distance);
      }
    }
    return best;
  }
  private place(event: PointerEvent | MouseEvent): [number, number] {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }
  private point(event: PointerEvent): void {
    const [x, y] = this.place(event), hit = this.find(x, y);
    const lines = hit ? hit.tip() : (this.hover?.(x, y) ?? null);
    this.canvas.style.cursor = hit?.pick || (!hit && this.pick && lines) ? 'pointer' : '';
    if (lines && lines.length > 0) showTip(lines, event.clientX, event.clientY);
    else if (this.shown || !hit) hideTip();
    this.shown = hit;
  }
  private click(event: MouseEvent): void {
    const [x, y] = this.place(event), hit = this.find(x, y);
    if (hit?.pick) hit.pick();
    else this.pick?.(x, y);
  }
}
