// Does each frame fit? Innovations against their σ.
import {legend, type Figure} from '../core/figure';
import {percent} from '../core/format';
import {drawNis} from './nis_plot';
import {observeScene} from './observe_scene';

export const observeNis: Figure = {
  id: 'nis', title: 'Does each frame fit?', note: 'NIS', span: 8,
  draw(host, doc, selection) {
    const scene = observeScene(doc);
    if (!scene || !scene.steps.hasValues('nis')) return null;
    const dof = scene.steps.numbers('nis_dof');
    legend(host, [{words: 'a frame', colour: 'var(--blue)', look: 'dot'}, {words: '95 % of frames', colour: 'var(--blue)', look: 'band'}, {words: 'mean', colour: 'var(--orange)'}]);
    const share = drawNis(host, {t: scene.t, nis: scene.steps.numbers('nis'), dof: (i) => Math.floor(dof[i]!), counts: (i) => scene.steps.text('event', i) === '', selection,
      label: 'NIS over its degrees of freedom: 1 is expected', xLabel: scene.timeLabel, height: 280, events: scene.events, spans: scene.zooms, isFilling: true});
    const words = `${percent(share.inside, share.known, 1)} are inside (95 % expected)`;
    return {marks: share.known, rows: share.known, tables: [scene.steps], words, good: `Good: dots in the band, the mean near 1; above: noisier than stated, or the model lacks something. Here ${words}.`};
  },
};
