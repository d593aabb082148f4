// How well is it known? 3σ ellipses of origin and direction, where the spot will be; and what more shots do.
import {Chart, type Pen} from '../core/chart';
import {css, cividis, faded, onto} from '../core/colours';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {degrees, num} from '../core/format';
import {ellipsePlaces} from '../core/panel';
import {dot, cross, unit, type V3} from '../core/rigid';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent, finite, roundUp125} from '../core/stats';
import {rangefinderScene, type Beam} from './rangefinder_scene';

interface Ellipse {
  title: string; unit: string; names: [string, string];
  xx: number; xy: number; yy: number; // in that unit, squared
  limit: number;
}

function ellipsesOf(beam: Beam): Ellipse[] {
  const cov = beam.cov!, o = (i: number, j: number) => 1e6 * cov[i]![j]!;
  const x = unit(cross([0, 1, 0], beam.direction)), y = cross(beam.direction, x);
  const form = (a: V3, b: V3) => 1e6 * dot(a, [0, 1, 2].map((i) => dot(cov[3 + i]!.slice(3, 6) as V3, b)) as V3);
  const origin = roundUp125(3.2 * Math.sqrt(Math.max(o(0, 0), o(1, 1), o(2, 2)))), direction = roundUp125(3.2 * Math.sqrt(Math.max(form(x, x), form(y, y))));
  // One scale for both of the origin: which coordinate is the weak one shows at a glance.
  return [{title: 'origin, across the view', unit: 'mm', names: ['x', 'y'], xx: o(0, 0), xy: o(0, 1), yy: o(1, 1), limit: origin},
    {title: 'origin, from above', unit: 'mm', names: ['x', 'z'], xx: o(0, 0), xy: -o(0, 2), yy: o(2, 2), limit: origin},
    {title: 'direction', unit: 'mrad', names: ['x', 'y'], xx: form(x, x), xy: form(x, y), yy: form(y, y), limit: direction}];
}

function drawEllipse(pen: Pen, e: Ellipse): void {
  const side = Math.min(pen.w - 46, pen.h - 62), left = 40, top = 20, x = scale(-e.limit, e.limit, left, left + side), y = scale(-e.limit, e.limit, top, top + side);
  yAxis(pen, y, left, left + side, {label: e.unit, wanted: 4, format: (v) => num(e.names[1] === 'z' ? -v : v, 3)});
  xAxis(pen, x, top, top + side, {wanted: 4});
  const places = ellipsePlaces(x(0), y(0), e.xx, e.xy, e.yy, 3 * (x(1) - x(0)));
  pen.fill(places, faded(pen.c.blue, 0.25));
  pen.path(places, pen.c.blue, 1.8, [], true);
  const words = `3σ: ${e.names[0]} ${num(3 * Math.sqrt(e.xx), 2)}, ${e.names[1]} ${num(3 * Math.sqrt(e.yy), 2)} ${e.unit}`;
  pen.text(words, left + side / 2, top + side + 28, {align: 'center', size: 11.5, colour: pen.c.soft});
  pen.hit({x: x(0), y: y(0), w: side, h: side, tip: () => [e.title, words]});
}

export const rangefinderPrecision: Figure = {
  id: 'precision', title: 'How well is it known?', note: '3σ, mm, mrad, px', span: 11,
  draw(host, doc, selection) {
    const beam = rangefinderScene(doc, selection)?.beam;
    if (!beam?.cov) return null;
    const row = el('div', {class: 'row'}), ellipses = ellipsesOf(beam);
    host.append(row);
    for (const ellipse of ellipses) {
      const part = el('div');
      part.append(el('p', {class: 'caption'}, ellipse.title));
      row.append(part);
      new Chart(part, {height: 160, aspect: 1.12, most: 260, label: ellipse.title}, (pen) => drawEllipse(pen, ellipse));
    }
    const spots = [0, 1, 2, 3, 4, 5].map((i) => [doc.estimate(`spot_sigma_at_m[${i}]`), 3 * doc.estimate(`spot_sigma_px[${i}]`)] as const).filter(([at, s]) => Number.isFinite(at + s));
    if (spots.length > 0)
      new Chart(host, {height: 30 + 22 * spots.length, label: 'Where the spot will be seen'}, (pen) => {
        const x = scale(0, 1.18 * Math.max(...spots.map(([, s]) => s)), 70, pen.w - 10);
        pen.text('3σ of where the spot will be seen, for an exact reading', 0, 8, {size: 11.5, weight: 600});
        spots.forEach(([at, s], i) => {
          const y = 20 + 22 * i;
          pen.text(`at ${num(at, 2)} m`, 62, y + 8, {align: 'right', size: 11, colour: pen.c.soft});
          pen.rect(70, y, x(s) - 70, 16, pen.c.blue);
          pen.text(`${num(s, 2)} px`, x(s) + 6, y + 8, {size: 11.5, weight: 600});
          pen.hit({x: (70 + x(s)) / 2, y: y + 8, w: x(s) - 70, h: 18, tip: () => [`at ${num(at, 2)} m`, `3σ ${num(s, 3)} px`]});
        });
      });
    return {marks: ellipses.length + spots.length, rows: ellipses.length + spots.length, tables: [], words: '', good: 'Good: round and small. A long one shows what the shots leave open.'};
  },
};

export const rangefinderCounts: Figure = {
  id: 'counts', title: 'Do more shots help?', note: 'mm, mrad', span: 5,
  draw(host, doc) {
    const table = doc.table('by_count');
    if (!table || !doc.isAnswer) return null;
    legend(host, [{words: '3σ', colour: 'var(--blue)'}, {words: 'Cramér–Rao', colour: 'var(--orange)', look: 'dash'}]);
    const n = table.numbers('num_shots');
    for (const [name, label] of [['origin_m', '3σ of the origin, mm'], ['direction_rad', '3σ of the direction, mrad']] as const) {
      const sigma = table.numbers(`sigma_${name}`).map((v) => 3e3 * v), bound = table.numbers(`bound_${name}`).map((v) => 3e3 * v), ends = extent(sigma.filter((v) => v > 0), bound.filter((v) => v > 0));
      if (!ends) continue;
      new Chart(host, {height: 150, isFilling: true, label}, (pen) => {
        const left = 42, right = pen.w - 8, bottom = pen.h - 36, x = scale(Math.min(...n), Math.max(...n), left, right), y = scale(ends[0] / 1.2, ends[1] * 1.2, bottom, 22, true);
        yAxis(pen, y, left, right, {label, wanted: 4});
        xAxis(pen, x, 22, bottom, {label: 'shots', isGridHidden: true, wanted: 4});
        pen.path(Array.from(n).flatMap((v, i) => [x(v), y(bound[i]!)]), faded(pen.c.orange, 0.9), 4, [7, 4]); // broad and below: as good as can be lies on it
        pen.path(Array.from(n).flatMap((v, i) => [x(v), y(sigma[i]!)]), pen.c.blue, 1.8);
        n.forEach((v, i) => (pen.circle(x(v), y(sigma[i]!), 2.6, pen.c.blue), pen.hit({x: x(v), y: y(sigma[i]!), r: 3, tip: () => [`${v} shots`, `${num(sigma[i]!, 3)}, at best ${num(bound[i]!, 3)}`]})));
      });
    }
    return {marks: table.rows, rows: table.rows, tables: [table], words: '', good: 'Good: it has flattened, close to its bound; while it still falls steeply, more shots help.'};
  },
};

export const rangefinderNext: Figure = {
  id: 'next', title: 'Which shot next?', note: 'σ that one more shot would leave, mm', span: 8,
  draw(host, doc) {
    const grid = doc.grid('next_shot'), sigma = grid?.values('sigma_point_m'), distance = grid?.values('distance_m'), tilt = grid?.values('tilt_rad');
    if (!sigma || !distance || !tilt) return null;
    const distances = [...new Set(finite(distance))].sort((a, b) => a - b), tilts = [...new Set(finite(tilt))].sort((a, b) => a - b);
    const ends = extent(sigma)!, high = Math.max(ends[1], 1.25 * ends[0]); // where all choices are alike they look alike
    const best = sigma.indexOf(ends[0]), words = `a board ${num(distance[best]!, 2)} m away along the beam, tilted ${(degrees * tilt[best]!).toFixed(0)}°`;
    new Chart(host, {height: 220, isFilling: true, label: `Best next shot: ${words}`}, (pen) => {
      const left = 40, top = 8, w = (pen.w - left - 4) / distances.length, h = Math.min(64, (pen.h - 100) / tilts.length), bottom = top + h * tilts.length;
      sigma.forEach((value, i) => {
        const col = distances.indexOf(distance[i]!), row = tilts.indexOf(tilt[i]!), x = left + w * col, y = top + h * row;
        const colour = cividis((value - ends[0]) / (high - ends[0]));
        if (!Number.isFinite(value)) return pen.text('–', x + w / 2, y + h / 2, {align: 'center', colour: pen.c.soft});
        pen.rect(x, y, w - 1.5, h - 1.5, css(colour));
        if (w > 34) pen.text(num(1e3 * value, 3), x + w / 2, y + h / 2, {align: 'center', size: 11.5, colour: onto(colour)});
        if (i === best) pen.rect(x + 1, y + 1, w - 3.5, h - 3.5, null, pen.c.orange, 3);
        pen.hit({x: x + w / 2, y: y + h / 2, w, h, tip: () => [`board ${num(distance[i]!, 3)} m away, tilted ${(degrees * tilt[i]!).toFixed(0)}°`, `leaves σ ${num(1e3 * value, 4)} mm`]});
      });
      tilts.forEach((t, row) => pen.text(`${(degrees * t).toFixed(0)}°`, left - 6, top + h * (row + 0.5), {align: 'right', size: 11, colour: pen.c.soft}));
      distances.forEach((d, col) => pen.text(num(d, 2), left + w * (col + 0.5), bottom + 11, {align: 'center', size: 11, colour: pen.c.soft}));
      pen.text('distance of the board along the beam, m; its tilt downwards', left, bottom + 28, {size: 11.5, colour: pen.c.soft});
      for (let k = 0; k < 100; ++k) pen.rect(left + ((pen.w - left - 4) * k) / 100, bottom + 44, (pen.w - left) / 100 + 0.5, 9, css(cividis(k / 99)));
      pen.text(`${num(1e3 * ends[0], 3)} mm`, left, bottom + 64, {size: 11, colour: pen.c.soft});
      pen.text(`${num(1e3 * high, 3)} mm`, pen.w - 4, bottom + 64, {align: 'right', size: 11, colour: pen.c.soft});
    });
    return {marks: sigma.filter(Number.isFinite).length, rows: sigma.filter(Number.isFinite).length, tables: [], words,
      good: `Best, framed: ${words}. A point along the beam then has σ ${num(1e3 * ends[0], 3)} mm; after the worst choice ${num(1e3 * ends[1], 3)} mm.`};
  },
};
