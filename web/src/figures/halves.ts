// Do the halves agree? Two cameras, each from half of the photos, and what σ predicts for their difference.
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num} from '../core/format';
import {lengths, quantile, scaled} from '../core/stats';
import {colourKey, drawField, shareNotAbove, sizeOfGrid} from './fields';

export const halves: Figure = {
  id: 'halves', title: 'Do the halves agree?', note: 'two cameras, each from half of the photos, px', span: 12,
  draw(host, doc) {
    const grid = doc.pixelGrid('halves'), du = grid?.values('delta_u_px'), dv = grid?.values('delta_v_px');
    if (!grid || !du || !dv) return null;
    const size = doc.imageSize ?? sizeOfGrid(grid), values = lengths(du, dv), sigma = grid.values('predicted_sigma_px');
    const row = el('div', {class: 'row'}), left = el('div'), right = el('div');
    host.append(row);
    row.append(left);
    if (sigma) row.append(right);
    const marks = values.filter(Number.isFinite).length;
    const predicted = sigma ? scaled(sigma, 3) : null;
    drawField(left, {title: 'difference of the halves', grid, size, values, du, dv}, 0.05);
    if (predicted) drawField(right, {title: '3σ that is predicted for it', grid, size, values: predicted}, 0.05);
    colourKey(host, 'px');
    const check = doc.checks.find((one) => one.name === 'consistent' || one.figure === 'halves'), isQuiet = !check || check.state === 'good';
    const share = predicted ? 100 * shareNotAbove(values, predicted) : NaN;
    // The check speaks of parameters, which can differ where pixels do not: beside a header that says so no share of the image "agrees".
    const good = !isQuiet ? `They do not: ${check.text}. A pixel then differs by ${num(quantile(values, 0.5), 2)} px in the median, ${num(quantile(values, 1), 2)} px at worst.` : Number.isFinite(share) ? `Good: the difference stays below the predicted 3σ. Here it does in ${share.toFixed(0)} % of the image.` : 'Good: small against the accuracy that the task needs.';
    return {marks, rows: marks, tables: [], words: good, good};
  },
};
