// The answer first: state, sentence, what to add, counts, checks that lead to their figures.
import type {Check, Doc} from '../core/document';
import {button, download, el} from '../core/dom';
import {num} from '../core/format';
import {showHelp, toggleTheme} from './keys';
import {nextStep} from './next_step';
import {lookOf} from './states';

const whatIsCounted: Record<string, string> = {
  calibrate: 'photos', observe: 'rows', rangefinder: 'shots', rig: 'views', track: 'observations', servo: 'runs', localize: 'frames', identify: 'rows', reproduce: 'claims',
};

function countsOf(doc: Doc): string[] {
  const parts: string[] = [], {used, given, dropped} = doc.counts;
  const word = doc.command === 'rig' && doc.table('cameras') ? 'observations' : doc.command === 'observe' && doc.table('photos') ? 'photos' : whatIsCounted[doc.command.split(' ')[0]!] ?? 'inputs';
  if (used !== undefined && !/^(plan|simulate|camera) /.test(doc.command)) parts.push(`${used}${given !== undefined && given > used ? ` of ${given}` : ''} ${(given ?? used) === 1 ? word.replace(/s$/, '') : word} used`);
  const isThinned = doc.command === 'rig' && doc.table('cameras') !== null;  // what a knot of the path does not need is not used
  const averaged = doc.skipped.filter((one) => one.reason.endsWith(': averaged with it')).length;
  const corners = doc.command === 'calibrate' ? doc.table('corners') : null;
  const rejected = corners ? corners.numbers('weight').filter((w) => w === 0).length : 0;
  if (corners && doc.isAnswer) parts.push(`${(corners.thinned?.from ?? corners.rows) - rejected} corners (${rejected} rejected)`);
  else if (corners) parts.push(`${corners.thinned?.from ?? corners.rows} corners`);
  else if (dropped !== undefined && dropped > averaged && doc.command !== 'track' && !isThinned) parts.push(`${dropped - averaged} rejected`);  // of a track some only waited for its start
  if (averaged > 0) parts.push(`${averaged} averaged with the one before`);
  const inPart = doc.command === 'rig' ? doc.skipped.filter((one) => /^corners? \d/.test(one.reason)).length : 0;  // the view is used
  if (inPart > 0) parts.push(`corners of ${inPart} left out`);
  if (doc.skipped.length > averaged + inPart && doc.command !== 'calibrate') parts.push(`${doc.skipped.length - averaged - inPart} skipped`);
  if (Number.isFinite(doc.estimate('rms_px')))
    parts.push(`RMS ${num(doc.estimate('rms_px'), 3)} px${doc.command === 'calibrate' ? ' per corner' : ''}`);
  if (doc.estimate('rms_range_m') > 0) parts.push(`ranges ${num(1e3 * doc.estimate('rms_range_m'), 3)} mm`);
  const total = doc.seconds.find(([name]) => name === 'total');
  if (doc.exitCode > 0) parts.push(`exit code ${doc.exitCode}`);
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
  if (/ agree$/.test(name)) candidates.unshift('clusters');
  return [...candidates, 'checks'].find((id) => ids.has(id)) ?? null;
}

const maxInWords = 4;

function checkItem(check: Check, doc: Doc, ids: Set<string>, isInWords: boolean): HTMLElement {
  const look = lookOf(check.state), target = targetOf(check.name, check.figure, ids, doc.command);
  const words = [el('span', {class: `state-${look.name}`}, el('span', {role: 'img', 'aria-label': look.word}, look.symbol), ' ', el('b', {}, check.name)), isInWords ? ` ${check.text}` : ''];
  const title = isInWords ? null : check.text;
  return el('li', {title}, target ? el('a', {href: `#fig-${target}`}, ...words) : el('span', {}, ...words));
}

/** What speaks against the answer in words, the rest by name: all of them stand in full below. */
function checksOf(doc: Doc, ids: Set<string>): HTMLElement | null {
  if (doc.checks.length === 0 || doc.command.startsWith('reproduce')) return null; // its claims stand in the first table
  const loud = doc.checks.filter((check) => check.state !== 'good'), quiet = doc.checks.filter((check) => check.state === 'good');
  loud.sort((a, b) => Number(b.state === doc.state) - Number(a.state === doc.state));
  return el('ul', {class: 'checks', 'aria-label': 'checks'},
    ...loud.map((check, i) => checkItem(check, doc, ids, i < maxInWords && check.text.length <= 160)), ...quiet.map((check) => checkItem(check, doc, ids, loud.length === 0 && quiet.length <= 3 && check.text.length <= 70)));
}

/** `like this` as code. */
function withCode(text: string): (Node | string)[] {
  return text.split('`').map((part, i) => (i % 2 === 1 ? el('code', {}, part) : part));
}

export function header(doc: Doc, ids: Set<string>): HTMLElement {
  const look = lookOf(doc.state), word = look.headline ?? look.word;
  const isSaid = doc.sentence.toLowerCase().startsWith(word.toLowerCase());
  const sentence = isSaid ? doc.sentence.slice(word.length) : `: ${doc.sentence}`;
  const counts = countsOf(doc), next = nextStep(doc);
  return el('header', {class: 'top', style: `--state:var(--${look.name})`, 'data-state': look.name},
    el('div', {class: 'headline'},
      el('h1', {class: sentence.length > 130 ? 'long' : null}, el('span', {class: 'symbol', role: 'img', 'aria-label': `state: ${word}`}, look.symbol), ' ',
        el('span', {class: 'word'}, isSaid ? doc.sentence.slice(0, word.length) : word), doc.sentence ? sentence : ''),
      el('div', {class: 'buttons'}, button('?', 'Keys and help', () => showHelp()), button('◐', 'Dark or light', toggleTheme),
        button('⤓ result.json', 'Download the numbers', () => download('result.json', 'application/json', doc.source)))),
    el('p', {class: 'counts'}, el('b', {}, `alidade ${doc.command}`), counts.length > 0 ? ' · ' + counts.join(' · ') : ''),
    next ? el('p', {class: 'to-do'}, el('b', {}, doc.toAdd ? 'What to do: ' : 'Next: '), ...withCode(next)) : null,
    checksOf(doc, ids));
}
