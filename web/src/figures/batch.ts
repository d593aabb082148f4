// A lot: every value against the others of its kind.
import {Chart, type Pen} from '../core/chart';
import type {Table} from '../core/document';
import {legend, type Figure} from '../core/figure';
import {num} from '../core/format';
import {scale, xAxis} from '../core/scale';

const standsOut = 4; // of the lot's scatter and a value's own σ together

interface Row { name: string; values: number[] }

/** Rows of the table by quantity; those that hold what stands furthest out come first. */
function byQuantity(table: Table): Row[] {
  const rows = new Map<string, number[]>(), z = table.numbers('z');
  for (let i = 0; i < table.rows; ++i) {
    const name = table.text('quantity', i), values = rows.get(name);
    if (values) values.push(i);
    else rows.set(name, [i]);
  }
  const furthest = (values: number[]) => Math.max(...values.map((i) => Math.abs(z[i]!)));
  return [...rows].map(([name, values]) => ({name, values})).sort((a, b) => furthest(b.values) - furthest(a.values));
}

/** Even up to ±6, beyond by its logarithm: one that is far out does not press the others together. */
const placed = (z: number) => (Math.abs(z) <= 6 ? z : Math.sign(z) * (6 + 6 * Math.log10(Math.abs(z) / 6)));
const back = (place: number) => (Math.abs(place) <= 6 ? place : Math.sign(place) * 6 * 10 ** ((Math.abs(place) - 6) / 6));

export const batchSpread: Figure = {
  id: 'spread', title: 'Which are outliers of the lot?', note: 'distance from the lot’s median, over its scatter and the value’s own σ', span: 24,
  draw(host, doc) {
    const table = doc.table('values');
    if (!table || !table.hasValues('z')) return null;
    const most = 14, all = byQuantity(table), rows = all.slice(0, most), z = table.numbers('z'), out = z.filter((v) => Math.abs(v) > standsOut).length;
    const reach = placed(Math.max(8, ...z.map(Math.abs))) + 0.5;
    const dot = (pen: Pen, i: number, x: number, y: number) => {
      if (Math.abs(z[i]!) > standsOut) pen.fill([x - 5, y, x, y - 5, x + 5, y, x, y + 5], pen.c.orange);
      else pen.circle(x, y, 2.2, pen.c.blue);
      pen.hit({x, y, r: 4, tip: () => [`${table.text('camera', i)}: ${table.text('quantity', i)} = ${num(table.number('value', i), 6)} ± ${num(table.number('sigma', i), 2)}`, `median of the lot ${num(table.number('median_of_lot', i), 6)}, z ${num(z[i]!, 3)}`]});
    };
    legend(host, [{words: 'a row of the lot', colour: 'var(--blue)', look: 'dot'}, {words: 'outlier', colour: 'var(--orange)', look: 'square'}, {words: `within ± ${standsOut}`, colour: 'var(--blue)', look: 'band'}]);
    new Chart(host, {height: 60 + 34 * rows.length, label: `${out} outliers in the lot`}, (pen) => {
      const left = Math.min(pen.w / 3, 14 + Math.max(...rows.map((row) => pen.width(row.name, 12)))), right = pen.w - 12, top = 8, bottom = pen.h - 40, x = scale(-reach, reach, left, right), each = (bottom - top) / rows.length;
      pen.rect(x(-standsOut), top, x(standsOut) - x(-standsOut), bottom - top, pen.c.panel);
      xAxis(pen, x, top, bottom, {label: 'z', format: (place) => num(back(place), 2)});
      rows.forEach((row, k) => {
        const middle = top + (k + 0.5) * each;
        pen.line(left, middle, right, middle, pen.c.grid);
        pen.text(row.name, left - 8, middle, {align: 'right', size: 12});
        // Dots of a row lie side by side, by their place in it: none hides all others.
        row.values.forEach((i, at) => Math.abs(z[i]!) <= standsOut && dot(pen, i, x(placed(z[i]!)), middle + 0.55 * each * (((at * 7) % 11) / 10 - 0.5)));
        row.values.forEach((i) => {
          if (Math.abs(z[i]!) <= standsOut) return;
          const here = x(placed(z[i]!)), words = table.text('camera', i), isRight = here + pen.width(words, 11) + 10 < right;
          dot(pen, i, here, middle);
          if (row.values.filter((j) => Math.abs(z[j]!) > standsOut).length <= 6) pen.text(words, here + (isRight ? 8 : -8), middle - 8, {size: 11, align: isRight ? 'left' : 'right', colour: pen.c.soft});
        });
      });
    });
    const left = all.length > most ? ` ${all.length - most} more quantities, nearer to their medians, are in the table.` : '';
    return {marks: rows.reduce((sum, row) => sum + row.values.length, 0), rows: table.rows, tables: [table], words: `${out} outliers in the lot`, good: `Good: nothing outside the band. Here ${out} of ${table.rows} values ${out === 1 ? 'is' : 'are'}.${left}`};
  },
};
