// Values over time (or another growing number): uPlot with bands, levels, events, and one cursor and zoom for all.
import uPlot from 'uplot';
import {faded, palette, type ColourName} from './colours';
import {el} from './dom';
import {num} from './format';
import {scale, ticksOf} from './scale';
import type {Selection} from './selection';
import {scaled} from './stats';
import {hideTip, showTip} from './tip';

type Values = ArrayLike<number>;

export interface Line {
  spansGaps?: boolean; // known at some times only
  name: string;
  values: Values;
  colour: ColourName;
  width?: number;
  dash?: number[];
  isDots?: boolean;
  size?: number; // of dots
  isSteps?: boolean;
  isQuiet?: boolean; // has no line in the tip
}
export interface Band {
  low: Values;
  high: Values;
  colour: ColourName;
  opacity?: number;
}
export interface Level {
  value: number;
  words?: string;
  colour?: ColourName;
  dash?: number[];
}
export interface EventMark {
  t: number;
  words: string;
}

export interface SeriesLook {
  t: Values;
  lines: Line[];
  bands?: Band[];
  levels?: Level[];
  events?: EventMark[];
  spans?: {from: number; to: number}[];
  label: string; // above the plot
  aside?: string; // at its right
  xLabel?: string; // empty: a plot below has it
  xUnit?: string;
  isLog?: boolean;
  range?: [number, number];
  height: number;
  isFilling?: boolean;
  selection?: Selection;
  syncKey?: string; // '' : none
  tip?: (index: number) => string[];
  digits?: number;
  aria: string;
}

/** Value − 3σ and value + 3σ. */
export function bandOf(values: Values, sigma: Values, colour: ColourName): Band {
  const three = scaled(sigma, 3);
  return {low: Float64Array.from(values, (v, i) => v - three[i]!), high: Float64Array.from(values, (v, i) => v + three[i]!), colour};
}
/** −3σ and +3σ about zero. */
export function bandAboutZero(sigma: Values, colour: ColourName): Band {
  return {low: scaled(sigma, -3), high: scaled(sigma, 3), colour};
}

export const seriesPlots = new Set<SeriesPlot>();
export const maxMarks = 16; // events in sight, each a line through the plot
const font = '11px system-ui, "DejaVu Sans", sans-serif';

export class SeriesPlot {
  readonly box: HTMLDivElement;
  readonly plot: uPlot;
  private readonly look: SeriesLook;
  private readonly aside: HTMLElement;

  constructor(host: HTMLElement, look: SeriesLook) {
    this.look = look;
    this.box = el('div', {class: look.isFilling ? 'series filling' : 'series', style: `min-height:${look.height}px`});
    this.aside = el('span', {}, look.aside ?? '');
    const head = el('p', {class: 'series-head'}, el('b', {}, look.label), this.aside);
    host.append(el('div', {class: look.isFilling ? 'series-outer filling' : 'series-outer', role: 'img', 'aria-label': look.aria}, head, this.box));
    this.plot = new uPlot(this.options(), this.data(), this.box);
    this.plot.over.addEventListener('mousemove', (event) => this.showTip(event));
    this.plot.over.addEventListener('mouseleave', () => hideTip());
    this.plot.over.addEventListener('click', () => {
      const index = this.plot.cursor.idx;
      if (index !== null && index !== undefined) look.selection?.at(look.t[index]!);
    });
    new ResizeObserver(() => this.fit()).observe(this.box);
    look.selection?.on(() => this.plot.redraw(false));
    seriesPlots.add(this);
  }
  private data(): uPlot.AlignedData {
    const nulls = (values: Values) => Array.from(values, (v) => (Number.isFinite(v) && (!this.look.isLog || v > 0) ? v : null));
    return [Array.from(this.look.t), ...this.look.lines.map((line) => nulls(line.values))] as uPlot.AlignedData;
  }
  /** Other values in the same plot, while a run is live. As many lines as before; `span`: of time. */
  renew(look: Pick<SeriesLook, 't' | 'lines' | 'bands' | 'range' | 'aside'>, span: [number, number]): void {
    Object.assign(this.look, look);
    this.aside.textContent = look.aside ?? '';
    this.plot.batch(() => {
      this.plot.setData(this.data(), false);
      this.plot.setScale('x', {min: span[0], max: span[1]});
    });
  }
  fit(): void {
    const w = this.box.clientWidth, h = Math.max(this.look.height, this.box.clientHeight);
    if (w > 20 && (w !== this.plot.width || h !== this.plot.height)) this.plot.setSize({width: w, height: h});
  }
  redraw(): void {
    this.plot.redraw(false, true);
  }
  reset(): void {
    const t = this.look.t;
    if (t.length > 1) this.plot.setScale('x', {min: t[0]!, max: t[t.length - 1]!});
  }

  private options(): uPlot.Options {
    const look = this.look, hasX = look.xLabel !== '';
    const stroke = () => palette().soft, grid = {stroke: () => palette().grid, width: 1};
    const ticks = {stroke: () => palette().grid, width: 1, size: 4};
    const write = (_: uPlot, values: number[]) => values.map((v) => (v === null || v === undefined ? '' : num(v, 4)));
    return {
      width: Math.max(60, this.box.clientWidth), height: look.height,
      legend: {show: false},
      padding: [8, 18, hasX ? 0 : 6, 0],
      cursor: {drag: {x: true, y: false}, focus: {prox: 1e6}, points: {size: 7},
        ...(look.syncKey === '' ? {} : {sync: {key: look.syncKey ?? 'time'}})},
      scales: {x: {time: false}, y: {distr: look.isLog ? 3 : 1, range: (_, low, high) => this.rangeOf(low, high)}},
      axes: [
        {show: true, stroke, font, grid, ticks, values: hasX ? write : (_, v) => v.map(() => ''), size: hasX ? 26 : 6,
          label: look.xLabel || undefined, labelFont: font, labelSize: 16, labelGap: 0, space: 55},
        {stroke, font, grid, ticks, size: 54,
          splits: (u, __, low, high) => ticksOf(scale(low, high, 0, 1, look.isLog), Math.max(4, (u.bbox?.height || 200) / (devicePixelRatio || 1) / 26)),
          filter: (u, splits) => apart(u, splits), values: (_, v) => v.map((one) => (one === null || one === undefined ? '' : num(one, 5)))},
      ],
      series: [{}, ...look.lines.map((line) => this.seriesOf(line))],
      hooks: {drawAxes: [(u) => this.under(u)], draw: [(u) => this.over(u)]},
    };
  }
  private seriesOf(line: Line): uPlot.Series {
    const stroke = () => palette()[line.colour];
    if (line.isDots)
      return {stroke, paths: () => null, points: {show: true, size: line.size ?? 3, fill: stroke, stroke, width: 0}};
    return {stroke, width: line.width ?? 1.6, dash: line.dash, points: {show: false}, spanGaps: line.spansGaps ?? false,
      ...(line.isSteps ? {paths: uPlot.paths.stepped!({align: 1})} : {})};
  }
  private rangeOf(low: number, high: number): [number, number] {
    const {range, isLog} = this.look;
    if (range) return range;
    if (!Number.isFinite(low) || !Number.isFinite(high)) return isLog ? [0.1, 10] : [-1, 1];
    if (isLog) return [low / 1.5, high * 1.5];
    const margin = 0.07 * (high - low) || Math.abs(high) * 0.05 || 1;
    return [low - margin, high + margin];
  }
  private under(u: uPlot): void {
    const g = u.ctx, {left, top, width, height} = u.bbox, c = palette();
    g.save();
    g.beginPath();
    g.rect(left, top, width, height);
    g.clip();
    for (const span of this.look.spans ?? []) {
      const from = u.valToPos(span.from, 'x', true), to = u.valToPos(span.to, 'x', true);
      g.fillStyle = faded(c.orange, c.isDark ? 0.2 : 0.14);
      g.fillRect(from, top, to - from, height);
    }
    for (const band of this.look.bands ?? []) this.drawBand(u, band);
    if (!this.hasLane(u))
      for (const event of this.look.events ?? []) {
        const x = u.valToPos(event.t, 'x', true);
        stroke(g, [x, top, x, top + height], c.orange, 1, [2, 3]);
      }
    g.restore();
  }
  /** Many events stand in a lane of their own above the plot, as ticks: lines through it would hide what it shows. */
  private hasLane(u: uPlot): boolean {
    const {min, max} = u.scales['x']!, events = this.look.events ?? [];
    return events.length > maxMarks && events.filter((one) => one.t >= min! && one.t <= max!).length > maxMarks;
  }
  private drawBand(u: uPlot, band: Band): void {
    const t = this.look.t, g = u.ctx;
    const y = (value: number) => u.valToPos(this.look.isLog ? Math.max(value, u.scales['y']!.min! * 0.5) : value, 'y', true);
    g.fillStyle = faded(palette()[band.colour], band.opacity ?? 0.22);
    const [first, last] = [this.rowAt(u.scales['x']!.min!, -1), this.rowAt(u.scales['x']!.max!, 1)];
    for (let i = first; i <= last;) {
      while (i <= last && !Number.isFinite(band.low[i]! + band.high[i]!)) ++i;
      const begin = i;
      while (i <= last && Number.isFinite(band.low[i]! + band.high[i]!)) ++i;
      if (i - begin < 2) continue;
      g.beginPath();
      for (let k = begin; k < i; ++k) g.lineTo(u.valToPos(t[k]!, 'x', true), y(band.high[k]!));
      for (let k = i; k-- > begin;) g.lineTo(u.valToPos(t[k]!, 'x', true), y(band.low[k]!));
      g.fill();
    }
  }
  private rowAt(x: number, beyond: number): number {
    const t = this.look.t;
    let low = 0, high = t.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (t[middle]! < x) low = middle + 1;
      else high = middle;
    }
    return Math.min(t.length - 1, Math.max(0, low + beyond));
  }
  private over(u: uPlot): void {
    const g = u.ctx, {left, top, width, height} = u.bbox, c = palette(), ratio = devicePixelRatio || 1;
    for (const level of this.look.levels ?? []) {
      const y = u.valToPos(level.value, 'y', true);
      if (!(y >= top && y <= top + height)) continue;
      stroke(g, [left, y, left + width, y], c[level.colour ?? 'ink'], 1.2 * ratio, (level.dash ?? [5, 4]).map((d) => d * ratio));
      if (!level.words) continue;
      g.font = font.replace('11px', `${11 * ratio}px`);
      g.textAlign = 'right';
      g.textBaseline = y - top < 16 * ratio ? 'top' : 'bottom';
      g.fillStyle = c[level.colour ?? 'ink'];
      g.fillText(level.words, left + width - 4 * ratio, y + (y - top < 16 * ratio ? 3 : -2) * ratio);
    }
    g.fillStyle = c.orange;
    const hasLane = this.hasLane(u);
    let last = -Infinity;
    for (const event of this.look.events ?? []) {
      const x = u.valToPos(event.t, 'x', true);
      if (x < left || x > left + width) continue;
      if (hasLane) {
        if (x - last >= 2 * ratio) g.fillRect(x - 0.5 * ratio, top - 7 * ratio, ratio, 5 * ratio), (last = x);
        continue;
      }
      g.beginPath();
      g.moveTo(x - 4 * ratio, top - 6 * ratio);
      g.lineTo(x + 4 * ratio, top - 6 * ratio);
      g.lineTo(x, top);
      g.fill();
    }
    const time = this.look.selection?.time ?? NaN, x = u.valToPos(time, 'x', true);
    if (x >= left && x <= left + width) stroke(g, [x, top, x, top + height], c.red, 1.4 * ratio, []);
  }
  private showTip(event: MouseEvent): void {
    const index = this.plot.cursor.idx;
    if (index === null || index === undefined) return;
    const look = this.look, lines = look.tip ? look.tip(index) : look.lines.filter((line) => !line.isQuiet)
      .map((line) => `${line.name} ${num(line.values[index]!, look.digits ?? 5)}`);
    const near = (look.events ?? []).filter((one) => one.t === look.t[index]).map((one) => one.words);
    showTip([`${num(look.t[index]!, 6)} ${look.xUnit ?? 's'}`, ...lines, ...near], event.clientX, event.clientY);
  }
}

/** Labels that would touch are omitted; uPlot's own choice leaves short logarithmic axes without any. */
function apart(u: uPlot, splits: number[]): (number | null)[] {
  let last = NaN;
  return splits.map((value) => {
    const place = u.valToPos(value, 'y');
    if (Math.abs(place - last) < 13) return null;
    last = place;
    return value;
  });
}

function stroke(g: CanvasRenderingContext2D, [x1, y1, x2, y2]: [number, number, number, number], colour: string, width: number, dash: number[]): void {
  g.strokeStyle = colour;
  g.lineWidth = width;
  g.setLineDash(dash);
  g.beginPath();
  g.moveTo(x1, y1);
  g.lineTo(x2, y2);
  g.stroke();
  g.setLineDash([]);
}
