// Where does σ come from? Errors shared within a photo (a shot, a view) raise it: each one's squared score over what
// the model expects, and by how much σ was raised.
import {Chart, type Pen} from '../core/chart';
import type {Doc, Table} from '../core/document';
import type {Figure} from '../core/figure';
import {counted, num, shortened} from '../core/format';
import {scale, yAxis} from '../core/scale';
import {extent, finite} from '../core/stats';
import type {Selection} from '../core/selection';

const words: Record<string, [string, string]> = {photos: ['photo', 'Photo by photo'], shots: ['shot', 'Shot by shot'], views: ['view', 'View by view'], blocks: ['block of time', 'Block by block']};

function tableOf(doc: Doc): Table | null {
  for (const name of [...Object.keys(words), ...doc.tables.keys()])
    if (doc.table(name)?.hasValues('cluster_z2')) return doc.table(name);
  return null;
}

/** "σ was raised 2.4 to 3.1 times"; empty where the document does not tell. */
function raised(doc: Doc): string {
  const inside = (path: string) => doc.estimates.filter((one) => one.path.startsWith(`sigma.${path}.`)).map((one) => one.value).filter((value) => value > 0);
  const effect = [doc.estimate('shared_errors.design_effect'), doc.estimate('design_effect')].find((value) => value > 0);
  const inflation = extent(inside('inflation')), dof = extent(inside('degrees_of_freedom'));
  if (!inflation) return effect ? ` In the mean over all directions the variance is ${num(effect, 3)} times that of independent errors.` : '';
  const range = ([low, high]: [number, number], digits: number) => (num(low, digits) === num(high, digits) ? num(low, digits) : `${num(low, digits)} to ${num(high, digits)}`);
  return ` So σ was raised ${range(inflation, 3)} times over what independent errors would give` + (dof && dof[1] < 1e6 ? `, with ${range(dof, 2)} degrees of freedom.` : '.');
}

function drawBars(pen: Pen, order: number[], z2: Float64Array, nameOf: (row: number) => string, selection: Selection): void {
  const left = 46, right = pen.w - 8, top = 24, bottom = pen.h - 20, high = 1.3 * Math.max(2, z2[order[0]!]!), lowest = z2[order[order.length - 1]!]!, low = Math.max(0.05, Math.min(0.5, 0.8 * lowest));
  const y = scale(low, high, bottom, top, true), pitch = Math.min(120, (right - left) / order.length), gap = pitch > 12 ? 3 : pitch > 4 ? 1 : 0;
  yAxis(pen, y, left, right, {label: 'squared score over the expected', wanted: 4});
  order.forEach((row, place) => {
    const x = left + pitch * place, w = Math.max(0.5, pitch - gap), value = z2[row]!, isChosen = row === selection.item;
    // From the line at 1: up where the scatter is larger than expected, down where it is smaller.
    const end = Math.min(bottom, y(value));
    pen.rect(x, Math.min(end, y(1)), w, Math.max(1, Math.abs(y(1) - end)), isChosen ? pen.c.orange : pen.c.blue);
    if (pitch > 40) pen.text(shortened(nameOf(row).replace(/\.\w+$/, ''), Math.floor(pitch / 7.5)), x + w / 2, bottom + 12, {align: 'center', size: 11, colour: isChosen ? pen.c.ink : pen.c.soft});
    pen.hit({x: x + pitch / 2, y: (top + bottom) / 2, w: pitch, h: bottom - top + 30, pick: () => selection.choose(row), tip: () => [nameOf(row), `${num(value, 3)} times the expected`]});
  });
  if (pitch <= 40) pen.text(`${order.length}, largest first`, (left + right) / 2, bottom + 12, {align: 'center', size: 11, colour: pen.c.soft});
  pen.line(left, y(1), right, y(1), pen.c.ink, 1.6, [5, 4]);
  pen.text('1: the mean, if errors are independent', right, top - 12, {align: 'right', size: 11, colour: pen.c.soft});
}

export const clusters: Figure = {
  id: 'clusters', isOptional: true, title: 'Photo by photo: where does σ come from?', note: 'squared score over what independent errors would give · click a bar', span: 24,
  draw(host, doc, selection) {
    const table = tableOf(doc);
    if (!table || !doc.isAnswer) return null;
    const z2 = table.numbers('cluster_z2'), [word, title] = words[table.name] ?? ['cluster', 'Cluster by cluster'];
    const order = Array.from(z2.keys()).filter((i) => Number.isFinite(z2[i]!)).sort((a, b) => z2[b]! - z2[a]!);
    const nameOf = (row: number) => table.text('name', row) || `${word} ${row + 1}`, mean = finite(z2).reduce((sum, value) => sum + value, 0) / order.length;
    const says = `the mean over ${counted(order.length, word)} is ${num(mean, 2)}, the largest ${num(z2[order[0]!]!, 2)} (${nameOf(order[0]!)})`;
    const chart = new Chart(host, {height: 170, label: says}, (pen) => drawBars(pen, order, z2, nameOf, selection));
    selection.on(() => chart.redraw());
    return {title: `${title}: where does σ come from?`, marks: order.length, rows: order.length, tables: [table], words: says,
      good: `Good: bars on both sides of the line. Far above it the measurements of one ${word} err together, as by blur, a rolling shutter or what the model lacks. Here ${says}.${raised(doc)}`};
  },
};
