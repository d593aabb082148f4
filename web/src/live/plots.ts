// Values over time while they come: which plots each command has, and how they follow the rows.
import {bandAboutZero, bandOf, SeriesPlot, type Level, type Line, type SeriesLook} from '../core/series';
import type {ColourName} from '../core/colours';
import {el} from '../core/dom';
import {degrees, num, withSigma} from '../core/format';
import {chi2Quantile, quantile, scaled, z95} from '../core/stats';
import type {Rows} from './rows';

export interface PlotLine {
  column: string;
  name: string;
  colour: ColourName;
  dash?: number[];
  width?: number;
  isDots?: boolean;
  only?: string; // drawn where this column is 1; with '!' before it: where it is 0
}
export interface Plot {
  label: string;
  unit: string;
  lines: PlotLine[];
  scale?: number;
  sigma?: string; // 3σ of the first line,
  isAboutZero?: boolean; // about zero instead of about the line
  dof?: string | number; // of a NIS: its 95 % band, and the ratio instead of the value
  levels?: Level[];
  height?: number;
}
export interface PlotCard {
  id: string;
  title: string;
  note: string;
  span: number;
  isPerHead?: boolean;
  isGrid?: boolean;
  plots: Plot[];
  good?: string;
}

const axes = [['x', 'orange'], ['y', 'green'], ['z', 'blue']] as const;
const degreePlot = (axis: string): Plot => ({label: axis, unit: '°', scale: degrees, lines: [
  {column: `asked_${axis}_rad`, name: 'asked', colour: 'ink', dash: [5, 4], width: 1.2}, {column: `measured_${axis}_rad`, name: 'measured', colour: 'blue'},
  {column: `predicted_${axis}_rad`, name: 'predicted', colour: 'orange', width: 1.1}]});
const sightPlot = (axis: string): Plot => ({label: `innovation ${axis}`, unit: 'px', sigma: `sigma_innovation_${axis}_px`, isAboutZero: true, levels: [{value: 0, dash: []}], lines: [
  {column: `innovation_${axis}_px`, name: 'used', colour: 'blue', isDots: true, only: 'accepted'}, {column: `innovation_${axis}_px`, name: 'rejected', colour: 'red', isDots: true, only: '!accepted'}]});
const nis = (dof: string | number): Plot => ({label: 'NIS over its degrees of freedom: 1 is expected', unit: '', dof, levels: [{value: 1}], height: 150, lines: [{column: 'nis', name: 'NIS / dof', colour: 'blue', isDots: true}]});

export const plotsOf: Record<string, PlotCard[]> = {
  track: [
    {id: 'position', title: 'Where is it?', note: 'm, ± 3σ', span: 12, plots: axes.map(([axis, colour]) => ({label: axis, unit: 'm', sigma: `sigma_target_in_world_${axis}_m`, lines: [
      {column: `target_in_world_${axis}_m`, name: axis, colour}, {column: `truth_${axis}_m`, name: 'truth', colour: 'ink', dash: [5, 4], width: 1.2}]}))},
    {id: 'innovations', title: 'Does each observation fit?', note: 'innovation, px, ± 3σ; rejected: red', span: 12, isPerHead: true, plots: [sightPlot('u'), sightPlot('v'), nis(2)]},
  ],
  servo: [
    {id: 'error', title: 'How far from the centre is the target?', note: 'px, ± 3σ predicted', span: 12, isPerHead: true, plots: (['u', 'v'] as const).map((axis) => ({label: `error ${axis}`, unit: 'px', sigma: `sigma_error_${axis}_px`, isAboutZero: true, levels: [{value: 0, dash: []}], height: 170,
      lines: [{column: `error_${axis}_px`, name: `error ${axis}`, colour: axis === 'u' ? 'blue' : 'orange', width: 1.3}]}))},
    {id: 'angles', title: 'Does the head follow?', note: 'asked - - · measured (blue) · predicted (orange), °', span: 12, isPerHead: true, plots: [{...degreePlot('pan'), height: 170}, {...degreePlot('tilt'), height: 170}]},
  ],
  head: [
    {id: 'error', title: 'How far from the centre is the target?', note: 'px, from the principal point', span: 12, plots: (['u', 'v'] as const).map((axis) => ({label: `error ${axis}`, unit: 'px', levels: [{value: 0, dash: []}], height: 190,
      lines: [{column: `error_${axis}_px`, name: `error ${axis}`, colour: axis === 'u' ? 'blue' : 'orange', width: 1.3}]}))},
    {id: 'angles', title: 'Does the head follow?', note: 'asked - - · reached (blue) · the target (orange), °', span: 24, plots: (['pan', 'tilt'] as const).map((axis) => ({label: axis, unit: '°', scale: degrees, height: 150, lines: [
      {column: `asked_${axis}_rad`, name: 'asked', colour: 'ink', dash: [5, 4], width: 1.2}, {column: `measured_${axis}_rad`, name: 'measured', colour: 'blue'}, {column: `target_${axis}_rad`, name: 'target', colour: 'orange', width: 1.1}]}))},
  ],
  observe: [
    {id: 'intrinsics', title: 'What are fx, fy, cx and cy, and how sure is it?', note: 'px, ± 3σ', span: 24, isGrid: true, plots: ['fx', 'fy', 'cx', 'cy'].map((name) => ({label: name, unit: 'px', sigma: `sigma_${name}_px`, height: 190, lines: [
      {column: `${name}_px`, name, colour: 'blue' as const}, {column: `truth_${name}_px`, name: 'truth', colour: 'ink' as const, dash: [5, 4], width: 1.2}]}))},
    {id: 'nis', title: 'Does each frame fit?', note: 'NIS with its 95 % band', span: 12, plots: [{...nis('nis_dof'), height: 200}]},
    {id: 'motion', title: 'How does it turn?', note: '°/s', span: 12, plots: [{label: 'rate', unit: '°/s', scale: degrees, height: 200, lines: axes.map(([axis, colour]) => ({column: `omega_${axis}_rad_per_s`, name: axis, colour}))}]},
  ],
  localize: [
    {id: 'position', title: 'Where is the camera?', note: 'm, ± 3σ', span: 12, plots: axes.map(([axis, colour]) => ({label: axis, unit: 'm', sigma: `sigma_world_from_cam_${axis}_m`, lines: [
      {column: `world_from_cam_${axis}_m`, name: axis, colour}, {column: `truth_${axis}_m`, name: 'truth', colour: 'ink' as const, dash: [5, 4], width: 1.2}]}))},
    {id: 'tracks', title: 'Are points kept, and is it fast enough?', note: 'used (blue) · seen - - · rejected (red)', span: 12, plots: [
      {label: 'points', unit: '', lines: [{column: 'num_tracked', name: 'used', colour: 'blue'}, {column: 'num_seen', name: 'seen', colour: 'soft', dash: [4, 3]}, {column: 'num_gated', name: 'rejected', colour: 'red'}]},
      {label: 'NIS over its degrees of freedom: 1 is expected', unit: '', levels: [{value: 1}], lines: [{column: 'nis', name: 'NIS / dof', colour: 'blue', isDots: true}]},
      {label: 'time a frame', unit: 'ms', scale: 1e3, lines: [{column: 'seconds', name: 'ms', colour: 'blue', isDots: true}]}]},
  ],
};

const maxPoints = 900; // more than pixels across, mostly

/** A plot that follows rows. */
export class LivePlot {
  private readonly series: SeriesPlot;

  constructor(host: HTMLElement, private readonly plot: Plot, private readonly rows: () => Rows | null, hasTime: boolean) {
    const lines: Line[] = plot.lines.map((line) => ({name: line.name, values: [], colour: line.colour, dash: line.dash, width: line.width, isDots: line.isDots, size: 4}));
    const look: SeriesLook = {t: [], lines, bands: [], levels: plot.levels, label: plot.unit ? `${plot.label}, ${plot.unit}` : plot.label, xLabel: hasTime ? 'time, s' : '', height: (plot.height ?? 108) + (hasTime ? 26 : 0),
      isFilling: true, isLog: plot.dof !== undefined, aria: `${plot.label}, live`};
    this.series = new SeriesPlot(host, look);
  }
  follow(span: [number, number]): void {
    const rows = this.rows();
    if (!rows || rows.count === 0) return;
    const first = Math.max(0, rows.from(span[0]) - 1), every = Math.ceil((rows.count - first) / maxPoints), plot = this.plot, factor = plot.scale ?? 1;
    const column = (name: string) => scaled(rows.slice(name, first, every), factor);
    const t = rows.slice('', first, every), values = plot.lines.map((line) => this.valuesOf(line, rows, first, every, column));
    const sigma = plot.sigma ? column(plot.sigma) : null, bands = [];
    if (sigma) bands.push(plot.isAboutZero ? bandAboutZero(sigma, 'blue') : bandOf(values[0]!, sigma, plot.lines[0]!.colour));
    if (plot.dof !== undefined) bands.push(this.boundsOf(t.length, rows, first, every));
    this.series.renew({t, lines: plot.lines.map((line, k) => ({name: line.name, values: values[k]!, colour: line.colour, dash: line.dash, width: line.width, isDots: line.isDots, size: 4})), bands, range: this.rangeOf(values, sigma), aside: this.says(rows)}, span);
  }
  private valuesOf(line: PlotLine, rows: Rows, first: number, every: number, column: (name: string) => Float64Array): Float64Array {
    let values = column(line.column);
    if (this.plot.dof !== undefined) {
      const dof = this.dofs(values.length, rows, first, every);
      values = values.map((v, i) => v / dof[i]!);
    }
    if (!line.only) return values;
    const wanted = line.only.startsWith('!') ? 0 : 1, flag = rows.slice(line.only.replace('!', ''), first, every);
    return values.map((v, i) => (flag[i] === wanted ? v : NaN));
  }
  private dofs(count: number, rows: Rows, first: number, every: number): Float64Array {
    return typeof this.plot.dof === 'number' ? new Float64Array(count).fill(this.plot.dof) : rows.slice(String(this.plot.dof), first, every);
  }
  private boundsOf(count: number, rows: Rows, first: number, every: number) {
    const dof = this.dofs(count, rows, first, every), bound = (z: number) => dof.map((d) => (d >= 1 ? chi2Quantile(d, z) / d : NaN));
    return {low: bound(-z95), high: bound(z95), colour: 'blue' as const, opacity: 0.18};
  }
  private rangeOf(values: Float64Array[], sigma: Float64Array | null): [number, number] | undefined {
    if (this.plot.dof !== undefined) return [0.05, Math.max(5, 1.3 * quantile(values[0]!, 0.98) || 0)];
    if (!sigma) return undefined;
    const three = 3 * quantile(sigma, 0.8), all = values.flatMap((one) => Array.from(one.filter(Number.isFinite)));
    if (all.length === 0) return undefined;
    const low = quantile(all, 0.01), high = quantile(all, 0.99);
    if (this.plot.isAboutZero) {
      const limit = 1.15 * Math.max(Math.abs(low), Math.abs(high), three || 0) || 1;
      return [-limit, limit];
    }
    const margin = 0.1 * (high - low) + (three || 0);
    return margin > 0 ? [low - margin, high + margin] : undefined;
  }
  private says(rows: Rows): string {
    const {plot} = this, factor = plot.scale ?? 1, value = rows.newest(plot.lines[0]!.column) * factor;
    if (plot.dof !== undefined || !Number.isFinite(value)) return '';
    if (plot.lines.some((line) => line.name === 'asked')) return `asked ${num(value, 4)}, measured ${num(rows.newest(plot.lines[1]!.column) * factor, 4)} ${plot.unit}`;
    return plot.sigma && !plot.isAboutZero ? withSigma(value, rows.newest(plot.sigma) * factor, plot.unit) : `${num(value, 3)} ${plot.unit}`;
  }
}

/** A card's plots under one another, or two by two. */
export function livePlots(host: HTMLElement, card: PlotCard, rows: () => Rows | null): LivePlot[] {
  const grid = card.isGrid ? el('div', {class: 'grid2'}) : null;
  if (grid) host.append(grid);
  return card.plots.map((plot, k) => {
    const part = grid ? grid.appendChild(el('div')) : host;
    return new LivePlot(part, plot, rows, grid ? k >= card.plots.length - 2 : k === card.plots.length - 1);
  });
}
