// track: heads, rays and the target's path in space; position; errors; innovations; age.
import type {Doc, Table} from '../core/document';
import {legend, type Figure, type Key} from '../core/figure';
import {num, percent, withSigma} from '../core/format';
import {add, mul, norm, poseOf, sub, isFinite3, type V3, halfAxes, type M3} from '../core/rigid';
import type {Selection} from '../core/selection';
import {bandAboutZero, bandOf, SeriesPlot} from '../core/series';
import {extent, lengths, quantile, scaled} from '../core/stats';
import {View3} from '../core/view3';
import {World} from '../core/world';
import {axisColours, axisNames, hasTriple, lastRow, rowAt, triple} from './columns';
import {drawNis} from './nis_plot';
import {observeScene} from './observe_scene';
import {scatter} from './scatter';

const target = 'target_in_world_';

function covOf(steps: Table, i: number): M3 {
  const c = (name: string) => steps.number(`cov_${name}_m2`, i), s = (axis: string) => steps.number(`sigma_${target}${axis}_m`, i);
  if (Number.isFinite(c('xy'))) return [[c('xx'), c('xy'), c('xz')], [c('xy'), c('yy'), c('yz')], [c('xz'), c('yz'), c('zz')]];
  return [[s('x') ** 2, 0, 0], [0, s('y') ** 2, 0], [0, 0, s('z') ** 2]];
}

/** Rays of the observations about an instant: one a head, the newest. */
function addRays(world: World, doc: Doc, time: number, to: V3): void {
  const sights = doc.table('measurements');
  if (!sights || !hasTriple(sights, 'ray_origin_in_world_')) return;
  const t = sights.numbers('t_capture_s'), head = sights.numbers('head'), latest = new Map<number, number>();
  for (let i = 0; i < sights.rows; ++i) if (t[i]! <= time + 1e-6) latest.set(head[i]!, i);
  const origin = triple(sights, 'ray_origin_in_world_'), direction = triple(sights, 'ray_direction_', '');
  for (const [id, i] of latest) {
    const from = origin.at(i), d = direction.at(i);
    if (!isFinite3(from) || !isFinite3(d)) continue;
    world.line([from, add(from, mul(d, 1.15 * norm(sub(to, from))))], {colour: 'purple', width: 2});
    world.dot(from, 'ink', 9);
    world.label(add(from, [0, -0.07 * norm(sub(to, from)), 0]), `head ${id}`);
    world.hold(from);
  }
}

function addHeads(world: World, doc: Doc): void {
  const heads = doc.table('heads');
  if (!heads) return;
  for (let i = 0; i < heads.rows; ++i) {
    const pose = poseOf(heads, 'world_from_base', i);
    if (pose) world.axes(pose, 0.15, false), world.hold(pose.t);
  }
}

export function trackWorld(doc: Doc, steps: Table, selection: Selection): World {
  const world = new World(), t = steps.numbers('t_s'), at = triple(steps, target), rows = steps.rows;
  const path = Array.from({length: rows}, (_, i) => at.at(i)), sigma = lengths(steps.numbers(`sigma_${target}x_m`), steps.numbers(`sigma_${target}z_m`));
  const usual = quantile(sigma, 0.9);
  world.line(path.filter((_, i) => sigma[i]! < 20 * usual || !(usual > 0)), {colour: 'blue', width: 2.4});
  world.hold(...path.filter((_, i) => sigma[i]! < 5 * usual || !(usual > 0)));
  if (hasTriple(steps, 'truth_')) {
    const truth = triple(steps, 'truth_');
    world.line(Array.from({length: rows}, (_, i) => truth.at(i)), {colour: 'ink', width: 1.3, opacity: 0.9});
  }
  const every = Math.max(1, Math.floor(rows / 24));
  for (let i = every; i < rows; i += every) if (isFinite3(path[i]!) && sigma[i]! < 5 * usual) world.ellipsoid(path[i]!, halfAxes(covOf(steps, i)).map((axis) => mul(axis, 3)), 'sky', 0.08);
  const chosen = rowAt(t, selection.time), now = chosen >= 0 && isFinite3(path[chosen]!) ? chosen : lastRow(at.value[0]!);
  if (now >= 0) {
    world.ellipsoid(path[now]!, halfAxes(covOf(steps, now)).map((axis) => mul(axis, 3)), 'red', 0.2);
    world.dot(path[now]!, 'red', 9, {tip: () => [`${num(t[now]!, 5)} s`, ...axisNames.map((axis, k) => `${axis} ${withSigma(at.value[k]![now]!, steps.number(`sigma_${target}${axis}_m`, now), 'm')}`)]});
    addRays(world, doc, t[now]!, path[now]!);
  }
  addHeads(world, doc);
  world.axes({t: [0, 0, 0], r: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, 0.2);
  world.hold([0, 0, 0]);
  return world;
}

function stepsOf(doc: Doc): Table | null {
  const steps = doc.table('steps');
  return steps && hasTriple(steps, target) ? steps : null;
}

export const trackSpace: Figure = {
  id: 'path', title: 'Where did the target go?', note: 'world frame, m · click a time axis for the rays of an instant', span: 12,
  draw(host, doc, selection) {
    const steps = stepsOf(doc);
    if (!steps) return null;
    const keys: Key[] = [{words: 'estimate', colour: 'var(--blue)'}, {words: '3σ of every n-th', colour: 'var(--sky)', look: 'ring'}, {words: 'the instant', colour: 'var(--red)', look: 'dot'}];
    if (hasTriple(steps, 'truth_')) keys.splice(1, 0, {words: 'truth', colour: 'var(--ink)'});
    if (doc.table('measurements')?.has('ray_direction_x')) keys.push({words: 'its rays', colour: 'var(--purple)'});
    legend(host, keys);
    const label = `Path of the target through ${steps.rows} steps`;
    const view = new View3(host, {height: 420, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.7, pitch: 0.45, label}, () => trackWorld(doc, steps, selection));
    selection.on(() => view.refresh());
    return {marks: steps.rows, rows: steps.rows, tables: [steps], words: label, good: 'Good: small ellipsoids all along; long ones point away from the heads, where rays meet at a sharp angle.'};
  },
};

export const trackAbove: Figure = {
  id: 'above', title: 'And from above?', note: 'x to the right, z away, m', span: 6,
  draw(host, doc, selection) {
    const steps = stepsOf(doc);
    if (!steps) return null;
    const t = steps.numbers('t_s'), at = triple(steps, target), truth = hasTriple(steps, 'truth_') ? triple(steps, 'truth_') : null, sigma = steps.numbers(`sigma_${target}z_m`), usual = quantile(sigma, 0.9);
    const every = Math.max(1, Math.floor(steps.rows / 400)), rows = Array.from({length: Math.ceil(steps.rows / every)}, (_, k) => k * every).filter((i) => sigma[i]! < 5 * usual || !(usual > 0));
    const line = (v: {value: Float64Array[]}, x: (n: number) => number, y: (n: number) => number) => rows.flatMap((i) => [x(v.value[0]![i]!), y(v.value[2]![i]!)]);
    const chart = scatter(host, rows.map((i) => ({x: at.value[0]![i]!, y: at.value[2]![i]!, size: 1.6, colour: (pen) => pen.c.blue, tip: () => [`${num(t[i]!, 5)} s`, `x ${num(at.value[0]![i]!, 4)}, z ${num(at.value[2]![i]!, 4)} m`], pick: () => selection.at(t[i]!)})),
      {xLabel: 'x, m', yLabel: 'z, m', height: 300, isFilling: true, isSquare: true, label: 'The path from above', include: [[0, 0]],
        below: (pen, x, y) => {
          if (truth) pen.path(line(truth, x, y), pen.c.ink, 1.2, [5, 4]);
          pen.path(line(at, x, y), pen.c.blue, 2);
          const now = rowAt(t, selection.time);
          if (now >= 0) pen.circle(x(at.value[0]![now]!), y(at.value[2]![now]!), 6, pen.c.red);
          pen.fill([x(0) - 6, y(0) + 5, x(0) + 6, y(0) + 5, x(0), y(0) - 7], pen.c.ink);
        }});
    selection.on(() => chart.redraw());
    return {marks: rows.length, rows: rows.length, tables: [steps], words: '', good: `Triangle: the base; red: the chosen instant.${truth ? ' Dashed: the truth.' : ''}`};
  },
};

export const trackPosition: Figure = {
  id: 'position', title: 'Where was it, when?', note: 'm, ± 3σ · drag to zoom', span: 12,
  draw(host, doc, selection) {
    const steps = stepsOf(doc), scene = observeScene(doc);
    if (!steps || !scene) return null;
    const at = triple(steps, target), sigma = triple(steps, `sigma_${target}`), truth = hasTriple(steps, 'truth_') ? triple(steps, 'truth_') : null;
    axisNames.forEach((axis, k) => {
      const s = sigma.value[k]!, usual = quantile(s, 0.9), settled = at.value[k]!.filter((_, i) => !(s[i]! > 10 * usual)), ends = extent(settled, ...(truth ? [truth.value[k]!] : []));
      const margin = ends ? 0.1 * (ends[1] - ends[0]) + 3 * usual : 1, last = lastRow(at.value[k]!), says = last >= 0 ? withSigma(at.value[k]![last]!, s[last]!, 'm') : '–';
      new SeriesPlot(host, {t: scene.t, selection, label: `${axis}, m`, aside: `at the end ${says}`, xLabel: k === 2 ? scene.timeLabel : '', height: k === 2 ? 132 : 108, isFilling: true, aria: `${axis} over time, at the end ${says}`, range: ends ? [ends[0] - margin, ends[1] + margin] : undefined,
        lines: [{name: axis, values: at.value[k]!, colour: axisColours[k]!}, ...(truth ? [{name: 'truth', values: truth.value[k]!, colour: 'ink' as const, dash: [5, 4], width: 1.2}] : [])], bands: [bandOf(at.value[k]!, s, axisColours[k]!)], events: k === 0 ? scene.events : [],
        tip: (i) => [`${axis} ${withSigma(at.value[k]![i]!, s[i]!, 'm')} (3σ)`, ...(truth ? [`truth ${num(truth.value[k]![i]!, 5)} m`] : [])]});
    });
    return {marks: steps.rows, rows: steps.rows, tables: [steps], words: '', good: truth ? 'Dashed: the truth.' : undefined};
  },
};

export const trackError: Figure = {
  id: 'error', title: 'How far off, and did it know?', note: 'estimate − truth, mm, ± 3σ', span: 12,
  draw(host, doc, selection) {
    const steps = stepsOf(doc), scene = observeScene(doc);
    if (!steps || !scene || !hasTriple(steps, 'truth_')) return null;
    const at = triple(steps, target), sigma = triple(steps, `sigma_${target}`), truth = triple(steps, 'truth_');
    let known = 0, inside = 0;
    axisNames.forEach((axis, k) => {
      const error = at.value[k]!.map((v, i) => 1e3 * (v - truth.value[k]![i]!)), three = scaled(sigma.value[k]!, 3e3), limit = 1.15 * Math.max(quantile(three, 0.97), quantile(error.map(Math.abs), 0.99));
      error.forEach((e, i) => Number.isFinite(e) && three[i]! > 0 && (++known, (inside += Number(Math.abs(e) <= three[i]!))));
      new SeriesPlot(host, {t: scene.t, selection, label: `${axis}, mm`, xLabel: '', height: 96, isFilling: true, aria: `error of ${axis}`, lines: [{name: 'error', values: error, colour: axisColours[k]!, width: 1.3}], levels: [{value: 0, dash: []}],
        bands: [bandAboutZero(scaled(sigma.value[k]!, 1e3), axisColours[k]!)], range: limit > 0 ? [-limit, limit] : undefined, tip: (i) => [`error ${num(error[i]!, 3)} mm, 3σ ${num(three[i]!, 3)} mm`]});
    });
    const nees = steps.numbers('nees');
    if (nees.some(Number.isFinite)) drawNis(host, {t: scene.t, nis: nees, dof: () => 3, counts: () => true, label: 'NEES over its degrees of freedom: 1 is expected', xLabel: scene.timeLabel, height: 150, selection, isFilling: true});
    const words = `the error is inside 3σ for ${percent(inside, known, 1)} of all values (99.7 % expected)`;
    return {marks: known, rows: known, tables: [steps], words, good: `Good: inside the band, on both sides of zero. Here ${words}.` + (doc.estimate('pcrlb_m') > 0 ? ` RMS ${num(1e3 * doc.estimate('rms_m'), 3)} mm; the best possible is ${num(1e3 * doc.estimate('pcrlb_m'), 3)} mm (PCRLB).` : '')};
  },
};

function sightsOf(doc: Doc): Table | null {
  const sights = doc.table('measurements');
  return sights && sights.hasValues('t_capture_s') ? sights : null;
}
/** Rows in order of a time, as a plot needs them. */
function sorted(t: Float64Array): number[] {
  return Array.from(t.keys()).filter((i) => Number.isFinite(t[i]!)).sort((a, b) => t[a]! - t[b]!);
}

export const trackInnovations: Figure = {
  id: 'innovations', title: 'Does each observation fit?', note: 'innovation, px, ± 3σ predicted', span: 12,
  draw(host, doc, selection) {
    const sights = sightsOf(doc);
    if (!sights || !sights.hasValues('innovation_u_px')) return null;
    const order = sorted(sights.numbers('t_capture_s')), pick = (name: string) => Float64Array.from(order, (i) => sights.number(name, i)), t = pick('t_capture_s'), accepted = pick('accepted');
    const hasInnovation = pick('innovation_u_px').map((v, i) => Number(Number.isFinite(v) && accepted[i] === 0)), dropped = hasInnovation.reduce((a, b) => a + b, 0);
    legend(host, [{words: 'used', colour: 'var(--blue)', look: 'dot'}, {words: `rejected (${dropped})`, colour: 'var(--red)', look: 'dot'}, {words: '± 3σ', colour: 'var(--blue)', look: 'band'}]);
    for (const axis of ['u', 'v'] as const) {
      const value = pick(`innovation_${axis}_px`), sigma = pick(`sigma_innovation_${axis}_px`), limit = 1.2 * Math.max(3 * quantile(sigma, 0.95), quantile(value.filter((_, i) => accepted[i] === 1).map(Math.abs), 0.999)) || 1;
      const clamp = (v: number) => Math.max(-limit * 0.97, Math.min(limit * 0.97, v));
      new SeriesPlot(host, {t, selection, label: `innovation ${axis}, px`, xLabel: '', height: 112, isFilling: true, aria: `innovation ${axis} over time`, range: [-limit, limit], levels: [{value: 0, dash: []}], bands: [bandAboutZero(sigma, 'blue')],
        lines: [{name: 'used', values: value.map((v, i) => (accepted[i] === 1 ? v : NaN)), colour: 'blue', isDots: true}, {name: 'rejected', values: value.map((v, i) => (accepted[i] === 0 ? clamp(v) : NaN)), colour: 'red', isDots: true, size: 7}],
        tip: (i) => [`head ${sights.text('head', order[i]!)}: ${num(value[i]!, 3)} px, 3σ ${num(3 * sigma[i]!, 3)}`, accepted[i] === 1 ? 'used' : 'rejected']});
    }
    const share = drawNis(host, {t, nis: pick('nis'), dof: () => 2, counts: (i) => accepted[i] === 1, label: 'NIS over its 2 degrees of freedom: 1 is expected', xLabel: 'time of capture, s', height: 160, selection, isFilling: true});
    const words = `${percent(share.inside, share.known, 1)} of the used observations are inside the 95 % bounds; ${dropped} were rejected by the gate`;
    return {marks: t.length, rows: sights.rows, tables: [sights], words, good: `Good: dots in the band, on both sides of zero. Here ${words}.`};
  },
};

export const trackAge: Figure = {
  id: 'age', title: 'How old is an observation when it arrives?', note: 'arrival − capture, ms', span: 6,
  draw(host, doc, selection) {
    const sights = sightsOf(doc);
    if (!sights || !sights.hasValues('t_arrival_s')) return null;
    const capture = sights.numbers('t_capture_s'), arrival = sights.numbers('t_arrival_s'), order = sorted(capture), age = Float64Array.from(order, (i) => 1e3 * (arrival[i]! - capture[i]!));
    const middle = quantile(age, 0.5), worst = quantile(age, 1);
    new SeriesPlot(host, {t: Float64Array.from(order, (i) => capture[i]!), selection, label: 'age, ms', xLabel: 'time of capture, s', height: 220, isFilling: true, aria: 'age of each observation', lines: [{name: 'age', values: age, colour: 'blue', isDots: true}], range: [0, Math.max(1, 1.25 * worst)],
      levels: [{value: middle, words: `half below ${num(middle, 3)} ms`}], tip: (i) => [`${num(age[i]!, 3)} ms, head ${sights.text('head', order[i]!)}`]});
    return {marks: age.length, rows: sights.rows, tables: [sights], words: '', good: `Half arrive within ${num(middle, 3)} ms, the latest after ${num(worst, 3)} ms. Late ones are put where they belong in time.`};
  },
};
