// A study's curve: error over the bound, and what σ covers, against what is varied.
import {Chart} from '../core/chart';
import type {ColourName} from '../core/colours';
import {legend, type Figure} from '../core/figure';
import {num} from '../core/format';
import {scale, xAxis, yAxis} from '../core/scale';
import {extent} from '../core/stats';

const colours: ColourName[] = ['blue', 'orange', 'green', 'purple', 'sky', 'red'];

export const studyCurve: Figure = {
  id: 'curve', isOptional: true, title: 'How good against what is varied?', note: 'RMS error over the bound; share inside 1σ and 2σ', span: 24,
  draw(host, doc) {
    const table = doc.table('quantities');
    if (!table || !table.hasValues('varied')) return null;
    const varied = table.numbers('varied'), ratio = table.numbers('rms_over_bound'), names = [...new Set(Array.from(varied.keys(), (i) => table.text('quantity', i)))];
    const rowsOf = (name: string) => Array.from(varied.keys()).filter((i) => table.text('quantity', i) === name && Number.isFinite(varied[i]!));
    const shown = names.slice(0, colours.length), ends = extent(varied), highest = extent(ratio, [1]);
    if (!ends || !highest) return null;
    legend(host, [...shown.map((name, k) => ({words: name, colour: `var(--${colours[k]!})`})), {words: 'expected', colour: 'var(--ink)', look: 'dash' as const}]);
    const panel = (words: string, range: [number, number], lines: Float64Array[], expected: number[], xLabel: string) =>
      new Chart(host, {height: 220, label: words}, (pen) => {
        const left = 52, right = pen.w - 12, top = 24, bottom = pen.h - 40, x = scale(ends[0], ends[1], left + 8, right - 8), y = scale(range[0], range[1], bottom, top);
        yAxis(pen, y, left, right, {label: words});
        xAxis(pen, x, top, bottom, {label: xLabel});
        for (const level of expected) pen.line(left, y(level), right, y(level), pen.c.ink, 1.2, [6, 4]);
        shown.forEach((name, k) => {
          const rows = rowsOf(name), colour = pen.c[colours[k]!];
          for (const values of lines) {
            pen.path(rows.flatMap((i) => [x(varied[i]!), y(values[i]!)]), colour, 1.6);
            for (const i of rows) {
              if (!Number.isFinite(values[i]!)) continue;
              pen.circle(x(varied[i]!), y(values[i]!), 3, colour);
              pen.hit({x: x(varied[i]!), y: y(values[i]!), r: 4, tip: () => [`${name} at ${num(varied[i]!, 4)}: ${num(values[i]!, 4)}`, `RMS ${num(table.number('rms', i), 3)} ${table.text('unit', i)}`]});
            }
          }
        });
      });
    const inside = [table.numbers('inside_1_sigma'), table.numbers('inside_2_sigma')], lowest = extent(inside.flatMap((values) => [...values]), [0.6, 1]) ?? [0, 1];
    panel('RMS error over the bound', [Math.min(0.9, 0.95 * highest[0]), 1.05 * highest[1]], [ratio], [1], '');
    panel('share inside 1σ and 2σ', [Math.max(0, lowest[0] - 0.03), 1], inside, [0.6827, 0.9545], doc.estimateText('varied') || 'what is varied');
    const left = names.length - shown.length;
    return {marks: table.rows, rows: table.rows, tables: [table], words: `${names.length} quantities over ${num(ends[0], 3)} to ${num(ends[1], 3)}`, good: `Good: on the dashed lines.${left > 0 ? ` ${left} more quantities are in the table.` : ''}`};
  },
};
