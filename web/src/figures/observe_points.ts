// Does each point fit? The cloud of residuals, and each point's RMS; where the points were seen in the image.
import {Chart, type Pen} from '../core/chart';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num} from '../core/format';
import {panelIn} from '../core/panel';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent, lengths, quantile, roundUp125} from '../core/stats';
import type {Doc} from '../core/document';

interface OfPoint {
  point: number;
  count: number;
  rms_px: number;
  q95_px: number;
}

function byPoint(point: Float64Array, sizes: Float64Array): OfPoint[] {
  const groups = new Map<number, number[]>();
  point.forEach((p, i) => {
    if (!Number.isFinite(sizes[i]!)) return;
    const group = groups.get(p);
    if (group) group.push(sizes[i]!);
    else groups.set(p, [sizes[i]!]);
  });
  return [...groups].map(([p, all]) => ({point: p, count: all.length, rms_px: Math.sqrt(all.reduce((s, v) => s + v * v, 0) / all.length), q95_px: quantile(all, 0.95)})).sort((a, b) => b.rms_px - a.rms_px);
}

function drawCloud(pen: Pen, du: Float64Array, dv: Float64Array, limit: number, sigma_px: number): void {
  const side = Math.min(pen.w - 60, pen.h - 62), left = 46 + Math.max(0, (pen.w - 60 - side) / 2), top = 20;
  const x = scale(-limit, limit, left, left + side), y = scale(-limit, limit, top, top + side); // v points down
  yAxis(pen, y, left, left + side, {label: 'residual v, px, downwards', wanted: 4});
  xAxis(pen, x, top, top + side, {label: 'residual u, px', wanted: 4});
  pen.clipped(left, top, side, side, () => {
    const r = du.length > 2000 ? 1.1 : 1.8;
    pen.g.globalAlpha = du.length > 2000 ? 0.45 : 0.7;
    pen.g.fillStyle = pen.c.blue;
    for (let i = 0; i < du.length; ++i) if (Number.isFinite(du[i]! + dv[i]!)) pen.g.fillRect(x(du[i]!) - r, y(dv[i]!) - r, 2 * r, 2 * r);
    pen.g.globalAlpha = 1;
    if (sigma_px > 0) {
      pen.g.setLineDash([5, 4]);
      pen.circle(x(0), y(0), x(3 * sigma_px) - x(0), null, pen.c.ink, 1.4);
      pen.g.setLineDash([]);
    }
  });
  if (sigma_px > 0) pen.text('circle: 3σ', left + side - 6, top + 10, {align: 'right', size: 11, colour: pen.c.soft});
}

function drawBars(pen: Pen, points: OfPoint[]): void {
  const most = Math.min(points.length, Math.max(4, Math.floor((pen.h - 70) / 15))), shown = points.slice(0, most);
  const left = 46, right = pen.w - 14, x = scale(0, 1.1 * Math.max(...shown.map((p) => p.q95_px)), left, right), bottom = pen.h - 44, pitch = Math.min(24, (bottom - 22) / most);
  pen.text(`RMS by point, tick 95 %${most < points.length ? `; ${most} of ${points.length}` : ''}`, left, 9, {size: 11.5, weight: 600});
  xAxis(pen, x, 22, bottom, {label: 'residual, px', wanted: 4});
  shown.forEach((p, i) => {
    const y = 22 + pitch * i;
    pen.text(`p${p.point + 1}`, left - 6, y + pitch / 2, {align: 'right', size: 11, colour: pen.c.soft});
    pen.rect(left, y + 1, x(p.rms_px) - left, pitch - 2, pen.c.blue);
    pen.line(x(p.q95_px), y + 1, x(p.q95_px), y + pitch - 1, pen.c.ink, 2);
    pen.hit({x: (left + right) / 2, y: y + pitch / 2, w: right - left, h: pitch, tip: () => [`p${p.point + 1}: ${p.count} pixels`, `RMS ${num(p.rms_px, 3)} px, 95 % below ${num(p.q95_px, 3)} px`]});
  });
}

export const observePoints: Figure = {
  id: 'points', title: 'Does each point fit?', note: 'predicted − seen, px', span: 12,
  draw(host, doc) {
    const table = doc.table('points');
    if (!table) return null;
    const du = table.numbers('residual_u_px'), dv = table.numbers('residual_v_px'), sizes = lengths(du, dv), known = sizes.filter(Number.isFinite).length;
    if (known === 0) return null;
    const given = doc.estimate('sigma_px'), sigma_px = given > 0 ? given : quantile(sizes, 0.5) / 1.1774; // √(2 ln 2): median of a normal vector's length
    const limit = roundUp125(Math.max(1.05 * quantile(sizes, 0.998), 3.3 * sigma_px)), points = byPoint(table.numbers('point'), sizes);
    const inside = sizes.filter((s) => s <= 3 * sigma_px).length, row = el('div', {class: 'row'}), left = el('div'), right = el('div');
    host.append(row);
    row.append(left, right);
    const words = `${((100 * inside) / known).toFixed(1)} % of ${known} pixels are inside 3σ (98.9 % expected)`;
    new Chart(left, {height: 330, label: words}, (pen) => drawCloud(pen, du, dv, limit, sigma_px));
    new Chart(right, {height: 330, label: `RMS of ${points.length} points`}, (pen) => drawBars(pen, points));
    return {marks: known, rows: known, tables: [table], words, good: `Good: a round cloud inside the circle, all points alike. Here ${words}. A point that stands out moves by itself, or its tracker slips.`};
  },
};

function frameOf(doc: Doc, u: Float64Array, v: Float64Array): {width: number; height: number} | null {
  const ends = [extent(u), extent(v)];
  return doc.imageSize ?? (ends[0] && ends[1] ? {width: ends[0][1] * 1.05 + 1, height: ends[1][1] * 1.05 + 1} : null);
}

export const observeTracks: Figure = {
  id: 'tracks', title: 'Where were the points seen?', note: 'in the image', span: 8,
  draw(host, doc) {
    const table = doc.table('points');
    if (!table || !table.hasValues('u_px')) return null;
    const u = table.numbers('u_px'), v = table.numbers('v_px'), point = table.numbers('point'), size = frameOf(doc, u, v);
    if (!size) return null;
    const tracks = new Map<number, number[]>();
    point.forEach((p, i) => {
      const track = tracks.get(p);
      if (track) track.push(i);
      else tracks.set(p, [i]);
    });
    const shown = [...tracks].sort((a, b) => b[1].length - a[1].length).slice(0, 60), isNamed = shown.length <= 24;
    new Chart(host, {height: 160, aspect: size.height / size.width, most: 420, label: `${shown.length} points in the image`}, (pen) => {
      const panel = panelIn(size, 0, 0, pen.w, pen.h);
      pen.rect(panel.x, panel.y, panel.w, panel.h, pen.c.panel, pen.c.soft);
      pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
        for (const [, rows] of shown) pen.path(rows.flatMap((i) => panel.at(u[i]!, v[i]!)), pen.c.blue, 1.3);
        const cx = doc.estimate('camera.cx'), cy = doc.estimate('camera.cy');
        if (Number.isFinite(cx + cy) && doc.isAnswer) {
          const [x, y] = panel.at(cx, cy);
          pen.line(x - 7, y, x + 7, y, pen.c.orange, 2), pen.line(x, y - 7, x, y + 7, pen.c.orange, 2);
          pen.hit({x, y, tip: () => ['principal point', `${num(cx, 5)}, ${num(cy, 5)} px`]});
        }
        for (const [p, rows] of shown) {
          const [x, y] = panel.at(u[rows[0]!]!, v[rows[0]!]!);
          pen.circle(x, y, 3.2, pen.c.ink);
          if (isNamed) pen.text(`p${p + 1}`, x + 7 > panel.x + panel.w - 26 ? x - 26 : x + 7, Math.min(panel.y + panel.h - 8, y + 2), {size: 11});
          pen.hit({x, y, tip: () => [`p${p + 1}, first seen at ${num(u[rows[0]!]!, 4)}, ${num(v[rows[0]!]!, 4)} px`, `${rows.length} pixels shown`]});
        }
      });
    });
    return {marks: shown.length, rows: Math.min(60, tracks.size), tables: [table], words: `${tracks.size} points`,
      good: 'Good: points all over the image, not in one line, moving both across and up and down. Dots: where each was first seen; cross: principal point.'};
  },
};
