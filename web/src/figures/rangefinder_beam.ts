// Where is the beam? The beam with its 3σ cone, the origin's ellipsoid, boards and hits, before the camera.
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {num} from '../core/format';
import {add, cross, halfAxes, identity, isFinite3, move, mul, norm, unit, type V3} from '../core/rigid';
import {roundDown125} from '../core/stats';
import {View3} from '../core/view3';
import {World} from '../core/world';
import {coneSigmas, covOrigin, pointAt, rangefinderScene, type RangefinderScene, type Shot} from './rangefinder_scene';
import type {Selection} from '../core/selection';

const maxShots = 400;

/** Corners of the board's paper, one square beyond the outermost; else a patch of the plane around the hit. */
function sheet(scene: RangefinderScene, shot: Shot): V3[] | null {
  const {board} = scene;
  if (shot.pose && board) {
    const at = (c: number, r: number) => move(shot.pose!, [c * board.square_m, r * board.square_m, 0]);
    return [at(-1, -1), at(board.cols, -1), at(board.cols, board.rows), at(-1, board.rows)];
  }
  if (!isFinite3(shot.normal)) return null;
  const n = unit(shot.normal), middle = isFinite3(shot.hit) ? shot.hit : mul(n, -shot.d_m);
  const a = unit(cross(n, [0, 1, 0])), b = cross(n, a);
  if (!isFinite3(middle) || !isFinite3(a)) return null;
  return ([[-1, -1], [1, -1], [1, 1], [-1, 1]] as const).map(([x, y]) => add(middle, add(mul(a, 0.12 * x), mul(b, 0.12 * y))));
}

function cone(world: World, scene: RangefinderScene, from_m: number, to_m: number, factor: number): void {
  const beam = scene.beam!, steps = 6;
  const ring = (range: number): V3[] | null => {
    const sigmas = coneSigmas(beam, range);
    return sigmas && Array.from({length: 24}, (_, i) => {
      const t = (i / 24) * 2 * Math.PI;
      return add(pointAt(beam, range), add(mul(sigmas.axes[0], 3 * factor * sigmas.sigma[0] * Math.cos(t)), mul(sigmas.axes[1], 3 * factor * sigmas.sigma[1] * Math.sin(t))));
    });
  };
  let last = ring(from_m);
  for (let k = 1; k <= steps; ++k) {
    const next = ring(from_m + ((to_m - from_m) * k) / steps);
    if (!last || !next) return;
    for (let i = 0; i < 24; ++i) world.face([last[i]!, last[(i + 1) % 24]!, next[(i + 1) % 24]!, next[i]!], 'red', 0.16);
    world.line(next, {colour: 'red', width: 1, opacity: 0.55}, true);
    last = next;
  }
}

function wholeWorld(scene: RangefinderScene, selection: Selection, longest: number, factor: number): World {
  const world = new World(), {beam, lens} = scene;
  scene.shots.slice(0, maxShots).forEach((shot, i) => {
    const corners = sheet(scene, shot), isChosen = i === selection.item, colour = isChosen ? 'orange' : shot.isUsed ? 'blue' : 'soft';
    const touch = {pick: () => selection.choose(i), tip: () => [shot.name, `range ${num(shot.range_m, 4)} m`, shot.isUsed ? `residual ${num(1e3 * shot.dRange_m, 2)} mm` : `not used: ${shot.reason}`]};
    if (corners) world.face(corners, colour, isChosen ? 0.4 : 0.16, touch), world.line(corners, {colour, width: isChosen ? 3 : 1.3, opacity: shot.isUsed ? 1 : 0.5}, true);
    if (corners && shot.isUsed) world.hold(...corners);
    if (isFinite3(shot.hit)) world.dot(shot.hit, isChosen ? 'orange' : 'red', isChosen ? 10 : 6, touch), shot.isUsed && world.hold(shot.hit);
  });
  if (beam) {
    world.line([beam.origin, pointAt(beam, 1.05 * longest)], {colour: 'red', width: 2});
    world.hold(beam.origin, pointAt(beam, longest));
    cone(world, scene, 0, 1.05 * longest, factor);
    const cov = covOrigin(beam);
    if (cov) world.ellipsoid(beam.origin, halfAxes(cov).map((axis) => mul(axis, 3 * factor)), 'red');
  }
  if (lens) world.hold(...world.frustum(identity, [lens.width / 2 / lens.fx, lens.height / 2 / lens.fy], 0.14 * longest, {colour: 'ink', width: 1.8}));
  world.axes(identity, 0.1 * longest);
  world.hold([0, 0, 0]);
  return world;
}

function nearWorld(scene: RangefinderScene, factor: number): World {
  const world = new World(), beam = scene.beam!, far = norm(beam.origin) || 0.05, end = add(beam.origin, mul(beam.direction, 1.5 * far));
  world.axes(identity, 0.35 * far);
  world.line([[0, 0, 0], beam.origin], {colour: 'soft', width: 1.4});
  world.line([beam.origin, end], {colour: 'red', width: 2.4});
  const cov = covOrigin(beam);
  if (cov) world.ellipsoid(beam.origin, halfAxes(cov).map((axis) => mul(axis, 3 * factor)), 'red');
  cone(world, scene, 0, 1.5 * far, factor);
  world.hold([0, 0, 0], beam.origin, end, [0.4 * far, 0, 0], [0, 0.4 * far, 0]);
  return world;
}

export const rangefinderBeam: Figure = {
  id: 'beam', title: 'Where is the beam?', note: 'camera frame · drag to turn, click a shot', span: 18,
  draw(host, doc, selection) {
    const scene = rangefinderScene(doc, selection);
    if (!scene || (!scene.beam && !scene.shots.some((shot) => isFinite3(shot.normal)))) return null;
    const {beam, shots} = scene, longest = Math.max(0.3, ...shots.filter((s) => s.isUsed || !beam).map((s) => s.range_m || 0).slice(0, 5000));
    const sigma = beam && covOrigin(beam) ? norm(halfAxes(covOrigin(beam)!)[2]!) : 0, atEnd = beam ? coneSigmas(beam, longest) : null;
    const size = Math.max(sigma, ...(atEnd?.sigma ?? []), ...(beam && covOrigin(beam) ? halfAxes(covOrigin(beam)!).map(norm) : [0]));
    const factor = size > 0 ? Math.max(1, roundDown125((0.02 * longest) / size)) : 1;
    const nearFactor = size > 0 && beam ? Math.max(1, roundDown125((0.12 * norm(beam.origin)) / size)) : 1;
    legend(host, [{words: `beam${beam ? `, 3σ of it and of its origin ×${factor}` : ': cannot be determined'}`, colour: 'var(--red)'}, {words: 'board of a used shot', colour: 'var(--blue)', look: 'square'},
      {words: 'chosen', colour: 'var(--orange)', look: 'square'}, ...(shots.some((s) => isFinite3(s.hit)) ? [{words: 'where the beam hit', colour: 'var(--red)', look: 'dot' as const}] : []), ...(shots.some((s) => !s.isUsed) ? [{words: 'not used', colour: 'var(--soft)', look: 'square' as const}] : [])]);
    const row = el('div', {class: 'row', style: 'flex:1'}), left = el('div', {style: 'flex:2.2'}), right = el('div');
    host.append(row);
    row.append(left);
    const words = beam ? `The beam starts ${num(1e3 * norm(beam.origin), 3)} mm from the camera's centre` : 'No beam: these shots do not determine it';
    const view = new View3(left, {height: 400, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.7, pitch: 0.3, label: words, note: `3σ ×${factor}`}, () => wholeWorld(scene, selection, longest, factor));
    selection.on(() => view.refresh());
    if (beam) {
      row.append(right);
      right.append(el('p', {class: 'caption'}, `at the camera: ${num(1e3 * norm(beam.origin), 3)} mm from its centre`));
      new View3(right, {height: 300, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.6, pitch: 0.35, label: words, note: `3σ ×${nearFactor}`}, () => nearWorld(scene, nearFactor));
    }
    return {marks: Math.min(maxShots, shots.length), rows: Math.min(maxShots, shots.length), tables: [scene.table], words, good: beam ? 'Good: hits from near to far, boards tilted to all sides; a thin cone and a small ellipsoid.' : 'No beam is drawn: these boards do not determine it. Good would be boards tilted to all sides, from near to far.'};
  },
};
