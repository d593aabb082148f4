// Is the motion sufficient? Its angles or rates, and the information on the weakest combination.
import type {Table} from '../core/document';
import type {Figure} from '../core/figure';
import {degrees, num} from '../core/format';
import {SeriesPlot, type Level, type Line} from '../core/series';
import {quantile, scaled} from '../core/stats';
import {observeScene} from './observe_scene';

const colours = ['blue', 'orange', 'green'] as const;

function linesOf(steps: Table, wanted: [string, string][]): Line[] {
  return wanted.filter(([column]) => steps.hasValues(column)).map(([column, name], i) => ({name, values: scaled(steps.numbers(column), degrees), colour: colours[i]!, dash: [[], [7, 3], [2, 3]][i]}));
}
function lastOf(values: Float64Array): number {
  for (let i = values.length; i-- > 0;) if (Number.isFinite(values[i]!)) return values[i]!;
  return NaN;
}

export const observeMotion: Figure = {
  id: 'motion', title: 'Is the motion sufficient?', note: 'x: tilting, y: panning', span: 8,
  draw(host, doc, selection) {
    const scene = observeScene(doc);
    if (!scene) return null;
    const {steps, t} = scene, common = {t, events: scene.events, spans: scene.zooms, selection, xLabel: scene.timeLabel};
    const angles = linesOf(steps, [['pan_rad', 'pan'], ['tilt_rad', 'tilt'], ['roll_rad', 'roll']]);
    const rates = linesOf(steps, [['omega_x_rad_per_s', 'ω x'], ['omega_y_rad_per_s', 'ω y'], ['omega_z_rad_per_s', 'ω z']]);
    const motion = angles.length > 0 ? angles : rates, weak = steps.numbers('weak_eigenvalue'), hasWeak = weak.some((v) => v > 0);
    if (motion.length === 0 && !hasWeak) return null;
    if (motion.length > 0)
      new SeriesPlot(host, {...common, lines: motion, label: angles.length > 0 ? 'angles of the head, °' : 'angular rates, °/s', aside: motion.map((line, i) => `${['—', '- -', '···'][i]} ${line.name}`).join('   '),
        height: 150, aria: 'the motion over time', isFilling: true, digits: 3});
    const limit = lastOf(steps.numbers('weak_limit')), care = lastOf(steps.numbers('weak_care'));
    const check = doc.checks.find((one) => /weakest/.test(one.name));
    if (hasWeak) {
      const levels: Level[] = [];
      if (care > 0) levels.push({value: care, words: 'with care below', colour: 'orange'});
      if (limit > 0) levels.push({value: limit, words: 'below: cannot be determined', colour: 'red'});
      if (!(limit > 0) && check && check.limit > 0 && check.unit === 'px') levels.push({value: 1 / check.limit ** 2, words: 'below: cannot be determined', colour: 'red'});
      const floor = Math.max(0.3 * Math.min(quantile(weak.filter((v) => v > 0), 0.02), ...levels.map((l) => l.value)), 1e-18);
      new SeriesPlot(host, {...common, lines: [{name: 'information', values: weak, colour: 'ink'}], levels, isLog: true, label: 'information on the weakest combination, 1/px²', height: 150,
        aria: `information on the weakest combination, at the end ${num(lastOf(weak), 2)}`, isFilling: true, range: [floor, 3 * Math.max(quantile(weak, 1), ...levels.map((l) => l.value))], digits: 3});
    }
    return {note: angles.length > 0 ? 'angles as read' : rates.length > 0 ? 'about the camera’s axes; x: tilting, y: panning' : '', marks: steps.rows, rows: steps.rows, tables: [steps], words: check?.text ?? '',
      good: 'Good: it turns about two axes, again and again, and the information rises above its limit early.' + (check ? ` Weakest: ${check.text}.` : '')};
  },
};
