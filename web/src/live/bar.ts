// The line above a live page: whether it lives, the time, how many rows come, how late, how many are lost.
import type {Doc} from '../core/document';
import {button, el} from '../core/dom';
import {choice} from '../core/figure';
import {num, percent} from '../core/format';
import {showHelp, toggleTheme} from '../page/keys';
import type {Message} from './connection';
import type {HeadRows} from './rows';

const looks = {connecting: ['○', 'connecting', 'unknown'], live: ['●', 'live', 'good'], lost: ['✕', 'stopped', 'bad']} as const;
const maxLog = 6;

function clock(seconds: number): string {
  if (!Number.isFinite(seconds)) return '–';
  const whole = Math.max(0, seconds), minutes = Math.floor(whole / 60);
  return `${String(minutes).padStart(2, '0')}:${(whole - 60 * minutes).toFixed(2).padStart(5, '0')}`;
}

export class LiveBar {
  readonly element: HTMLElement;
  private readonly symbol = el('span', {class: 'symbol', role: 'img'});
  private readonly word = el('span', {class: 'word'});
  private readonly facts = el('span', {class: 'live-facts'});
  private readonly more = el('p', {class: 'counts'});
  private readonly logged = el('ul', {class: 'live-log', 'aria-label': 'log'});
  private readonly held: HTMLButtonElement;
  private readonly arrivals: number[] = [];
  private time_s = NaN;
  private delay_s = NaN;
  private lost = 0;
  private trial = '';
  private working = '';
  private told_ms = 0;
  private readonly gated = {left: 0, seen: 0};

  constructor(private readonly doc: Doc, hold: () => void, look: (seconds: number) => void) {
    this.held = button('hold', 'Hold the figures (space)', hold, {'aria-pressed': 'false', class: 'hold'});
    const spans = el('div');
    choice(spans, 'how much is shown', ['10 s', '60 s', 'all'], (i) => look([10, 60, 0][i]!));
    this.element = el('header', {class: 'top live'},
      el('div', {class: 'headline'}, el('h1', {}, this.symbol, ' ', this.word, ' ', this.facts),
        el('div', {class: 'buttons'}, this.held, spans, button('?', 'Keys and help', () => showHelp()), button('◐', 'Dark or light', toggleTheme))),
      this.more, this.logged);
    this.setState('connecting', '');
  }
  setState(state: keyof typeof looks, words: string): void {
    const [symbol, word, colour] = looks[state];
    this.element.dataset['state'] = state;
    this.element.style.setProperty('--state', `var(--${colour})`);
    this.symbol.textContent = symbol;
    this.symbol.setAttribute('aria-label', `state: ${word}`);
    this.word.textContent = word;
    if (words) this.add('warning', words);
  }
  setHeld(isHeld: boolean): void {
    this.held.setAttribute('aria-pressed', String(isHeld));
    this.held.textContent = isHeld ? 'go on' : 'hold';
  }
  takeRow(row: Message, rows: HeadRows): void {
    this.arrivals.push(performance.now());
    this.time_s = rows.time;
    this.trial = rows.trial;
    if (typeof row['t_arrival_s'] === 'number') this.delay_s = row['t_arrival_s'] - Number(row['t_capture_s']);
    if (typeof row['seconds'] === 'number') this.delay_s = row['seconds'];
    if (typeof row['innovation_u_px'] === 'number') ++this.gated.seen, (this.gated.left += row['accepted'] === false ? 1 : 0);
  }
  /** What the server rejected for this page. */
  noteStatus(words: string): void {
    const dropped = /dropped (\d+) images and (\d+) steps/.exec(words);
    if (dropped) this.lost += Number(dropped[1]) + Number(dropped[2]);
    else this.add('info', words);
  }
  progress(message: Message): void {
    const {what, done, total} = message as {what: string; done: number; total: number};
    this.working = total > 0 ? `${what} ${done}/${total}` : `${what} ${done}`;
  }
  log(message: Message): void {
    this.add(Number(message['level']) > 2 ? 'warning' : 'info', String(message['message']));
  }
  private add(level: string, words: string): void {
    this.logged.append(el('li', {class: level}, level === 'warning' ? '▲ ' : '', words));
    while (this.logged.childElementCount > maxLog) this.logged.firstElementChild!.remove();
  }
  drawn(): void {
    this.facts.textContent = this.words();
  }
  /** Twice a second also where nothing comes. */
  tick(now: number): void {
    if (now - this.told_ms < 500) return;
    this.told_ms = now;
    this.facts.textContent = this.words();
    this.more.replaceChildren(el('b', {}, `alidade ${this.doc.command}`), ` · ${this.doc.argv.slice(1).join(' ')}`, this.working ? ` · ${this.working}` : '');
  }
  private words(): string {
    const now = performance.now();
    while (this.arrivals.length > 0 && now - this.arrivals[0]! > 2000) this.arrivals.shift();
    const parts = [clock(this.time_s), `${num(this.arrivals.length / 2, 3)} Hz`];
    if (Number.isFinite(this.delay_s)) parts.push(`${this.doc.command === 'localize' ? 'a frame takes' : 'delay'} ${num(1e3 * this.delay_s, 3)} ms`);
    parts.push(`${this.lost} lost`);
    if (this.trial) parts.push(`controller ${this.trial}`);
    if (this.gated.seen > 0) parts.push(`gated ${this.gated.left}/${this.gated.seen} (${percent(this.gated.left, this.gated.seen, 1)})`);
    return parts.join(' · ');
  }
}
