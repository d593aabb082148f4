// What a head's camera sees: its newest image, where there is one, and the marks over it.
import {Chart, type Pen} from '../core/chart';
import type {Message} from './connection';
import type {Calibration} from './space';

interface Xy {x: number; y: number}
interface Rgba {r: number; g: number; b: number; a: number}
interface Marks {
  circles: {position: Xy; diameter: number; fill_color: Rgba}[];
  points: {points: Xy[]; outline_color: Rgba}[];
}
const css = (c: Rgba) => `rgba(${Math.round(255 * c.r)},${Math.round(255 * c.g)},${Math.round(255 * c.b)},${c.a})`;

export class LiveImage {
  private readonly chart: Chart;
  private marks: Marks | null = null;
  private image: ImageBitmap | null = null;
  private isDecoding = false;
  camera: Calibration | null = null;

  constructor(host: HTMLElement, name: string) {
    this.chart = new Chart(host, {height: 200, isFilling: true, label: `what ${name} sees`}, (pen) => this.draw(pen));
  }
  takeMarks(message: Message): void {
    this.marks = message as unknown as Marks;
  }
  /** One at a time: those that come meanwhile are older than the next. */
  async takeImage(message: Message): Promise<void> {
    if (this.isDecoding) return;
    this.isDecoding = true;
    try {
      const bytes = Uint8Array.from(atob(String(message['data'])), (c) => c.charCodeAt(0));
      const image = await createImageBitmap(new Blob([bytes], {type: 'image/jpeg'}));
      this.image?.close();
      this.image = image;
    } catch {
      // not an image: the one before stays
    }
    this.isDecoding = false;
  }
  redraw(): void {
    this.chart.redraw();
  }

  private draw(pen: Pen): void {
    const width = this.image?.width ?? this.camera?.width ?? 0, height = this.image?.height ?? this.camera?.height ?? 0;
    pen.rect(0, 0, pen.w, pen.h, pen.c.panel);
    if (!(width > 0 && height > 0)) return pen.text('no image yet', pen.w / 2, pen.h / 2, {align: 'center', colour: pen.c.soft});
    const s = Math.min(pen.w / width, pen.h / height) * 0.98, left = (pen.w - s * width) / 2, top = (pen.h - s * height) / 2;
    // The middle of the top left pixel is (0, 0).
    const x = (u: number) => left + s * (u + 0.5), y = (v: number) => top + s * (v + 0.5);
    if (this.image) pen.g.drawImage(this.image, left, top, s * width, s * height);
    else pen.rect(left, top, s * width, s * height, pen.c.card);
    pen.rect(left, top, s * width, s * height, null, pen.c.soft);
    if (!this.image) pen.line(x(width / 2) - 7, y(height / 2), x(width / 2) + 7, y(height / 2), pen.c.soft), pen.line(x(width / 2), y(height / 2) - 7, x(width / 2), y(height / 2) + 7, pen.c.soft);
    pen.clipped(left, top, s * width, s * height, () => {
      for (const loop of this.marks?.points ?? []) pen.path(loop.points.flatMap((p) => [x(p.x), y(p.y)]), css(loop.outline_color), 2, [], true);
      for (const dot of this.marks?.circles ?? []) pen.circle(x(dot.position.x), y(dot.position.y), Math.max(3, (s * dot.diameter) / 2), css(dot.fill_color));
    });
  }
}
