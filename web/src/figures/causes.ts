// Which cause do the residuals ask for? Score tests: what they would gain if one thing more were estimated.
import type {Doc} from '../core/document';
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {num, withSigma} from '../core/format';

interface Cause {
  name: string;
  z: number;
  words: string; // what it would come out as
}

function causesOf(doc: Doc): Cause[] {
  const found: Cause[] = [];
  for (let i = 0; doc.estimateText(`causes[${i}].name`) || Number.isFinite(doc.estimate(`causes[${i}].z`)); ++i) {
    const members: string[] = [];
    for (let k = 0; doc.estimateText(`causes[${i}].members[${k}].name`); ++k) {
      const at = `causes[${i}].members[${k}]`;
      members.push(`${doc.estimateText(`${at}.name`)} ${withSigma(doc.estimate(`${at}.value`), doc.estimate(`${at}.sigma`), doc.estimateText(`${at}.unit`))}`);
    }
    // A rig tells the size alone; its σ is in the score.
    const z = [doc.estimate(`causes[${i}].z`), doc.estimate(`causes[${i}].sigmas`)].find(Number.isFinite) ?? NaN, size = doc.estimate(`causes[${i}].size`);
    if (members.length === 0 && Number.isFinite(size)) members.push(withSigma(size, Number.isFinite(z) && z !== 0 ? Math.abs(size / z) : NaN, ''));
    found.push({name: doc.estimateText(`causes[${i}].name`), z, words: members.join(', ')});
  }
  return found.sort((a, b) => Math.abs(b.z) - Math.abs(a.z));
}

export const causes: Figure = {
  id: 'causes', isOptional: true, title: 'Which cause do the residuals indicate?', note: 'score in σ; beside it what it would be, ± 3σ', span: 12,
  draw(host, doc) {
    const all = causesOf(doc);
    if (all.length === 0) return null;
    host.append(el('div', {class: 'scroll'}, el('table', {class: 'estimate'}, el('thead', {}, el('tr', {}, ...['', 'score', 'would be'].map((word) => el('th', {}, word)))),
      el('tbody', {}, ...all.map(({name, z, words}) => el('tr', {}, el('th', {}, name.replace(/_/g, ' ')), el('td', {class: 'value'}, `${num(z, 2)} σ`), el('td', {class: 'word'}, words)))))));
    const worst = all[0]!;
    return {marks: all.length, rows: all.length, tables: [], words: `${worst.name} ${num(worst.z, 2)} σ`, good: `Each by one linearisation, as if it alone were estimated as well. The largest here: ${worst.name.replace(/_/g, ' ')}, ${num(worst.z, 2)} σ.`};
  },
};
