// The answer first: state, sentence, what to add, counts, checks that lead to their figures.
import type {Doc} from '../core/document';
import {button, download, el} from '../core/dom';
import {num} from '../core/format';
import {showHelp, toggleTheme} from './keys';
import {lookOf} from './states';

const whatIsCounted: Record<string, string> = {
  calibrate: 'photos', observe: 'rows', rangefinder: 'shots', rig: 'views', track: 'sights', servo: 'runs', localize: 'frames',
};

function countsOf(doc: Doc): string[] {
  const parts: string[] = [], {used, given, dropped} = doc.counts;
  const word = whatIsCounted[doc.command] ?? 'inputs';
  if (used !== undefined) parts.push(`${used}${given !== undefined && given > used ? ` of ${given}` : ''} ${word} used`);
  const corners = doc.command === 'calibrate' ? doc.table('corners') : null;
  const rejected = corners ? corners.numbers('weight').filter((w) => w === 0).length : 0;
  if (corners && doc.isAnswer) parts.push(`${corners.thinned?.from ?? corners.rows} corners (${rejected} left out)`);
  else if (corners) parts.push(`${corners.thinned?.from ?? corners.rows} corners`);
  else if (dropped !== undefined && dropped > 0) parts.push(`${dropped} left out`);
  if (doc.skipped.length > 0 && doc.command !== 'calibrate') parts.push(`${doc.skipped.length} skipped`);
  if (Number.isFinite(doc.estimate('rms_px')))
    parts.push(`RMS ${num(doc.estimate('rms_px'), 3)} px${doc.command === 'calibrate' ? ' per corner' : ''}`);
  if (doc.estimate('rms_range_m') > 0) parts.push(`ranges ${num(1e3 * doc.estimate('rms_range_m'), 3)} mm`);
  const total = doc.seconds.find(([name]) => name === 'total');
  if (total && Number.isFinite(total[1])) parts.push(`${num(total[1], 2)} s`);
  return parts;
}

// Checks may name the table or grid that decides instead of the figure that shows it.
const figureOfCheck: Record<string, string> = {
  sigma: 'trust', sigma_infinity: 'trust', sigma_working: 'trust', rings: 'lens', models: 'lens', cells: 'residuals',
  corners: 'residuals', board_points: 'board', excitation: 'motion', track: 'innovations', steps: 'path', views: 'coverage',
  measurements: 'innovations', heldout: 'lens',
};
function targetOf(name: string, figure: string, ids: Set<string>, command: string): string | null {
  const candidates = [figure, figureOfCheck[figure] ?? ''];
  if (command === 'observe' && figure === 'residuals') candidates.unshift('points');
  if (command === 'rig') candidates.push(/^(pan|tilt|shared)/.test(name) ? 'coverage' : /encoder|fit|outlier/.test(name) ? 'residuals' : 'space');
  return candidates.find((id) => ids.has(id)) ?? null;
}

function checksOf(doc: Doc, ids: Set<string>): HTMLElement | null {
  if (doc.checks.length === 0) return null;
  return el('ul', {class: 'checks', 'aria-label': 'checks'}, ...doc.checks.map((check) => {
    const look = lookOf(check.state), target = targetOf(check.name, check.figure, ids, doc.command);
    const words = [el('span', {class: `state-${look.name}`}, el('span', {role: 'img', 'aria-label': look.word}, look.symbol), ' ',
      el('b', {}, check.name)), ' ' + check.text];
    return el('li', {}, target ? el('a', {href: `#fig-${target}`}, ...words) : el('span', {}, ...words));
  }));
}

export function header(doc: Doc, ids: Set<string>): HTMLElement {
  const look = lookOf(doc.state);
  const isSaid = doc.sentence.toLowerCase().startsWith(look.word.toLowerCase());
  const sentence = isSaid ? doc.sentence.slice(look.word.length) : `: ${doc.sentence}`;
  const counts = countsOf(doc);
  return el('header', {class: 'top', style: `--state:var(--${look.name})`, 'data-state': look.name},
    el('div', {class: 'headline'},
      el('h1', {}, el('span', {class: 'symbol', role: 'img', 'aria-label': `state: ${look.word}`}, look.symbol), ' ',
        el('span', {class: 'word'}, isSaid ? doc.sentence.slice(0, look.word.length) : look.word), doc.sentence ? sentence : ''),
      el('div', {class: 'buttons'}, button('?', 'Keys and help', showHelp), button('◐', 'Dark or light', toggleTheme),
        button('⤓ result.json', 'Download the numbers', () => download('result.json', 'application/json', doc.source)))),
    el('p', {class: 'counts'}, el('b', {}, `alidade ${doc.command}`), counts.length > 0 ? ' · ' + counts.join(' · ') : ''),
    doc.toAdd ? el('p', {class: 'to-do'}, el('b', {}, 'What to do: '), doc.toAdd) : null,
    checksOf(doc, ids));
}
