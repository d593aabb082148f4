// servo: pixel error; path over the image; angles asked, measured, predicted; controllers compared; robustness.
import {Chart} from '../core/chart';
import {cividis, css, onto} from '../core/colours';
import type {Doc, Table} from '../core/document';
import {el} from '../core/dom';
import {choice, legend, type Figure} from '../core/figure';
import {degrees, num, percent} from '../core/format';
import {contourSegments} from '../core/contour';
import {Grid} from '../core/document';
import {scale, xAxis} from '../core/scale';
import {bandAboutZero, SeriesPlot, type EventMark, type Level} from '../core/series';
import {extent, quantile, scaled} from '../core/stats';
import {scatter} from './scatter';

interface HeadRows {
  head: number;
  rows: number[];
  t: Float64Array;
  column(name: string): Float64Array;
  events: EventMark[];
}

function headsOf(control: Table): HeadRows[] {
  const head = control.numbers('head'), t = control.numbers('t_s'), ids = [...new Set(head)].slice(0, 8);
  return ids.map((id) => {
    const rows = Array.from(head.keys()).filter((i) => (head[i] === id || (Number.isNaN(id) && Number.isNaN(head[i]!))) && Number.isFinite(t[i]!)).sort((a, b) => t[a]! - t[b]!);
    return {head: id, rows, t: Float64Array.from(rows, (i) => t[i]!), column: (name) => Float64Array.from(rows, (i) => control.number(name, i)),
      events: rows.map((i) => ({t: t[i]!, words: control.text('event', i)})).filter((one) => one.words && !/^(none|searching|started|seen)$/.test(one.words)).slice(0, 200)};
  });
}

/** One part a head, one shown at a time. */
function perHead(host: HTMLElement, heads: HeadRows[], draw: (host: HTMLElement, head: HeadRows) => void): void {
  const parts = heads.map(() => el('div', {class: 'body'}));
  if (heads.length > 1) choice(host, 'head', heads.map((one) => `head ${one.head}`), (i) => parts.forEach((part, k) => (part.hidden = k !== i, part.style.display = k === i ? '' : 'none')));
  heads.forEach((one, i) => {
    host.append(parts[i]!);
    draw(parts[i]!, one);
    if (i > 0) parts[i]!.style.display = 'none';
  });
}

export const servoError: Figure = {
  id: 'error', title: 'How far from the centre was the target?', note: 'px, ± 3σ predicted', span: 14,
  draw(host, doc, selection) {
    const control = doc.table('control');
    if (!control || !control.hasValues('error_u_px')) return null;
    const spec = doc.estimate('specification_px'), heads = headsOf(control), levels: Level[] = [{value: 0, dash: []}];
    if (spec > 0) levels.push({value: spec, words: `specification ${num(spec, 3)} px`, colour: 'red'}, {value: -spec, colour: 'red'});
    let inside = 0, known = 0;
    for (const name of ['error_u_px', 'error_v_px']) control.numbers(name).forEach((v, i) => {
      const s = control.number(`sigma_${name}`, i);
      if (Number.isFinite(v) && s > 0) ++known, (inside += Number(Math.abs(v) <= 3 * s));
    });
    perHead(host, heads, (part, head) => {
      for (const axis of ['u', 'v'] as const) {
        const value = head.column(`error_${axis}_px`), sigma = head.column(`sigma_error_${axis}_px`), limit = 1.15 * Math.max(quantile(value.map(Math.abs), 0.997), 3 * (quantile(sigma, 0.9) || 0), spec > 0 ? 1.1 * spec : 0);
        new SeriesPlot(part, {t: head.t, selection, label: `error ${axis}, px`, aside: `RMS ${num(Math.sqrt(value.filter(Number.isFinite).reduce((s, v) => s + v * v, 0) / Math.max(1, value.filter(Number.isFinite).length)), 3)} px`, xLabel: axis === 'v' ? 'time, s' : '', height: axis === 'v' ? 182 : 158, isFilling: true, aria: `pixel error ${axis}`, levels,
          bands: [bandAboutZero(sigma, axis === 'u' ? 'blue' : 'orange')], lines: [{name: `error ${axis}`, values: value, colour: axis === 'u' ? 'blue' : 'orange', width: 1.3}], range: limit > 0 ? [-limit, limit] : undefined, events: axis === 'u' ? head.events : [],
          tip: (i) => [`error ${axis} ${num(value[i]!, 3)} px, 3σ predicted ${num(3 * sigma[i]!, 3)} px`]});
      }
    });
    return {marks: control.rows, rows: control.rows, tables: [control], words: '', good: `Good: between the specification's lines, and inside the band that the controller expected: ${percent(inside, known, 1)} are (99.7 % expected).`};
  },
};

export const servoImage: Figure = {
  id: 'picture', title: 'Where in the image was it?', note: 'target from the image’s centre, px', span: 10,
  draw(host, doc, selection) {
    const control = doc.table('control');
    if (!control || !control.hasValues('error_u_px')) return null;
    const heads = headsOf(control), spec = doc.estimate('specification_px'), charts: Chart[] = [];
    const reach = quantile([...control.numbers('error_u_px'), ...control.numbers('error_v_px')].map(Math.abs), 0.999);
    perHead(host, heads, (part, head) => {
      const u = head.column('error_u_px'), v = head.column('error_v_px'), every = Math.max(1, Math.floor(u.length / 3000)), limit = quantile([...u, ...v].map(Math.abs), 0.999) || 1;
      const dots = head.rows.map((_, i) => i).filter((i) => i % every === 0 && Number.isFinite(u[i]! + v[i]!)).map((i) => ({x: u[i]!, y: -v[i]!, size: 1.8, colour: (pen: {c: {blue: string}}) => pen.c.blue, pick: () => selection.at(head.t[i]!), tip: () => [`${num(head.t[i]!, 5)} s`, `u ${num(u[i]!, 3)}, v ${num(v[i]!, 3)} px`]}));
      charts.push(scatter(part, dots, {xLabel: 'error u, px', yLabel: 'error v, px, upwards', height: 330, isFilling: true, isSquare: true, label: 'errors in the image', include: [[-limit, -limit], [limit, limit]],
        below: (pen, x, y) => { if (spec > 0) pen.g.setLineDash([6, 4]), pen.circle(x(0), y(0), x(spec) - x(0), null, pen.c.red, 1.6), pen.g.setLineDash([]); pen.line(x(0) - 8, y(0), x(0) + 8, y(0), pen.c.ink, 1.5), pen.line(x(0), y(0) - 8, x(0), y(0) + 8, pen.c.ink, 1.5); }}));
    });
    return {marks: control.rows, rows: control.rows, tables: [control], words: '', good: `Good: a round cloud about the centre. ${spec > 0 ? (spec < reach ? `Dashed: the specification, ${num(spec, 3)} px.` : `The specification, ${num(spec, 3)} px, lies outside of what is shown.`) : ''}`};
  },
};

export const servoAngles: Figure = {
  id: 'angles', title: 'Did the head follow?', note: 'asked · measured · predicted, °; rate, °/s', span: 14,
  draw(host, doc, selection) {
    const control = doc.table('control');
    if (!control || !control.hasValues('measured_pan_rad')) return null;
    legend(host, [{words: 'asked', colour: 'var(--ink)', look: 'dash'}, {words: 'measured', colour: 'var(--blue)'}, {words: 'predicted', colour: 'var(--orange)'}, {words: 'rate', colour: 'var(--green)'}]);
    perHead(host, headsOf(control), (part, head) => {
      const c = (name: string) => scaled(head.column(name), degrees);
      for (const axis of ['pan', 'tilt'] as const)
        new SeriesPlot(part, {t: head.t, selection, label: `${axis}, °`, xLabel: '', height: 128, isFilling: true, aria: `${axis} over time`, lines: [{name: 'asked', values: c(`asked_${axis}_rad`), colour: 'ink', dash: [5, 4], width: 1.2}, {name: 'measured', values: c(`measured_${axis}_rad`), colour: 'blue'}, {name: 'predicted', values: c(`predicted_${axis}_rad`), colour: 'orange', width: 1.1}]});
      new SeriesPlot(part, {t: head.t, selection, label: 'rates, °/s', aside: '— pan  - - tilt', xLabel: 'time, s', height: 132, isFilling: true, aria: 'rates', lines: [{name: 'pan', values: c('rate_pan_rad_s'), colour: 'green'}, {name: 'tilt', values: c('rate_tilt_rad_s'), colour: 'green', dash: [6, 3]}]});
    });
    return {marks: control.rows, rows: control.rows, tables: [control], words: '', good: 'Good: measured lies on asked; predicted runs ahead of measured by the delay.'};
  },
};

interface Contender {
  name: string;
  rms: number[];
  p95: number[];
}
function contenders(trials: Table, column: string): Contender[] {
  const by = new Map<string, Contender>();
  for (let i = 0; i < trials.rows; ++i) {
    const name = trials.text(column, i), one = by.get(name) ?? {name, rms: [], p95: []};
    one.rms.push(trials.number('rms_px', i)), one.p95.push(trials.number('p95_px', i));
    by.set(name, one);
  }
  return [...by.values()].sort((a, b) => quantile(a.rms, 0.5) - quantile(b.rms, 0.5));
}

/** RMS and 95 % of each, over the same seeds, best first; what the figure's words say of the first two. */
function compare(host: HTMLElement, trials: Table, column: string, spec: number): {words: string} | null {
    const all = contenders(trials, column), ends = extent(trials.numbers('rms_px').filter((v) => v > 0), trials.numbers('p95_px').filter((v) => v > 0));
    if (!ends) return null;
    legend(host, [{words: 'RMS of a seed', colour: 'var(--blue)', look: 'dot'}, {words: '95 % of a seed', colour: 'var(--orange)', look: 'square'}, {words: 'bar: 90 % of the seeds, line: median', colour: 'var(--soft)', look: 'band'}]);
    new Chart(host, {height: 80 + 62 * all.length, isFilling: true, label: `best: ${all[0]?.name}`}, (pen) => {
      const left = Math.min(150, 20 + Math.max(...all.map((one) => pen.width(one.name, 12)))), right = pen.w - 14, bottom = pen.h - 40, isLog = ends[1] > 6 * ends[0];
      const x = scale(isLog ? ends[0] / 1.3 : 0, isLog ? ends[1] * 1.3 : 1.06 * ends[1], left, right, isLog), pitch = (bottom - 10) / all.length;
      xAxis(pen, x, 8, bottom, {label: 'error, px'});
      if (spec > 0 && x.holds(spec)) pen.line(x(spec), 8, x(spec), bottom, pen.c.red, 1.5, [5, 4]), pen.text(`spec ${num(spec, 3)}`, x(spec) + (x(spec) > right - 70 ? -4 : 4), 12, {size: 11, colour: pen.c.red, align: x(spec) > right - 70 ? 'right' : 'left'});
      all.forEach((one, k) => {
        const y = 10 + pitch * (k + 0.5), row = (values: number[], dy: number, colour: string, isSquare: boolean, word: string) => {
          const [low, middle, high] = [0.05, 0.5, 0.95].map((q) => quantile(values, q)) as [number, number, number];
          pen.g.globalAlpha = 0.25, pen.rect(x(low), y + dy - 8, Math.max(2, x(high) - x(low)), 16, colour), (pen.g.globalAlpha = 1);
          values.forEach((v, i) => (isSquare ? pen.rect(x(v) - 2, y + dy - 2 + ((i % 5) - 2) * 2, 4, 4, colour) : pen.circle(x(v), y + dy + ((i % 5) - 2) * 2, 2.2, colour)));
          pen.line(x(middle), y + dy - 10, x(middle), y + dy + 10, pen.c.ink, 2.2);
          pen.hit({x: (left + right) / 2, y: y + dy, w: right - left, h: 18, tip: () => [`${one.name}: ${word}`, `median ${num(middle, 3)} px`, `90 % of ${values.length} seeds: ${num(low, 3)} … ${num(high, 3)} px`]});
        };
        pen.text(one.name, left - 8, y, {align: 'right', size: 12, weight: k === 0 ? 700 : 400});
        row(one.rms, -12, pen.c.blue, false, 'RMS');
        row(one.p95, 12, pen.c.orange, true, '95 %');
      });
    });
    const [first, second] = all, words = first && second ? `${first.name} has ${num(quantile(first.rms, 0.5), 3)} px RMS (median over seeds), ${second.name} ${num(quantile(second.rms, 0.5), 3)} px` : '';
    return {words};
}

export const servoCompare: Figure = {
  id: 'compare', title: 'Who does better?', note: 'RMS and 95 % over the same seeds, px', span: 10,
  draw(host, doc) {
    const trials = doc.table('trials'), compared = trials && compare(host, trials, 'controller', doc.estimate('specification_px'));
    if (!trials || !compared) return null;
    return {marks: trials.rows, rows: trials.rows, tables: [trials], words: compared.words, good: compared.words ? `Here ${compared.words}.` : undefined};
  },
};

/** A lens that zooms: the best controller by what its loop knows of it. */
export const servoLenses: Figure = {
  id: 'lenses', title: 'What does the loop know of the zoom?', note: 'RMS and 95 % over the same seeds, px', span: 10, isOptional: true,
  draw(host, doc) {
    const trials = doc.table('lenses'), compared = trials && compare(host, trials, 'intrinsics', doc.estimate('specification_px'));
    if (!trials || !compared) return null;
    return {marks: trials.rows, rows: trials.rows, tables: [trials], words: compared.words,
      good: `The best controller, three times: given – the rig’s focal length, whatever the lens does; observed – estimated on-line from what stands still in the images; true. ${compared.words ? `Here ${compared.words}.` : ''}`};
  },
};

export const servoFocal: Figure = {
  id: 'focal', title: 'Which focal length does the loop go by?', note: 'px, ± 3σ', span: 14, isOptional: true,
  draw(host, doc, selection) {
    const control = doc.table('control');
    if (!control || !control.hasValues('true_fx_px') || !doc.table('lenses')) return null;
    let within = 0, known = 0;
    control.numbers('fx_px').forEach((v, i) => {
      const s = control.number('sigma_fx_px', i);
      if (s > 0) ++known, (within += Number(Math.abs(v - control.number('true_fx_px', i)) <= 3 * s));
    });
    legend(host, [{words: 'the loop’s', colour: 'var(--blue)'}, {words: 'true', colour: 'var(--ink)', look: 'dash'}, ...(known ? [{words: '± 3σ', colour: 'var(--blue)', look: 'band' as const}] : [])]);
    perHead(host, headsOf(control), (part, head) => {
      const fx = head.column('fx_px'), sigma = head.column('sigma_fx_px'), truth = head.column('true_fx_px'), has = (i: number) => sigma[i]! > 0;
      const off = fx.map((v, i) => 100 * (v / truth[i]! - 1)), band = sigma.map((s, i) => 300 * s / truth[i]!), limit = 1.15 * Math.max(quantile(off.map(Math.abs), 0.995), 1e-3);
      new SeriesPlot(part, {t: head.t, selection, label: 'fx, px', xLabel: '', height: 158, isFilling: true, aria: 'focal length over time', bands: known ? [{low: fx.map((v, i) => (has(i) ? v - 3 * sigma[i]! : NaN)), high: fx.map((v, i) => (has(i) ? v + 3 * sigma[i]! : NaN)), colour: 'blue'}] : [],
        lines: [{name: 'the loop’s', values: fx, colour: 'blue', width: 1.6}, {name: 'true', values: truth, colour: 'ink', dash: [6, 4], width: 1.3}], tip: (i) => [`fx ${num(fx[i]!, 5)} px, true ${num(truth[i]!, 5)} px`]});
      new SeriesPlot(part, {t: head.t, selection, label: 'off by, %', xLabel: 'time, s', height: 150, isFilling: true, aria: 'error of the focal length', levels: [{value: 0, dash: []}], bands: known ? [{low: band.map((v) => -v), high: band, colour: 'blue'}] : [],
        lines: [{name: 'off by', values: off, colour: 'blue', width: 1.3}], range: [-limit, limit], tip: (i) => [`${num(off[i]!, 3)} %, 3σ ${num(band[i]!, 3)} %`]});
    });
    return {marks: control.rows, rows: control.rows, tables: [control], words: '', good: known ? `Good: on the true one, and inside the band: ${percent(within, known, 1)} are (99.7 % expected).` : 'Without σ: not observed.'};
  },
};

export const servoRobust: Figure = {
  id: 'robust', title: 'How robust is it?', note: 'RMS, px, with a wrong gain and time constant', span: 10,
  draw(host, doc) {
    const grid = doc.grid('robustness'), rms = grid?.values('rms_px'), gain = grid?.values('gain'), tau = grid?.values('tau');
    if (!grid || !rms || !gain || !tau || grid.cols < 2) return null;
    const spec = doc.estimate('specification_px'), ends = extent(rms)!, share = (v: number) => Math.log(v / ends[0]) / Math.log(ends[1] / ends[0] || 2);
    const within = spec > 0 ? rms.filter((v) => v <= spec).length : NaN;
    new Chart(host, {height: 300, isFilling: true, label: 'RMS over gain and time constant'}, (pen) => {
      const left = 52, top = 10, w = (pen.w - left - 8) / grid.cols, h = (pen.h - 64) / grid.rows, row = (i: number) => grid.rows - 1 - Math.floor(i / grid.cols), col = (i: number) => i % grid.cols;
      rms.forEach((v, i) => {
        const colour = cividis(share(v)), x = left + w * col(i), y = top + h * row(i);
        pen.rect(x, y, w - 1, h - 1, Number.isFinite(v) ? css(colour) : pen.c.panel);
        if (w > 30 && h > 14) pen.text(num(v, 2), x + w / 2, y + h / 2, {align: 'center', size: 11, colour: Number.isFinite(v) ? onto(colour) : pen.c.soft});
        pen.hit({x: x + w / 2, y: y + h / 2, w, h, tip: () => [`gain ×${num(gain[i]!, 3)}, time constant ×${num(tau[i]!, 3)}`, `RMS ${num(v, 3)} px`]});
      });
      const edge = new Grid('', {cols: grid.cols, rows: grid.rows, u0_px: 0, v0_px: 0, du_px: 1, dv_px: 1});
      if (spec > 0) for (const [u1, v1, u2, v2] of contourSegments(edge, rms, spec))
        for (const [colour, width] of [['#000', 5], ['#ff5a36', 2.5]] as const) pen.line(left + w * (u1 + 0.5), top + h * (grid.rows - 0.5 - v1), left + w * (u2 + 0.5), top + h * (grid.rows - 0.5 - v2), colour, width);
      for (let k = 0; k < grid.cols; ++k) pen.text(`×${num(tau[k]!, 2)}`, left + w * (k + 0.5), top + h * grid.rows + 11, {align: 'center', size: 11, colour: pen.c.soft});
      for (let k = 0; k < grid.rows; ++k) pen.text(`×${num(gain[k * grid.cols]!, 2)}`, left - 6, top + h * (grid.rows - 0.5 - k), {align: 'right', size: 11, colour: pen.c.soft});
      pen.text('true time constant over the modelled (across), true gain over the modelled (up)', left, pen.h - 18, {size: 11.5, colour: pen.c.soft});
    });
    return {marks: rms.length, rows: rms.length, tables: [], words: '', good: spec > 0 ? `${within === rms.length || within === 0 ? 'The specification' : 'Red line: the specification'}, ${num(spec, 3)} px, is met at ${percent(within, rms.length)} of these errors of the model.` : 'Good: dark over a wide field about ×1, ×1.'};
  },
};

export const servoLoops: Figure = {
  id: 'loops', title: 'Is the loop stable?', note: 'of each controller', span: 10,
  draw(host, doc: Doc) {
    const loops = doc.table('loops');
    if (!loops) return null;
    const cell = (text: string, isBad = false) => el('td', {class: `value${isBad ? ' state-bad' : ''}`}, text);
    host.append(el('div', {class: 'scroll'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...['controller', 'bandwidth, rad/s', 'phase margin, °', 'delay, samples', 'sampled radius'].map((word) => el('th', {}, word)))),
      ...Array.from({length: loops.rows}, (_, i) => el('tr', {}, el('th', {}, loops.text('controller', i)), cell(num(loops.number('bandwidth_rad_s', i), 3)), cell(num(loops.number('phase_margin_deg', i), 3), loops.number('phase_margin_deg', i) < 30), cell(num(loops.number('delay_samples', i), 3)), cell(num(loops.number('sampled_radius', i), 3), loops.number('sampled_radius', i) >= 1))))));
    return {marks: loops.rows, rows: loops.rows, tables: [loops], words: '', good: 'Stable where the sampled radius is below 1; a phase margin of 30° and more leaves room for a wrong delay.'};
  },
};
