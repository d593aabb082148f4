// What next? The worst 3σ now and after the best next photo, and how to hold the board for it.
import {Chart, type Pen} from '../core/chart';
import type {Doc, Table} from '../core/document';
import type {Figure} from '../core/figure';
import {degrees, num} from '../core/format';
import {panelIn} from '../core/panel';
import {column, lensOf, move, norm, poseOf, type Lens, type Pose, type V3} from '../core/rigid';
import {scale} from '../core/scale';
import {largestSize} from '../core/stats';
import {calibrateScene} from './calibrate_scene';

interface Board {
  cols: number;
  rows: number;
  square_m: number;
}

function worstNow(doc: Doc): number {
  for (const name of ['sigma_infinity', 'sigma_working']) {
    const worst = 3 * largestSize(doc.pixelGrid(name)?.values('sigma_px') ?? []);
    if (worst > 0) return worst;
  }
  return NaN;
}

function drawBoard(pen: Pen, lens: Lens, board: Board, pose: Pose): void {
  const panel = panelIn(lens, 0, 0, pen.w, pen.h);
  pen.rect(panel.x, panel.y, panel.w, panel.h, pen.c.panel, pen.c.soft);
  // A sketch: distortion is omitted, as the board may reach beyond what the lens model knows.
  const at = (c: number, r: number): [number, number] => {
    const p: V3 = move(pose, [c * board.square_m, r * board.square_m, 0]);
    return p[2] > 1e-6 ? panel.at((lens.fx * p[0]) / p[2] + lens.cx, (lens.fy * p[1]) / p[2] + lens.cy) : [NaN, NaN];
  };
  const quad = (c0: number, r0: number, c1: number, r1: number) => [...at(c0, r0), ...at(c1, r0), ...at(c1, r1), ...at(c0, r1)];
  pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
    pen.fill(quad(-1.4, -1.4, board.cols + 0.4, board.rows + 0.4), '#f4f6f8');
    if (board.cols * board.rows < 2500)
      for (let r = -1; r < board.rows; ++r)
        for (let c = -1; c < board.cols; ++c) if ((r + c) % 2 === 0) pen.fill(quad(c, r, c + 1, r + 1), '#20262d');
    pen.path(quad(-1.4, -1.4, board.cols + 0.4, board.rows + 0.4), pen.c.orange, 2, [], true);
  });
}

function drawGains(pen: Pen, now: number, next: Table): void {
  const bars: [string, number][] = Number.isFinite(now) ? [['now', now]] : [];
  for (let i = 0; i < Math.min(5, next.rows); ++i) bars.push([i === 0 ? 'with the photo sketched' : `with choice ${i + 1}`, next.number('worst_3sigma_px', i)]);
  const left = 160, x = scale(0, Math.max(...bars.map(([, v]) => v || 0)) || 1, left, pen.w - 70), pitch = (pen.h - 20) / bars.length;
  pen.text('worst 3σ of projection', 0, 8, {size: 11.5, weight: 600});
  bars.forEach(([words, value], i) => {
    const y = 22 + pitch * i;
    pen.text(words, left - 8, y + pitch / 2 - 2, {align: 'right', size: 11.5, colour: pen.c.soft});
    pen.rect(left, y, Math.max(1.5, x(value) - left), pitch - 5, i === 0 && Number.isFinite(now) ? pen.c.soft : pen.c.green);
    pen.text(`${num(value, 2)} px`, x(value) + 7, y + pitch / 2 - 2, {size: 11.5, weight: 650});
    pen.hit({x: (left + x(value)) / 2, y: y + pitch / 2, w: x(value) - left, h: pitch, tip: () => [words, `worst 3σ ${num(value, 4)} px`]});
  });
}

export const nextPhoto: Figure = {
  id: 'next', title: 'What next?', note: 'the photo that would help most', span: 8,
  draw(host, doc, selection) {
    const next = doc.table('next'), {board} = calibrateScene(doc, selection), lens = lensOf(doc);
    if (!next) return null;
    const pose = poseOf(next, 'cam_from_board', 0), now = worstNow(doc);
    let words = '';
    if (pose && board) {
      const middle = move(pose, [0.5 * board.square_m * (board.cols - 1), 0.5 * board.square_m * (board.rows - 1), 0]);
      const tilt = Math.acos(Math.min(1, Math.abs(column(pose.r, 2)[2]))) * degrees;
      words = `Board ${num(norm(middle), 2)} m away, tilted ${tilt.toFixed(0)}° from the image plane, where the sketch shows it: the worst 3σ falls from ${num(now, 2)} to ${num(next.number('worst_3sigma_px', 0), 2)} px.`;
      if (lens) new Chart(host, {height: 140, aspect: lens.height / lens.width, most: 330, label: `Sketch of the best next photo. ${words}`}, (pen) => drawBoard(pen, lens, board, pose));
    }
    new Chart(host, {height: 40 + 24 * (Math.min(5, next.rows) + 1), label: words}, (pen) => drawGains(pen, now, next));
    return {marks: next.rows, rows: next.rows, tables: [next], words, good: words};
  },
};
