// head --follow: where the target stood in the image, and where the head was asked to point, pointed, and should have.
import type {Doc, Table} from '../core/document';
import {legend, type Figure} from '../core/figure';
import {degrees, num, percent} from '../core/format';
import {SeriesPlot, type Level} from '../core/series';
import {quantile, scaled} from '../core/stats';

const columns = (table: Table) => {
  const t = Float64Array.from(table.numbers('t_s'));
  return {t, column: (name: string) => Float64Array.from(table.numbers(name))};
};
const length = (u: Float64Array, v: Float64Array) => u.map((x, i) => Math.hypot(x, v[i]!));

export const followError: Figure = {
  id: 'error', title: 'How far from the middle was the target?', note: 'px, from the principal point', span: 16,
  draw(host, doc: Doc, selection) {
    const table = doc.table('follow');
    if (!table || !table.tells('error_u_px')) return null;
    const {t, column} = columns(table), u = column('error_u_px'), v = column('error_v_px'), off = length(u, v), found = off.filter(Number.isFinite);
    const rms = doc.estimate('rms_px'), predicted = doc.estimate('forecast.rms_px'), reach = 1.15 * (quantile(found, 1) || 1), levels: Level[] = [];
    if (rms > 0) levels.push({value: rms, colour: 'blue'});
    if (predicted > 0) levels.push({value: predicted, dash: [2, 4], colour: 'green'});
    new SeriesPlot(host, {t, selection, label: 'distance, px', aside: [rms > 0 ? `- - RMS ${num(rms, 3)} px` : '', predicted > 0 ? `··· servo predicts ${num(predicted, 3)} px` : ''].filter(Boolean).join('  '), xLabel: '', height: 190, isFilling: true, aria: 'distance of the target from the middle', levels, range: [0, reach], lines: [{name: 'distance', values: off, colour: 'blue', width: 1.4}],
      tip: (i) => [Number.isFinite(off[i]!) ? `${num(off[i]!, 3)} px off` : 'not found']});
    for (const [name, values, colour] of [['u', u, 'orange'], ['v', v, 'purple']] as const)
      new SeriesPlot(host, {t, selection, label: `error ${name}, px`, xLabel: name === 'v' ? 'time, s' : '', height: name === 'v' ? 142 : 116, isFilling: true, aria: `error ${name}`, levels: [{value: 0, dash: []}], lines: [{name: `error ${name}`, values, colour, width: 1.2}],
        tip: (i) => [`error ${name} ${num(values[i]!, 3)} px`]});
    const words = rms > 0 ? `From a third of the time on ${num(rms, 3)} px RMS${predicted > 0 ? `; servo predicts ${num(predicted, 3)} px for this head, these delays and this target` : ''}` : '';
    return {marks: table.rows, rows: table.rows, tables: [table], words, good: `${words ? `${words}. ` : ''}Found in ${percent(found.length, t.length, 1)} of the frames.`};
  },
};

export const followAngles: Figure = {
  id: 'angles', title: 'Did the head follow?', note: 'asked · reached · the target, °', span: 24,
  draw(host, doc: Doc, selection) {
    const table = doc.table('follow');
    if (!table || !table.tells('measured_pan_rad')) return null;
    const {t, column} = columns(table), angle = (name: string) => scaled(column(name), degrees);
    legend(host, [{words: 'asked', colour: 'var(--ink)', look: 'dash'}, {words: 'reached', colour: 'var(--blue)'}, {words: 'would have been right', colour: 'var(--orange)'}]);
    for (const axis of ['pan', 'tilt'] as const) {
      const asked = angle(`asked_${axis}_rad`), reached = angle(`measured_${axis}_rad`), target = angle(`target_${axis}_rad`);
      new SeriesPlot(host, {t, selection, label: `${axis}, °`, xLabel: axis === 'tilt' ? 'time, s' : '', height: axis === 'tilt' ? 172 : 150, isFilling: true, aria: `${axis} over time`,
        lines: [{name: 'target', values: target, colour: 'orange', width: 1.3}, {name: 'reached', values: reached, colour: 'blue', width: 1.4}, {name: 'asked', values: asked, colour: 'ink', dash: [5, 4], width: 1.1}],
        tip: (i) => [`${axis}: asked ${num(asked[i]!, 4)}°, reached ${num(reached[i]!, 4)}°, right ${num(target[i]!, 4)}°`]});
    }
    return {marks: table.rows, rows: table.rows, tables: [table], words: '', good: 'Good: reached lies on asked, and asked on the target: where it turns, it is asked late by the delays.'};
  },
};
