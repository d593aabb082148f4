// Where did it look? The optical axis on the sphere, with the image's outline at the first, last and outermost steps.
import {Chart} from '../core/chart';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {degrees, num} from '../core/format';
import {column, turn, unit, type M3, type V3} from '../core/rigid';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent} from '../core/stats';
import {View3} from '../core/view3';
import {World} from '../core/world';
import {observeScene} from './observe_scene';
import type {Doc} from '../core/document';

interface Directions {
  axis: {step: number; d: V3}[];
  footprints: V3[][];
}

function outline(r: M3, doc: Doc): V3[] {
  const size = doc.imageSize, fx = doc.estimate('camera.fx'), fy = doc.estimate('camera.fy'), cx = doc.estimate('camera.cx'), cy = doc.estimate('camera.cy');
  if (!size || !(fx > 0 && fy > 0)) return [];
  const places: V3[] = [], pieces = 8;
  for (const [u0, v0, u1, v1] of [[0, 0, 1, 0], [1, 0, 1, 1], [1, 1, 0, 1], [0, 1, 0, 0]] as const)
    for (let k = 0; k < pieces; ++k) {
      const u = size.width * (u0 + ((u1 - u0) * k) / pieces), v = size.height * (v0 + ((v1 - v0) * k) / pieces);
      places.push(turn(r, unit([(u - cx) / fx, (v - cy) / fy, 1])));
    }
  return places;
}

function directionsOf(doc: Doc): Directions | null {
  const scene = observeScene(doc);
  if (!scene) return null;
  const every = Math.max(1, Math.ceil(scene.steps.rows / 1500)), axis: {step: number; d: V3; r: M3}[] = [];
  for (let i = 0; i < scene.steps.rows; i += every) {
    const r = scene.attitude(i);
    if (r) axis.push({step: i, d: column(r, 2), r});
  }
  if (axis.length < 2) return null;
  const best = (key: (d: V3) => number) => axis.reduce((a, b) => (key(b.d) > key(a.d) ? b : a));
  const chosen = [axis[0]!, axis[axis.length - 1]!, best((d) => d[0]), best((d) => -d[0]), best((d) => d[1]), best((d) => -d[1])];
  return {axis, footprints: [...new Set(chosen)].map((one) => outline(one.r, doc)).filter((places) => places.length > 0)};
}

const rightOf = (d: V3) => Math.atan2(d[0], d[2]) * degrees, upOf = (d: V3) => -Math.asin(d[1]) * degrees;

export const observeDirections: Figure = {
  id: 'directions', title: 'Where did it look?', note: 'line: the optical axis; frames: the image first, last and at its outermost', span: 12,
  draw(host, doc, selection) {
    const found = directionsOf(doc), scene = observeScene(doc);
    if (!found || !scene) return null;
    const {axis, footprints} = found, row = el('div', {class: 'row'}), left = el('div'), right = el('div');
    host.append(row);
    row.append(left, right);
    const across = extent(axis.map(({d}) => rightOf(d)))!, up = extent(axis.map(({d}) => upOf(d)))!;
    const words = `the view moved ${num(across[1] - across[0], 2)}° across and ${num(up[1] - up[0], 2)}° up and down`;
    const nearest = () => (Number.isFinite(selection.time) ? axis.reduce((a, b) => (Math.abs(scene.t[b.step]! - selection.time) < Math.abs(scene.t[a.step]! - selection.time) ? b : a)) : null);
    const make = () => {
      const world = new World();
      for (let k = 0; k < 12; ++k) {
        const ring = (f: (turn_: number) => V3) => world.line(Array.from({length: 48}, (_, i) => f((i / 48) * 2 * Math.PI)), {colour: 'soft', width: 1, opacity: 0.28}, true);
        const a = (k / 12) * Math.PI;
        ring((s) => [Math.sin(s) * Math.cos(a), Math.cos(s), Math.sin(s) * Math.sin(a)]);
        if (k > 0 && k < 6) { const y = Math.sin((k / 6 - 0.5) * Math.PI), c = Math.sqrt(1 - y * y); ring((s) => [c * Math.cos(s), y, c * Math.sin(s)]); }
      }
      world.line(axis.map(({d}) => d), {colour: 'blue', width: 3});
      for (const places of footprints) world.line(places, {colour: 'orange', width: 1.8}, true);
      const now = nearest();
      if (now) world.line([[0, 0, 0], now.d], {colour: 'red', width: 2}), world.dot(now.d, 'red', 9);
      world.axes({t: [0, 0, 0], r: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, 0.35);
      for (const p of [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]] as V3[]) world.hold(p);
      return world;
    };
    const view = new View3(left, {height: 320, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.45, pitch: 0.3, hasNoBar: true, label: `Directions on a sphere; ${words}`}, make);
    const chart = new Chart(right, {height: 320, label: `The same in degrees; ${words}`}, (pen) => {
      const all = [...axis.map(({d}) => d), ...footprints.flat()], xs = extent(all.map(rightOf))!, ys = extent(all.map(upOf))!;
      const w = pen.w - 60, h = pen.h - 66, span = Math.max((xs[1] - xs[0]) / w, (ys[1] - ys[0]) / h) * 1.06 || 1;
      const mx = (xs[0] + xs[1]) / 2, my = (ys[0] + ys[1]) / 2;
      const x = scale(mx - (span * w) / 2, mx + (span * w) / 2, 46, 46 + w), y = scale(my - (span * h) / 2, my + (span * h) / 2, 22 + h, 22);
      yAxis(pen, y, 46, 46 + w, {label: '° upwards'});
      xAxis(pen, x, 22, 22 + h, {label: '° right of the first view'});
      for (const places of footprints) pen.path(places.flatMap((d) => [x(rightOf(d)), y(upOf(d))]), pen.c.orange, 1.6, [], true);
      pen.path(axis.flatMap(({d}) => [x(rightOf(d)), y(upOf(d))]), pen.c.blue, 2.6);
      const now = nearest();
      if (now) pen.circle(x(rightOf(now.d)), y(upOf(now.d)), 5, pen.c.red);
      const stride = Math.max(1, Math.floor(axis.length / 300));
      for (let i = 0; i < axis.length; i += stride) {
        const {step, d} = axis[i]!;
        pen.hit({x: x(rightOf(d)), y: y(upOf(d)), r: 3, tip: () => [`${num(scene.t[step]!, 5)} s`, `${num(rightOf(d), 3)}° right, ${num(upOf(d), 3)}° up`], pick: () => selection.at(scene.t[step]!)});
      }
    });
    selection.on(() => (view.refresh(), chart.redraw()));
    return {marks: axis.length, rows: axis.length, tables: [scene.steps], words, good: `Good: it went across and up and down; a level or an upright line alone leaves a parameter open. Here ${words}.`};
  },
};
