// project: where readings of the rangefinder lie in the image, with 3σ.
import {Chart, type Pen} from '../core/chart';
import type {Table} from '../core/document';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num, withSigma} from '../core/format';
import {ellipsePlaces} from '../core/panel';
import {faded} from '../core/colours';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent} from '../core/stats';

const most = 200;

function drawPoints(pen: Pen, points: Table): void {
  const c = (name: string) => points.numbers(name), u = c('u_px'), v = c('v_px'), uu = c('cov_uu_px2'), uv = c('cov_uv_px2'), vv = c('cov_vv_px2');
  const ends = (value: Float64Array, variance: Float64Array) => extent(...[-3.5, 3.5].map((k) => Array.from(value, (one, i) => one + k * Math.sqrt(variance[i]! || 0))));
  const us = ends(u, uu), vs = ends(v, vv);
  if (!us || !vs) return;
  const left = 56, right = pen.w - 14, top = 24, bottom = pen.h - 42, span = Math.max((us[1] - us[0]) / (right - left), (vs[1] - vs[0]) / (bottom - top)) * 1.05 || 1e-3;
  const mu = (us[0] + us[1]) / 2, mv = (vs[0] + vs[1]) / 2, w = (span * (right - left)) / 2, h = (span * (bottom - top)) / 2;
  const x = scale(mu - w, mu + w, left, right), y = scale(mv - h, mv + h, top, bottom); // v points down
  yAxis(pen, y, left, right, {label: 'v, px, downwards'});
  xAxis(pen, x, top, bottom, {label: 'u, px'});
  const order = Array.from(u.keys()).filter((i) => Number.isFinite(u[i]! + v[i]!)).sort((a, b) => points.number('range_m', a) - points.number('range_m', b));
  pen.path(order.flatMap((i) => [x(u[i]!), y(v[i]!)]), pen.c.red, 1.4);
  order.slice(0, most).forEach((i, place) => {
    const ring = ellipsePlaces(x(u[i]!), y(v[i]!), uu[i]!, uv[i]!, vv[i]!, 3 / span);
    pen.fill(ring, faded(pen.c.blue, 0.16)), pen.path(ring, pen.c.blue, 1.5, [], true);
    pen.circle(x(u[i]!), y(v[i]!), 3.4, pen.c.red);
    if (order.length <= 24) pen.text(`${num(points.number('range_m', i), 3)} m`, x(u[i]!) + 8, y(v[i]!) + (place % 2 ? 12 : -10), {size: 11.5, weight: 650});
    pen.hit({x: x(u[i]!), y: y(v[i]!), r: 6, tip: () => [`range ${num(points.number('range_m', i), 4)} m`, `u ${withSigma(u[i]!, Math.sqrt(uu[i]!), 'px')}`, `v ${withSigma(v[i]!, Math.sqrt(vv[i]!), 'px')} (3σ)`]});
  });
}

export const projectImage: Figure = {
  id: 'picture', isOptional: true, title: 'Where in the image does it lie?', note: 'px · ellipse: 3σ', span: 16,
  draw(host, doc) {
    const points = doc.table('points');
    if (!points || !points.hasValues('u_px')) return null;
    const count = Math.min(most, points.rows);
    new Chart(host, {height: 360, isFilling: true, label: `${points.rows} readings in the image`}, (pen) => drawPoints(pen, points));
    return {marks: count, rows: count, tables: [points], words: `${points.rows} readings`, good: `Dots: where the point of a reading is seen${points.rows > 1 ? '; line: along the beam, from near to far' : ''}.`};
  },
};

/** Of a rig: the pixel of the point in each head's image. */
export const projectHeads: Figure = {
  id: 'heads', isOptional: true, title: 'Where does each head see the point?', note: 'px', span: 12,
  draw(host, doc) {
    const indices = [0, 1, 2, 3, 4, 5, 6, 7].filter((k) => Number.isFinite(doc.estimate(`heads[${k}].id`)));
    if (indices.length === 0) return null;
    const n = (k: number, name: string) => doc.estimate(`heads[${k}].${name}`), cell = (value: number, digits = 5) => el('td', {class: 'value'}, num(value, digits));
    host.append(el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...['', 'u, px', 'v, px', 'camera x, m', 'y, m', 'z, m'].map((word) => el('th', {}, word)))),
      el('tbody', {}, ...indices.map((k) => el('tr', {}, el('th', {}, `head ${n(k, 'id')}`), cell(n(k, 'px[0]')), cell(n(k, 'px[1]')), ...[0, 1, 2].map((i) => cell(n(k, `cam_centre_in_world_m[${i}]`), 4)))))));
    return {marks: indices.length, rows: indices.length, tables: [], words: `${indices.length} heads`, good: 'A dash: the point is not in view of that head.'};
  },
};
