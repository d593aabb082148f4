// identify: what was commanded, the angle measured and modelled, and what is left of it.
import {legend, type Figure} from '../core/figure';
import {degrees, num, percent} from '../core/format';
import {SeriesPlot} from '../core/series';
import {extent, quantile, scaled} from '../core/stats';
import {scatter} from './scatter';

export const identifyResponse: Figure = {
  id: 'response', title: 'Does the model follow the axis?', note: 'command in its own unit, angle and residual in °, each on its own axis', span: 16,
  draw(host, doc, selection) {
    const table = doc.table('response');
    if (!table || !table.hasValues('measured_rad')) return null;
    const t = table.numbers('t_s'), measured = scaled(table.numbers('measured_rad'), degrees), model = scaled(table.numbers('model_rad'), degrees), residual = scaled(table.numbers('residual_rad'), degrees);
    const command = table.numbers('command'), hasModel = model.some(Number.isFinite), reach = 1.1 * Math.max(quantile(residual.map(Math.abs), 0.998), 1e-9);
    legend(host, [{words: 'command', colour: 'var(--green)'}, {words: 'measured', colour: 'var(--blue)', look: 'dot'}, ...(hasModel ? [{words: 'modelled', colour: 'var(--orange)'}] : [])]);
    new SeriesPlot(host, {t, selection, label: 'command, in its unit', xLabel: '', height: 84, isFilling: true, aria: 'command over time', lines: [{name: 'command', values: command, colour: 'green', isSteps: true}]});
    new SeriesPlot(host, {t, selection, label: 'angle, °', xLabel: hasModel ? '' : 'time, s', height: 160, isFilling: true, aria: 'angle over time',
      lines: [{name: 'measured', values: measured, colour: 'blue', isDots: true, size: table.rows > 1500 ? 2 : 3.2}, ...(hasModel ? [{name: 'modelled', values: model, colour: 'orange' as const, width: 1.5}] : [])]});
    if (!hasModel) return {marks: table.rows, rows: table.rows, tables: [table], words: '', good: 'No model fits: only what was measured is drawn.'};
    const rms = degrees * doc.estimate('rms_rad'), ends = extent(measured);
    new SeriesPlot(host, {t, selection, label: 'modelled − measured, °', aside: `RMS ${num(rms, 3)}°`, xLabel: 'time, s', height: 118, isFilling: true, aria: `residual over time, RMS ${num(rms, 3)}°`, range: [-reach, reach], levels: [{value: 0, dash: []}],
      lines: [{name: 'residual', values: residual, colour: 'blue', isDots: true, size: table.rows > 1500 ? 2 : 3}]});
    const words = `the residual is ${num(rms, 3)}° RMS${ends ? `, ${percent(rms, ends[1] - ends[0], 2)} of the range of the angle` : ''}`;
    return {marks: table.rows, rows: table.rows, tables: [table], words, good: `Good: dots on the line, the residual without a pattern: waves where the command turns mean that the axis is of another kind, or has limits. Here ${words}.`};
  },
};

export const identifySpread: Figure = {
  id: 'spread', isOptional: true, title: 'Does the residual follow the angle?', note: 'modelled − measured, °', span: 12,
  draw(host, doc, selection) {
    const table = doc.table('response');
    if (!table || !table.hasValues('residual_rad') || !table.hasValues('model_rad')) return null;
    const model = scaled(table.numbers('model_rad'), degrees), residual = scaled(table.numbers('residual_rad'), degrees), t = table.numbers('t_s');
    const every = Math.max(1, Math.floor(table.rows / 3000)), rows = Array.from(model.keys()).filter((i) => i % every === 0 && Number.isFinite(model[i]! + residual[i]!));
    scatter(host, rows.map((i) => ({x: model[i]!, y: residual[i]!, size: 1.8, colour: (pen) => pen.c.blue, pick: () => selection.at(t[i]!), tip: () => [`${num(t[i]!, 5)} s`, `modelled ${num(model[i]!, 4)}°, off by ${num(residual[i]!, 3)}°`]})),
      {xLabel: 'angle modelled, °', yLabel: 'residual, °', height: 260, isFilling: true, zero: true, label: 'Residual over the angle'});
    return {marks: rows.length, rows: rows.length, tables: [table], words: '', good: 'Good: a level band about zero. A slope or steps at the ends mean a limit, two levels mean backlash.'};
  },
};
