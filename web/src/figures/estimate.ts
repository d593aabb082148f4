// Estimate: value ± 3σ, and by how much σ is above what independent errors would give; how correlations are drawn.
import {Chart} from '../core/chart';
import {css, diverging, onto} from '../core/colours';
import type {Doc, Quantity} from '../core/document';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num, shortened, times, valueText, units} from '../core/format';
import type {Correlations} from './correlations';

interface Reading {
  name: string;
  unit: string;
  factor: number;
}

const lensPixels = new Set(['fx', 'fy', 'cx', 'cy', 'skew', 'width', 'height']);

const maxAtOnce = 13; // rows; the others are a click away

/** Units are in the names (`origin_m`, `rms_px`), except of a lens, whose parameters have the names of its literature. */
function readingOf(quantity: Quantity, doc: Doc): Reading {
  const index = /\[(\d)\]$/.exec(quantity.path)?.[1], plain = quantity.path.replace(/\[\d+\]$/, '');
  const last = plain.slice(plain.lastIndexOf('.') + 1), isLens = /^camera\./.test(plain);
  let name = (isLens ? last : plain).replace(/^noise\./, 'noise: ').replace(/\./g, ' '), unit = isLens && lensPixels.has(last) ? 'px' : '', factor = 1;
  for (const [ending, word, by] of units)
    if (plain.endsWith(ending)) {
      unit = word, factor = by, name = name.slice(0, -ending.length);
      break;
    }
  if (plain === 'px' && index !== undefined) return {name: index === '0' ? 'u' : 'v', unit: 'px', factor: 1};
  if (unit === 'm' && isSmall(quantity, plain, doc)) unit = 'mm', factor = 1000;
  if (index !== undefined) name += ' ' + (['x', 'y', 'z', 'w'][Number(index)] ?? index);
  return {name: name.replace(/_/g, ' ').trim(), unit, factor};
}
/** All entries of a vector in the same unit. */
function isSmall(quantity: Quantity, plain: string, doc: Doc): boolean {
  const sizes = doc.estimates.filter((one) => one.path.replace(/\[\d+\]$/, '') === plain).map((one) => Math.abs(one.value));
  return Math.max(...sizes, Math.abs(quantity.value)) < 0.3;
}

// What the run was given and what it counted stand in the header and in the tables; bounds and errors beside the values.
const elsewhere = /^(photos|board\.|.*(_cov|cov_)|.*_(m2|px2)\b|sigma\.|shared_errors\.|causes\[|claims|corners_|events\[|bound\.|error\.|covers|heads|video|claims|controllers|camera\.(model|width|height)$|spot_sigma|b_from_a|excess_px|noise\.\w+_from|(sigma_px|noise\.\w+)_from)/;
const elsewhereOf: Record<string, RegExp> = {project: /^(M\d+|heads)\[/, identify: /^gain_deg$/, 'plan calibrate': /^camera/, 'plan observe': /^camera/, 'plan rangefinder': /^(camera|origin_m|direction\[)/, reproduce: /^(paper|reference|quick)/, localize: /^(unaligned_m|scale_known|sights)$/, track: /^(sigma_a_is_estimated)$/, rangefinder: /^(camera|refine|condition|range_ratio|normal_spread|offset_m|direction\[2\])/};
const names: Record<string, string> = {worst_3sigma_px: 'worst 3σ now', planned_worst_3sigma_px: 'worst 3σ after these photos', sigma_now_origin_m: 'σ of the origin now', sigma_planned_origin_m: 'σ of the origin after these shots', sigma_now_direction_rad: 'σ of the direction now', sigma_planned_direction_rad: 'σ of the direction after these shots',
  design_effect: 'variance over independent errors’', block_s: 'errors are shared for', correlated_rows: 'rows that share an error', rms_of_other_kind_rad: 'RMS as the other kind of plant', rms_rad: 'RMS', lag_one_correlation: 'correlation of residuals in a row', tau_s: 'time constant', latency_s: 'latency', gain_rad: 'gain, per unit', gain_rad_s: 'gain, per unit', zero_rad: 'zero', start_rad: 'angle at the start', kind: 'plant', theta_x_rad: 'angle to the x axis', theta_y_rad: 'angle to the y axis', 'left_out.rms_px': 'left-out spots, RMS', 'left_out.rms_range_m': 'left-out ranges, RMS',
  rms_range_m: 'ranges, RMS', rms_px: 'RMS', noise_px: 'noise of a corner', transfer_rms_px: 'unseen photos, RMS', transfer_flat_rms_px: 'the same, board flat', working_distance_m: 'working distance',
  sigma_px: 'σ of a pixel', 'noise.sigma_spot_px': 'σ of a spot', 'noise.sigma_corner_px': 'σ of a corner', 'noise.sigma_range_m': 'σ of a reading', 'noise.sigma_px': 'σ of a corner', 'noise.sigma_encoder_rad': 'σ of a reading',
  sigma_relative_rad: 'σ camera to camera', sigma_relative_m: 'σ camera to camera', chi2_per_dof: 'χ² per degree of freedom', nees_per_dof: 'NEES per degree of freedom', nees_aligned_per_dof: 'NEES per degree of freedom, aligned', nis_per_dof: 'NIS per degree of freedom',
  pcrlb_m: 'best possible RMS (PCRLB)', rms_m: 'RMS error', mean_error_m: 'mean error', sigma_a_m_s2: 'σ of the acceleration', compared_share: 'share compared', ate_m: 'ATE', rpe_m: 'RPE', rpe_rad: 'RPE, turned', stated_m: 'RMS that σ states'};

interface Columns {
  sigma: boolean;
  model: boolean;
  bound: boolean;
  error: boolean;
}

function rowOf(quantity: Quantity, doc: Doc, has: Columns): HTMLElement {
  const {unit, factor, ...reading} = readingOf(quantity, doc), name = names[quantity.path] ?? reading.name;
  if (!Number.isFinite(quantity.value))
    return el('tr', {}, el('th', {}, name), el('td', {class: 'word', colspan: 3 + Number(has.bound) + Number(has.error) + Number(has.model)}, quantity.text || '–'));
  const text = valueText(factor * quantity.value, factor * quantity.sigma);
  const isLens = quantity.path.startsWith('camera.');
  const behind = text.plusMinus ? `± ${text.plusMinus}` : isLens && has.sigma ? 'fixed' : '';
  const beside = (kind: string, by: number) => {
    const value = doc.estimate(`${kind}.${quantity.path.replace(/^camera\./, '')}`);
    return el('td', {class: 'right'}, value !== 0 && Number.isFinite(value) ? (kind === 'bound' ? '± ' : '') + num(by * factor * value, 2) : '');
  };
  return el('tr', {'data-path': quantity.path}, el('th', {}, name), el('td', {class: 'value'}, text.value), el('td', {}, behind),
    has.model ? el('td', {class: 'right'}, times(doc.inflation(quantity.path))) : null, has.bound ? beside('bound', 3) : null, has.error ? beside('error', 1) : null, el('td', {class: 'unit'}, unit));
}

function lensLine(doc: Doc): string {
  const size = doc.imageSize, model = doc.estimateText('camera.model');
  return size && model ? `${model} lens, ${size.width} × ${size.height} px` : '';
}

export function drawCorrelations(host: HTMLElement, matrix: Correlations): void {
  const count = Math.min(matrix.names.length, 30), most = Math.min(44 + 30 * count, 460);
  host.append(el('p', {class: 'caption'}, 'correlation: ' + matrix.words));
  const outer = el('div', {style: `max-width:${most}px;width:100%`});
  host.append(outer);
  const isTurned = count > 9, foot = isTurned ? 46 : 20; // names below that would touch stand upright
  new Chart(outer, {height: 60, aspect: (foot + 26 * count) / (44 + 26 * count), most: 440, label: matrix.words}, (pen) => {
    const left = 44, size = Math.min((pen.w - left) / count, (pen.h - foot) / count), text = Math.min(10.5, size * 0.38);
    for (let i = 0; i < count; ++i) {
      const middle = size * (i + 0.5), short = shortened(matrix.names[i]!, 6);
      if (size > 9) {
        pen.text(short, left - 5, middle, {align: 'right', size: Math.min(11, size), colour: pen.c.soft});
        if (isTurned) pen.text(short, left + middle, size * count + 5, {align: 'right', size: Math.min(11, size), colour: pen.c.soft, turn: -Math.PI / 2});
        else pen.text(short, left + middle, size * count + 9, {align: 'center', size: Math.min(11, size * 0.45), colour: pen.c.soft});
      }
      for (let j = 0; j < count; ++j) {
        const rho = matrix.rho[i * matrix.names.length + j]!, x = left + size * j, y = size * i;
        const colour = diverging(-rho), strength = Math.abs(rho);
        pen.rect(x, y, size - 1.5, size - 1.5, i === j ? pen.c.grid : css(colour, 0.08 + 0.9 * strength));
        if (i !== j && strength > 0.6 && text > 6)
          pen.text((rho < 0 ? '−' : '') + strength.toFixed(2).replace(/^0/, ''), x + size / 2, y + size / 2, {align: 'center', size: text, colour: strength > 0.55 ? onto(colour) : pen.c.ink});
        pen.hit({x: x + size / 2, y: y + size / 2, w: size, h: size, tip: () => [`${matrix.names[i]} and ${matrix.names[j]}`, `correlation ${num(rho, 3)}`]});
      }
    }
  });
}

function atBest(doc: Doc): string {
  const from_s = doc.estimate('bound.from_s'), until_s = doc.estimate('bound.until_s');
  return until_s > from_s ? `At best: 3σ of the Cramér–Rao bound of the rows from ${num(from_s, 3)} to ${num(until_s, 3)} s, the longest time without a zoom; 3σ holds the others as well.` : 'At best: 3σ of the Cramér–Rao bound of these measurements.';
}

export const estimate: Figure = {
  id: 'estimate', title: 'Estimate', note: 'value ± 3σ', span: 6,
  draw(host, doc) {
    const shown = doc.estimates.filter((one) => !elsewhere.test(one.path) && !elsewhereOf[doc.command.startsWith('reproduce') ? 'reproduce' : doc.command]?.test(one.path) && !(one.path === 'scale' && !(one.sigma > 0)) && !(one.text === '' && one.path.includes('[]')));
    if (shown.length === 0) return null;
    const rank = (one: Quantity) => 2 * Number(one.path.startsWith('camera.')) + Number(one.sigma > 0);
    shown.sort((a, b) => rank(b) - rank(a));
    const any = (kind: string) => shown.some((one) => Number.isFinite(doc.estimate(`${kind}.${one.path.replace(/^camera\./, '')}`)));
    const has = {sigma: shown.some((one) => one.sigma > 0), model: shown.some((one) => doc.inflation(one.path) > 0), bound: any('bound'), error: any('error')};
    const lens = lensLine(doc);
    if (lens) host.append(el('p', {class: 'caption'}, lens));
    const rows = shown.slice(0, 60).map((one) => rowOf(one, doc, has));
    host.append(el('table', {class: 'estimate'},
      has.model || has.bound || has.error ? el('thead', {}, el('tr', {}, el('th'), el('th'), el('th', {}, '3σ'), has.model ? el('th', {}, 'over model') : null, has.bound ? el('th', {}, 'at best') : null,
        has.error ? el('th', {}, 'error') : null, el('th'))) : null,
      el('tbody', {}, ...rows.slice(0, maxAtOnce))));
    if (rows.length > maxAtOnce)
      host.append(el('details', {class: 'reasons'}, el('summary', {}, `${rows.length - maxAtOnce} more`), el('table', {class: 'estimate'}, el('tbody', {}, ...rows.slice(maxAtOnce)))));
    return {marks: shown.length, rows: shown.length, tables: [], words: '',
      good: !doc.isAnswer ? 'No answer: values are where the search ended, and not to be used.' : has.bound ? atBest(doc) : has.model ? 'Over model: how many times σ is above what it would be if every measurement erred by itself.' : undefined};
  },
};
