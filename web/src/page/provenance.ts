// Where it comes from: version, command line, inputs with SHA-256, time, seed, seconds, what was skipped.
import type {Doc} from '../core/document';
import {el} from '../core/dom';
import {num} from '../core/format';

function fact(name: string, value: string, isMono = false): HTMLElement {
  return el('tr', {}, el('th', {}, name), el('td', {class: isMono ? 'mono' : null}, value || '–'));
}

export function provenance(doc: Doc): HTMLElement {
  const many = doc.inputs.length > 3;
  const seconds = doc.seconds.map(([name, value]) => `${name.replace(/_/g, ' ')} ${num(value, 3)} s`).join(' · ');
  return el('section', {class: 'card', id: 'provenance'},
    el('div', {class: 'title'}, el('h2', {}, 'Where this comes from')),
    el('table', {class: 'facts'}, fact('version', `alidade ${doc.version}`), fact('command', doc.argv.join(' '), true),
      fact('made', doc.createdUtc), doc.seed ? fact('seed', doc.seed) : '', fact('time', seconds)),
    doc.inputs.length > 0 ? el('details', {open: !many}, el('summary', {}, `${doc.inputs.length} input file${doc.inputs.length === 1 ? '' : 's'}`),
      el('div', {class: 'scroll'}, el('table', {class: 'data'},
        el('thead', {}, el('tr', {}, ...['role', 'name', 'bytes', 'SHA-256'].map((name) => el('th', {}, name)))),
        el('tbody', {}, ...doc.inputs.map((input) => el('tr', {}, el('td', {class: 'word'}, input.role), el('td', {class: 'word'}, input.name),
          el('td', {}, num(input.bytes, 12)), el('td', {class: 'word mono'}, input.sha256))))))) : null,
    doc.skipped.length > 0 ? el('details', {open: doc.skipped.length <= 6}, el('summary', {}, `${doc.skipped.length} skipped or left out, and why`),
      el('ul', {}, ...doc.skipped.slice(0, 500).map((one) =>
        el('li', {}, el('b', {}, one.file + (one.line > 0 ? `:${one.line}` : '')), ' ' + one.reason)))) : null);
}
