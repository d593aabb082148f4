// What the figures of `observe` draw, out of its tables.
import type {Doc, Table} from '../core/document';
import {rotationOf, type M3} from '../core/rigid';
import type {EventMark} from '../core/series';

export interface ObserveScene {
  steps: Table;
  t: Float64Array; // from the first step where that is far from zero
  isRelative: boolean;
  events: EventMark[];
  zooms: {from: number; to: number}[];
  timeLabel: string;
  attitude(i: number): M3 | null; // start_from_cam
}

const eventWords: Record<string, string> = {start: 'first estimate', burst: 'a frame rejected: noise burst', slip: 'a point slipped', zoom: 'zoom begins',
  zoom_end: 'zoom ends', restart: 'started again', gap: 'gap in the log', one_head: '', waiting: '', gated: 'rejected', lost: 'lost'};

export function wordsOfEvent(kind: string): string {
  return Object.prototype.hasOwnProperty.call(eventWords, kind) ? eventWords[kind]! : kind;
}

export function observeScene(doc: Doc): ObserveScene | null {
  const steps = doc.table('steps');
  if (!steps) return null;
  const raw = steps.numbers('t_s'), first = raw.find(Number.isFinite) ?? 0, isRelative = Math.abs(first) > 1e4;
  const t = isRelative ? raw.map((v) => v - first) : raw, events: EventMark[] = [], zooms: {from: number; to: number}[] = [];
  const hasEnds = Array.from({length: steps.rows}, (_, i) => steps.text('event', i)).includes('zoom_end');
  let from = NaN;
  for (let i = 0; i < steps.rows; ++i) {
    const kind = steps.text('event', i), words = wordsOfEvent(kind);
    if (kind === 'zoom' && Number.isNaN(from)) from = t[i]!;
    if (Number.isFinite(from) && (hasEnds ? kind === 'zoom_end' : kind !== 'zoom')) zooms.push({from, to: t[i]!}), (from = NaN);
    if (words && kind !== 'zoom') events.push({t: t[i]!, words: kind === 'slip' ? `p${steps.number('event_point', i) + 1} slipped` : words});
  }
  if (Number.isFinite(from)) zooms.push({from, to: t[t.length - 1]!});
  const q = ['qx', 'qy', 'qz', 'qw'].map((name) => steps.numbers(`start_from_cam_${name}`));
  return {steps, t, isRelative, events: events.slice(0, 400), zooms: zooms.filter((zoom) => zoom.to > zoom.from), timeLabel: doc.table('photos') ? 'photo, the first is 0' : isRelative ? 'time from the first row, s' : 'time, s',
    attitude: (i) => (q.every((one) => Number.isFinite(one[i]!)) ? rotationOf(q[0]![i]!, q[1]![i]!, q[2]![i]!, q[3]![i]!) : null)};
}
