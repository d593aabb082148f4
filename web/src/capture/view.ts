// The camera's image with what is found on it and the outline to fill.
import {palette} from '../core/colours';
import {el} from '../core/dom';
import type {Look, State} from './messages';

const flash_ms = 350;

export class CameraView {
  readonly element: HTMLElement;
  /** The browser's camera, or a canvas for images from elsewhere. */
  readonly video: HTMLVideoElement | null;
  private readonly still: HTMLCanvasElement | null;
  private readonly over = el('canvas', {class: 'capture-over', 'aria-hidden': 'true'});
  private readonly words = el('p', {class: 'capture-none'});
  private look: Look | null = null;
  private state: State | null = null;
  private flashed_ms = -1e9;
  private isFinished = false;
  isMirrored = false;
  drawings = 0; // for tests

  constructor(hasVideo: boolean) {
    this.video = hasVideo ? el('video', {id: 'camera', muted: true, playsinline: true, 'aria-label': 'the camera’s image'}) : null;
    this.still = hasVideo ? null : el('canvas', {id: 'camera', role: 'img', 'aria-label': 'the camera’s image'});
    if (this.video) this.video.muted = true;
    this.element = el('div', {class: 'capture-image'}, this.video ?? this.still!, this.over, this.words);
    new ResizeObserver(() => this.draw()).observe(this.element);
  }
  say(words: string): void {
    this.words.textContent = words;
  }
  takeLook(look: Look): void {
    this.look = look;
    this.draw();
  }
  takeState(state: State): void {
    this.state = state;
    this.draw();
  }
  /** Neither outline nor corners any more. */
  finish(): void {
    this.isFinished = true;
    this.draw();
  }
  mirror(isMirrored: boolean): void {
    this.isMirrored = isMirrored;
    (this.video ?? this.still!).style.transform = isMirrored ? 'scaleX(-1)' : '';
    this.draw();
  }
  flash(): void {
    this.flashed_ms = performance.now();
    this.draw();
    setTimeout(() => this.draw(), flash_ms + 20);
  }
  async show(jpeg: Blob): Promise<void> {
    if (!this.still) return;
    const image = await createImageBitmap(jpeg);
    this.still.width = image.width;
    this.still.height = image.height;
    this.still.getContext('2d')!.drawImage(image, 0, 0);
    image.close();
    this.say('');
    this.draw();
  }

  private draw(): void {
    ++this.drawings;
    const size = this.look ?? this.state, ratio = devicePixelRatio || 1, colours = palette();
    if (size && size.width > 0) this.element.style.aspectRatio = `${size.width} / ${size.height}`;
    const w = this.element.clientWidth, h = this.element.clientHeight;
    this.over.width = Math.round(w * ratio);
    this.over.height = Math.round(h * ratio);
    const g = this.over.getContext('2d')!;
    if (this.isFinished || !size || !(size.width > 0)) return;
    const s = Math.min(w / size.width, h / size.height), left = (w - s * size.width) / 2, top = (h - s * size.height) / 2;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    const x = (u: number) => this.isMirrored ? w - left - s * (u + 0.5) : left + s * (u + 0.5), y = (v: number) => top + s * (v + 0.5);
    this.drawOutline(g, x, y);
    this.drawCorners(g, x, y, s);
    if (performance.now() - this.flashed_ms < flash_ms) {
      g.strokeStyle = colours.green;
      g.lineWidth = 14;
      g.strokeRect(7, 7, w - 14, h - 14);
    }
  }
  /** White under colour: seen on any image. */
  private drawOutline(g: CanvasRenderingContext2D, x: (u: number) => number, y: (v: number) => number): void {
    const outline = this.state?.next?.outline ?? [];
    if (outline.length < 6) return;
    g.beginPath();
    for (let i = 0; i + 1 < outline.length; i += 2) g.lineTo(x(outline[i]!), y(outline[i + 1]!));
    g.closePath();
    g.fillStyle = 'rgba(235,160,44,.16)';
    g.fill();
    for (const [colour, width, dash] of [['rgba(20,24,29,.75)', 6, []], ['#ffb43c', 3, [12, 7]]] as [string, number, number[]][]) {
      g.strokeStyle = colour;
      g.lineWidth = width;
      g.setLineDash(dash);
      g.stroke();
    }
    g.setLineDash([]);
  }
  private drawCorners(g: CanvasRenderingContext2D, x: (u: number) => number, y: (v: number) => number, s: number): void {
    const corners = this.look?.corners ?? [], radius = Math.max(2, Math.min(4, 3 * s));
    for (let i = 0; i + 1 < corners.length; i += 2) {
      g.beginPath();
      g.arc(x(corners[i]!), y(corners[i + 1]!), radius, 0, 7);
      g.fillStyle = '#46e0a6';
      g.fill();
      g.lineWidth = 1;
      g.strokeStyle = 'rgba(20,24,29,.8)';
      g.stroke();
    }
  }
}
