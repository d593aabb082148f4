// localize: path and map in space; error; tracks; consistency; time a frame.
import {blueToOrange} from '../core/colours';
import type {Doc, Table} from '../core/document';
import {legend, type Figure, type Key} from '../core/figure';
import {num, percent, withSigma} from '../core/format';
import {halfAxes, identity, isFinite3, mul, norm, poseOf, type M3, type V3} from '../core/rigid';
import type {Selection} from '../core/selection';
import {bandAboutZero, SeriesPlot} from '../core/series';
import {quantile, scaled} from '../core/stats';
import {View3} from '../core/view3';
import {ballOf, World} from '../core/world';
import {axisColours, axisNames, hasTriple, lastRow, rowAt, triple} from './columns';
import {drawNis} from './nis_plot';

const cam = 'world_from_cam_', sigmaCam = 'sigma_world_from_cam_';

/** Truth in another frame, or up to scale, cannot be laid over the path: the errors after alignment are the estimate's. */
function truthOf(doc: Doc, path: Table) {
  return doc.estimateText('scale_known') !== 'false' && hasTriple(path, 'truth_') ? triple(path, 'truth_') : null;
}

function pathOf(doc: Doc): Table | null {
  const path = doc.table('path');
  return path && hasTriple(path, cam) ? path : null;
}

function addMap(world: World, features: Table, radius: number): void {
  const c = (name: string, i: number) => features.number(`cov_${name}_m2`, i);
  for (let i = 0; i < features.rows; ++i) {
    const p: V3 = triple(features, 'point_in_world_').at(i), isKnown = features.number('known', i) > 0;
    world.dot(p, isKnown ? 'orange' : 'green', isKnown ? 8 : 4, {tip: () => [`point ${features.text('id', i)}, seen ${features.text('num_seen', i)}×`, `${p.map((v) => num(v, 4)).join(', ')} m`]});
    const cov: M3 = [[c('xx', i), c('xy', i), c('xz', i)], [c('xy', i), c('yy', i), c('yz', i)], [c('xz', i), c('yz', i), c('zz', i)]];
    const axes = cov.every(isFinite3) ? halfAxes(cov).map((axis) => mul(axis, 3)) : [];
    if (axes.length === 3 && Math.max(...axes.map(norm)) < radius && features.rows < 400) world.ellipsoid(p, axes, 'green', 0);
  }
}

function localizeWorld(doc: Doc, path: Table, selection: Selection): World {
  const world = new World(), at = triple(path, cam), rows = path.rows, t = path.numbers('t_s'), sigma = triple(path, sigmaCam);
  const size = (i: number) => norm(sigma.at(i)), places = Array.from({length: rows}, (_, i) => at.at(i));
  const low = quantile(places.map((_, i) => size(i)), 0.02), high = quantile(places.map((_, i) => size(i)), 0.98);
  world.hold(...places);
  const radius = ballOf(world.frame).radius, buckets = 8;
  for (let b = 0; b < buckets; ++b) {
    const colour = blueToOrange(b / (buckets - 1));
    for (let i = 0; i + 1 < rows; ++i) {
      const share = high > low ? (size(i) - low) / (high - low) : 0;
      if (Math.min(buckets - 1, Math.max(0, Math.floor(share * buckets))) === b) world.line([places[i]!, places[i + 1]!], {colour, width: 3.2});
    }
  }
  const truth = truthOf(doc, path);
  if (truth) {
    world.line(Array.from({length: rows}, (_, i) => truth.at(i)), {colour: 'ink', width: 1.2, opacity: 0.85});
  }
  const features = doc.table('features');
  if (features) addMap(world, features, radius), world.hold(...Array.from({length: features.rows}, (_, i) => triple(features, 'point_in_world_').at(i)).filter((p) => norm(p) < 8 * radius + 1));
  const chosen = rowAt(t, selection.time), now = chosen >= 0 && isFinite3(places[chosen]!) ? chosen : lastRow(at.value[0]!), pose = now >= 0 ? poseOf(path, 'world_from_cam', now) : null;
  if (pose) world.hold(...world.frustum(pose, [0.5, 0.38], 0.35 * radius, {colour: 'red', width: 2.2})), world.dot(pose.t, 'red', 8);
  world.axes(identity, 0.25 * radius);
  return world;
}

export const localizeSpace: Figure = {
  id: 'path', title: 'Where was the camera?', note: 'map frame, m', span: 14,
  draw(host, doc, selection) {
    const path = pathOf(doc);
    if (!path) return null;
    const alignment = doc.estimateText('alignment'), keys: Key[] = [{words: 'path, blue to orange by its σ', colour: 'var(--blue)'}, {words: 'the instant', colour: 'var(--red)'}, {words: 'map points, 3σ', colour: 'var(--green)', look: 'dot'}];
    if (doc.table('features')?.numbers('known').some((known) => known > 0)) keys.push({words: 'known points', colour: 'var(--orange)', look: 'dot'});
    if (truthOf(doc, path)) keys.push({words: `truth${alignment ? ` (alignment for ATE: ${alignment})` : ''}`, colour: 'var(--ink)'});
    legend(host, keys);
    const label = `Path of the camera through ${path.rows} frames`;
    const view = new View3(host, {height: 440, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.6, pitch: 0.4, label}, () => localizeWorld(doc, path, selection));
    selection.on(() => view.refresh());
    const ate = doc.estimate('ate_m'), isKnown = doc.estimateText('scale_known');
    return {marks: path.rows, rows: path.rows, tables: [path, ...(doc.table('features') ? [doc.table('features')!] : [])], words: label,
      good: (isKnown === 'false' ? 'The scale is not known: lengths are up to one factor. ' : '') + 'Blue is well known, orange badly, between the best and the worst of this path. ' + (Number.isFinite(ate) ? `ATE ${num(1e3 * ate, 3)} mm RMS${alignment ? ` after ${alignment} alignment` : ''}; RPE ${num(1e3 * doc.estimate('rpe_m'), 3)} mm.` : '')};
  },
};

export const localizeError: Figure = {
  id: 'error', title: 'How sure is it, and how far off?', note: 'mm, ± 3σ', span: 10,
  draw(host, doc, selection) {
    const path = pathOf(doc);
    if (!path) return null;
    const at = triple(path, cam), sigma = triple(path, sigmaCam), truth = truthOf(doc, path), t = path.numbers('t_s');
    let known = 0, inside = 0;
    axisNames.forEach((axis, k) => {
      const three = scaled(sigma.value[k]!, 3e3), error = truth ? at.value[k]!.map((v, i) => 1e3 * (v - truth.value[k]![i]!)) : new Float64Array(path.rows).fill(NaN);
      error.forEach((e, i) => Number.isFinite(e) && three[i]! > 0 && (++known, (inside += Number(Math.abs(e) <= three[i]!))));
      const limit = 1.2 * Math.max(quantile(three, 0.97) || 0, quantile(error.map(Math.abs), 0.99) || 0) || 1;
      new SeriesPlot(host, {t, selection, label: `${axis}, mm`, xLabel: k === 2 ? 'time, s' : '', height: k === 2 ? 132 : 104, isFilling: true, aria: `error of ${axis}`, levels: [{value: 0, dash: []}], range: [-limit, limit], bands: [bandAboutZero(scaled(sigma.value[k]!, 1e3), axisColours[k]!)],
        lines: [{name: 'error', spansGaps: true, values: error, colour: axisColours[k]!, width: 1.4}], tip: (i) => [`${axis} ${withSigma(at.value[k]![i]!, sigma.value[k]![i]!, 'm')} (3σ)`, ...(truth ? [`error ${num(error[i]!, 3)} mm`] : [])]});
    });
    const words = truth ? `the error is inside 3σ for ${percent(inside, known, 1)} of all values (99.7 % expected)` : hasTriple(path, 'truth_') ? 'the scale is not known, so there is no error in metres by axis: ATE and RPE are after alignment; the band is 3σ' : 'no truth was given: the band is 3σ';
    return {marks: path.rows, rows: path.rows, tables: [path], words, good: truth ? `Good: inside the band. Here ${words}.` : `${words[0]!.toUpperCase()}${words.slice(1)}.`};
  },
};

export const localizeTracks: Figure = {
  id: 'tracks', title: 'Were points kept?', note: 'points a frame', span: 6,
  draw(host, doc, selection) {
    const path = doc.table('path');
    if (!path || !path.hasValues('num_tracked')) return null;
    const t = path.numbers('t_s'), lost = Array.from({length: path.rows}, (_, i) => path.text('event', i)).map((event, i) => ({t: t[i]!, words: event})).filter((one) => /lost|restart/.test(one.words)).slice(0, 200);
    legend(host, [{words: 'used', colour: 'var(--blue)'}, {words: 'seen', colour: 'var(--soft)', look: 'dash'}, {words: 'gated', colour: 'var(--red)', look: 'dot'}]);
    new SeriesPlot(host, {t, selection, label: 'points', xLabel: 'time, s', height: 230, isFilling: true, aria: 'points kept over time', events: lost, lines: [{name: 'used', values: path.numbers('num_tracked'), colour: 'blue', isSteps: true},
      ...(path.hasValues('num_seen') ? [{name: 'seen', values: path.numbers('num_seen'), colour: 'soft' as const, dash: [4, 3], isSteps: true}] : []), {name: 'gated', values: path.numbers('num_gated').map((v) => (v > 0 ? v : NaN)), colour: 'red', isDots: true, size: 5}]});
    return {marks: path.rows, rows: path.rows, tables: [path], words: '', good: 'Good: enough points at all times (six and more), few gated.'};
  },
};

export const localizeNis: Figure = {
  id: 'nis', title: 'Does each frame fit?', note: 'NIS', span: 6,
  draw(host, doc, selection) {
    const path = doc.table('path');
    if (!path || !path.hasValues('nis')) return null;
    const tracked = path.numbers('num_tracked'), nis = path.numbers('nis'), dof = (i: number) => Math.max(1, 2 * (tracked[i]! || 1));
    const share = drawNis(host, {t: path.numbers('t_s'), nis: nis.map((v, i) => v * dof(i)), dof, counts: () => true, label: 'NIS over its degrees of freedom: 1 is expected', xLabel: 'time, s', height: 250, selection, isFilling: true});
    const words = `${percent(share.inside, share.known, 1)} are inside (95 % expected)`;
    return {marks: share.known, rows: share.known, tables: [path], words, good: `Good: dots in the band, the mean near 1. Here ${words}.`};
  },
};

export const localizeSpeed: Figure = {
  id: 'speed', title: 'Is it fast enough?', note: 'ms a frame', span: 6,
  draw(host, doc, selection) {
    const path = doc.table('path');
    if (!path || !path.hasValues('seconds')) return null;
    const t = path.numbers('t_s'), ms = scaled(path.numbers('seconds'), 1e3), period = quantile(t.map((v, i) => (i > 0 ? 1e3 * (v - t[i - 1]!) : NaN)), 0.5);
    const late = ms.filter((v) => v > period).length, top = Math.max(quantile(ms, 1), period > 0 && period < 50 * quantile(ms, 1) ? period : 0);
    new SeriesPlot(host, {t, selection, label: 'time a frame, ms', xLabel: 'time, s', height: 230, isFilling: true, aria: 'time a frame', lines: [{name: 'ms', values: ms, colour: 'blue', isDots: true}], range: [0, 1.15 * top || 1],
      levels: period > 0 ? [{value: period, words: `a frame each ${num(period, 3)} ms`, colour: 'red'}] : []});
    return {marks: path.rows, rows: path.rows, tables: [path], words: '', good: `Half of the frames take less than ${num(quantile(ms, 0.5), 2)} ms, the slowest ${num(quantile(ms, 1), 2)} ms; ${percent(late, path.rows, 1)} take longer than the ${num(period, 3)} ms between frames.`};
  },
};
