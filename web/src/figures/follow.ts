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

export const followError: Figure = {
  id: 'error', title: 'How far off was the target?', note: 'px, from the principal point', span: 16,
  draw(host, doc: Doc, selection) {
    const table = doc.table('follow');
    if (!table || !table.hasValues('error_u_px')) return null;
    const {t, column} = columns(table), u = column('error_u_px'), v = column('error_v_px'), off = u.map((x, i) => Math.hypot(x, v[i]!)), found = off.filter(Number.isFinite);
    const rms = doc.estimate('rms_px'), predicted = doc.estimate('forecast.rms_px'), levels: Level[] = [];
    if (rms > 0) levels.push({value: rms, colour: 'blue'});
    if (predicted > 0) levels.push({value: predicted, dash: [2, 4], colour: 'green'});
    ([['distance', off, 'blue'], ['error u', u, 'orange'], ['error v', v, 'purple']] as const).forEach(([name, values, colour], k) =>
      new SeriesPlot(host, {t, selection, label: `${name}, px`, xLabel: k === 2 ? 'time, s' : '', height: k ? 130 : 190, isFilling: true, aria: name, lines: [{name, values, colour, width: 1.3}], tip: (i) => [`${name} ${num(values[i]!, 3)} px`],
        ...(k ? {levels: [{value: 0, dash: []}]} : {levels, aside: '- - RMS  ··· servo’s prediction', range: [0, 1.15 * (quantile(found, 1) || 1)]})}));
    const words = rms > 0 ? `RMS ${num(rms, 3)} px${predicted > 0 ? `; servo predicts ${num(predicted, 3)} px` : ''}` : '';
    return {marks: table.rows, rows: table.rows, tables: [table], words, good: `Found in ${percent(found.length, t.length, 1)} of the frames.`};
  },
};

export const followAngles: Figure = {
  id: 'angles', title: 'Did the head follow?', note: '°', span: 24,
  draw(host, doc: Doc, selection) {
    const table = doc.table('follow');
    if (!table || !table.hasValues('measured_pan_rad')) return null;
    const {t, column} = columns(table), angle = (name: string) => scaled(column(name), degrees);
    legend(host, [{words: 'asked', colour: 'var(--ink)', look: 'dash'}, {words: 'reached', colour: 'var(--blue)'}, {words: 'the target', colour: 'var(--orange)'}]);
    for (const axis of ['pan', 'tilt'] as const) {
      const asked = angle(`asked_${axis}_rad`), reached = angle(`measured_${axis}_rad`), target = angle(`target_${axis}_rad`);
      new SeriesPlot(host, {t, selection, label: `${axis}, °`, xLabel: axis === 'tilt' ? 'time, s' : '', height: axis === 'tilt' ? 172 : 150, isFilling: true, aria: axis,
        lines: [{name: 'target', values: target, colour: 'orange', width: 1.3}, {name: 'reached', values: reached, colour: 'blue', width: 1.4}, {name: 'asked', values: asked, colour: 'ink', dash: [5, 4], width: 1.1}],
        tip: (i) => [`${axis} ${num(reached[i]!, 4)}°, target ${num(target[i]!, 4)}°`]});
    }
    return {marks: table.rows, rows: table.rows, tables: [table], words: '', good: 'Good: all three lie on each other.'};
  },
};
