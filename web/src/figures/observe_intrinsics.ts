// What are fx, fy, cx and cy, and how sure is it? Each over time with ± 3σ and the truth; below it 3σ by itself.
import {el} from '../core/dom';
import {legend, type Figure, type Key} from '../core/figure';
import {num, percent, withSigma} from '../core/format';
import {bandOf, maxMarks, SeriesPlot, type Line} from '../core/series';
import {extent, quantile, scaled} from '../core/stats';
import {observeScene, type ObserveScene} from './observe_scene';

const names = ['fx', 'fy', 'cx', 'cy'];

interface Column {
  value: Float64Array; sigma: Float64Array; truth: Float64Array; bound: Float64Array;
}
function columnOf(scene: ObserveScene, name: string): Column {
  const c = (before: string) => scene.steps.numbers(`${before}${name}_px`);
  return {value: c(''), sigma: c('sigma_'), truth: c('truth_'), bound: c('bound_')};
}

/** What has settled, its truth included; what the search did before may lie outside. */
function rangeOf(c: Column): [number, number] | undefined {
  const usual = quantile(c.sigma, 0.5), settled = c.value.filter((_, i) => c.sigma[i]! < 10 * usual);
  const ends = extent(settled, c.truth);
  if (!ends) return undefined;
  const margin = Math.max(0.08 * (ends[1] - ends[0]), 4 * usual);
  return [ends[0] - margin, ends[1] + margin];
}

function drawOne(host: HTMLElement, scene: ObserveScene, name: string, c: Column, selection: Parameters<Figure['draw']>[2]): void {
  const last = c.value.length - 1 - [...c.value].reverse().findIndex(Number.isFinite), hasTruth = c.truth.some(Number.isFinite);
  const lines: Line[] = [{name, values: c.value, colour: 'blue'}];
  if (hasTruth) lines.push({name: 'truth', values: c.truth, colour: 'ink', dash: [5, 4], width: 1.3});
  const common = {t: scene.t, events: scene.events, spans: scene.zooms, selection};
  const says = last >= 0 && last < c.value.length ? withSigma(c.value[last]!, c.sigma[last]!, 'px') : '–';
  new SeriesPlot(host, {...common, lines, bands: [bandOf(c.value, c.sigma, 'blue')], label: `${name}, px`, aside: `at the end ${says}`, xLabel: '', height: 98,
    range: rangeOf(c), aria: `${name} over time, at the end ${says}`, isFilling: true,
    tip: (i) => [`${name} ${withSigma(c.value[i]!, c.sigma[i]!, 'px')} (3σ)`, ...(hasTruth ? [`truth ${num(c.truth[i]!, 6)} px`] : [])]});
  const below: Line[] = [{name: '3σ', values: scaled(c.sigma, 3), colour: 'blue'}];
  const error = c.value.map((v, i) => Math.abs(v - c.truth[i]!));
  if (hasTruth) below.unshift({name: '|estimate − truth|', values: error, colour: 'soft', width: 1});
  if (c.bound.some(Number.isFinite)) below.push({name: '3σ at best', values: scaled(c.bound, 3), colour: 'orange', dash: [4, 3]});
  const floor = extent(scaled(c.sigma, 3)), top = floor ? floor[1] : 1;
  new SeriesPlot(host, {...common, lines: below, label: '', isLog: true, xLabel: scene.timeLabel, height: 84, aria: `3σ of ${name} over time`,
    range: floor ? [0.02 * floor[0], Math.min(top, 300 * floor[0]) * 1.5] : undefined, digits: 3});
}

export const observeIntrinsics: Figure = {
  id: 'intrinsics', title: 'What are fx, fy, cx and cy, and how sure is it?', note: 'px, ± 3σ · drag to zoom, click an instant', span: 18,
  draw(host, doc, selection) {
    const scene = observeScene(doc);
    if (!scene) return null;
    const columns = names.map((name) => columnOf(scene, name));
    if (!columns.some((c) => c.value.some(Number.isFinite))) return null;
    let known = 0, inside = 0;
    for (const c of columns) c.value.forEach((v, i) => {
      const error = Math.abs(v - c.truth[i]!);
      if (Number.isFinite(error) && c.sigma[i]! > 0) ++known, (inside += Number(error <= 3 * c.sigma[i]!));
    });
    const keys: Key[] = [{words: 'estimate', colour: 'var(--blue)'}, {words: '± 3σ; below: 3σ by itself', colour: 'var(--blue)', look: 'band'}];
    if (known > 0) keys.push({words: 'truth', colour: 'var(--ink)', look: 'dash'}, {words: 'below: |estimate − truth|', colour: 'var(--soft)'});
    if (columns.some((c) => c.bound.some(Number.isFinite))) keys.push({words: 'below: 3σ at best', colour: 'var(--orange)', look: 'dash'});
    if (scene.zooms.length > 0) keys.push({words: 'zooming', colour: 'var(--orange)', look: 'band'});
    if (scene.events.length > 0) keys.push({words: `events: ${scene.events.length > maxMarks ? 'ticks' : 'triangles'} above`, colour: 'var(--orange)', look: 'square'});
    legend(host, keys);
    const grid = el('div', {class: 'grid2'});
    host.append(grid);
    columns.forEach((c, k) => {
      const part = el('div');
      grid.append(part);
      drawOne(part, scene, names[k]!, c, selection);
    });
    if (scene.events.length > 0)
      host.append(el('details', {class: 'reasons'}, el('summary', {}, `${scene.events.length} event${scene.events.length === 1 ? '' : 's'}`),
        el('ul', {}, ...scene.events.slice(0, 100).map((event) => el('li', {}, el('b', {}, `${event.t.toFixed(3)} s`), ' ' + event.words)))));
    return {marks: scene.steps.rows, rows: scene.steps.rows, tables: [scene.steps], words: '',
      good: 'Good: the band narrows and stays level; it widens while the lens zooms, and is narrow again after.' + (known > 0 ? ` The truth is inside 3σ for ${percent(inside, known, 1)} of all values (99.7 % expected).` : '')};
  },
};
