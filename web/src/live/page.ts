// The page of a run that is going on: connects, follows its rows, and becomes the report when it ends.
import {charts} from '../core/chart';
import {readDocument, type Doc} from '../core/document';
import {el} from '../core/dom';
import {choice} from '../core/figure';
import {Selection} from '../core/selection';
import {seriesPlots} from '../core/series';
import {views3} from '../core/view3';
import type {Card} from '../page/card';
import {listenToKeys} from '../page/keys';
import {LiveBar} from './bar';
import {connect, type Message} from './connection';
import {livePlots, plotsOf, type LivePlot} from './plots';
import {LiveImage} from './image';
import {HeadRows} from './rows';
import {Space, type Calibration} from './space';

/** Whether this page was served by a run that is going on. */
export function isLive(doc: Doc): boolean {
  return location.protocol.startsWith('http') && doc.isReadable && (doc.json as Message)['live'] === true;
}

const min_interval_ms = 30; // between two drawings: more is not seen

class LivePage {
  private readonly rows = new HeadRows();
  private readonly stop = new AbortController();
  private readonly bar: LiveBar;
  private readonly main = el('main');
  private readonly cards: Card[] = [];
  private readonly plots: LivePlot[] = [];
  private readonly images = new Map<string, LiveImage>();
  private readonly space: Space | null;
  private readonly cameras = new Map<string, Calibration>();
  private readonly choices: HTMLElement[] = [];
  private readonly connection: {close: () => void};
  private head = -1;
  private drawn_ms = 0;
  private spaceDrawn_ms = 0;
  private spaceTook_ms = 0;
  private span_s = 10;
  private isHeld = false;
  private isFresh = false;
  private stopWords = '';
  updates = 0;

  constructor(private readonly doc: Doc, private readonly host: HTMLElement, private readonly ended: (result: Doc) => void) {
    this.bar = new LiveBar(doc, () => this.hold(), (seconds) => this.look(seconds));
    host.append(this.bar.element, this.main);
    this.space = ['track', 'servo', 'localize'].includes(doc.command) ? new Space(this.card('space', 'Where is it now?', 'm', 12), false) : null;
    for (const card of plotsOf[doc.command] ?? []) {
      const body = this.card(card.id, card.title, card.note, card.span);
      if (card.isPerHead) this.choices.push(body.appendChild(el('div')));
      this.plots.push(...livePlots(body, card, () => (card.isPerHead ? this.rows.heads.get(this.head) ?? null : this.rows.all)));
    }
    listenToKeys(doc, new Selection(), this.cards, this.stop.signal, {' ': () => this.hold()});
    this.connection = connect({
      message: (topic, message) => this.take(topic, message),
      status: (level, words) => {
        if (level === 2) this.stopWords = words;
        else this.bar.noteStatus(words);
      },
      opened: () => this.bar.setState('live', ''),
      silent: () => this.bar.setState('lost', 'no answer'),
      closed: () => this.bar.setState('lost', this.stopWords || 'the connection is lost: the run, or its machine, has gone'),
    });
    const loop = () => {
      if (this.stop.signal.aborted) return;
      this.step();
      requestAnimationFrame(loop);
    };
    requestAnimationFrame(loop);
  }
  private card(id: string, title: string, note: string, span: number): HTMLElement {
    const body = el('div', {class: 'body'});
    const section = el('section', {class: 'card', id: `fig-${id}`, style: `--span:${span}`, tabindex: -1},
      el('div', {class: 'title'}, el('h2', {}, title), el('span', {class: 'note'}, note)), body);
    this.main.append(section);
    this.cards.push({figure: {id, title, note, span, draw: () => null}, view: {marks: 0, rows: 0, tables: [], words: ''}, section});
    return body;
  }

  private take(topic: string, message: Message): void {
    const part = /^\/(head\d+)\/(camera|marks|image)$/.exec(topic);
    if (part) return this.takePart(part[1]!, part[2]!, message);
    if (topic === '/tf') return this.space?.takeFrames(message);
    if (topic === '/scene') return this.space?.takeScene(message);
    if (topic === '/progress') return this.bar.progress(message);
    if (topic === '/log') return this.bar.log(message);
    if (topic === '/result') return void this.end();
    if (topic !== `/${this.doc.command}`) return;
    if (this.rows.push(message)) this.space?.clear();
    this.bar.takeRow(message, this.rows);
    this.isFresh = true;
  }
  private takePart(head: string, part: string, message: Message): void {
    if (part === 'camera') this.cameras.set(head, message as unknown as Calibration), this.space?.cameras.set(head, message as unknown as Calibration);
    let image = this.images.get(head);
    if (!image && part === 'camera') return; // nothing to show in it yet
    if (!image) {
      const isAlone = ['localize', 'head'].includes(this.doc.command);
      const body = this.card(head, isAlone ? 'What does it see?' : `What does ${head.replace('head', 'head ')} see?`, this.doc.command === 'head' ? 'dot: the target' : 'ring: 3σ, dot: seen', isAlone ? 12 : 6);
      const section = body.parentElement!, first = this.main.querySelector('#fig-space') ?? this.main.firstElementChild;
      const before = [...this.images.keys()].length > 0 ? this.main.querySelector(`#fig-${[...this.images.keys()].pop()}`) : first;
      before?.after(section);
      this.images.set(head, (image = new LiveImage(body, head)));
    }
    image.camera = this.cameras.get(head) ?? null;
    if (part === 'marks') image.takeMarks(message);
    else if (part === 'image') void image.takeImage(message).then(() => (this.isFresh = true));
  }

  private step(): void {
    const now = performance.now();
    this.bar.tick(now);
    if (this.isHeld || !this.isFresh || now - this.drawn_ms < min_interval_ms) return;
    this.isFresh = false;
    this.drawn_ms = now;
    this.offerHeads();
    const end = this.rows.time, begin = this.span_s > 0 ? Math.max(this.rows.first, end - this.span_s) : this.rows.first;
    if (Number.isFinite(end)) for (const plot of this.plots) plot.follow([begin, Math.max(end, begin + 0.5)]);
    for (const image of this.images.values()) image.redraw();
    // Space takes ten times as long as the rest where there is no graphics processor: it gets a sixth of the time.
    if (this.space && now - this.spaceDrawn_ms > Math.max(200, 8 * this.spaceTook_ms)) {
      this.spaceDrawn_ms = now;
      this.space.draw();
      requestAnimationFrame(() => (this.spaceTook_ms = performance.now() - now));
    }
    if (++this.updates === 1) performance.mark('drawn'); // for tests
    this.bar.drawn();
  }
  private offerHeads(): void {
    const heads = [...this.rows.heads.keys()].sort((a, b) => a - b);
    if (!this.rows.heads.has(this.head) && heads.length > 0) this.head = heads[0]!;
    for (const place of this.choices) {
      if (heads.length < 2 || place.childElementCount > 0 && place.firstElementChild!.childElementCount === heads.length) continue;
      place.replaceChildren();
      choice(place, 'head', heads.map((head) => `head ${head}`), (i) => {
        this.head = heads[i]!;
        for (const other of this.choices) [...(other.firstElementChild?.children ?? [])].forEach((button, k) => button.setAttribute('aria-pressed', String(k === i)));
        this.isFresh = true;
      });
    }
  }
  private hold(): void {
    this.isHeld = !this.isHeld;
    this.isFresh = true;
    this.bar.setHeld(this.isHeld);
  }
  private look(seconds: number): void {
    this.span_s = seconds;
    this.isFresh = true;
  }

  /** The run has ended: the same page becomes the report. */
  private async end(): Promise<void> {
    let text = '';
    try {
      text = await (await fetch(`/result.json${location.search}`)).text();
    } catch {
      return this.bar.setState('lost', 'the run has ended, and is gone; its report is in its folder');
    }
    this.connection.close();
    this.stop.abort();
    charts.clear();
    seriesPlots.clear();
    views3.clear();
    this.host.replaceChildren();
    this.ended(readDocument(text));
    document.documentElement.dataset['live'] = 'ended';
  }
}

export function showLive(doc: Doc, host: HTMLElement, ended: (result: Doc) => void): void {
  document.documentElement.dataset['live'] = 'live';
  const page = new LivePage(doc, host, ended);
  // For tests.
  (window as unknown as Record<string, unknown>)['alidade'] = {doc, charts, views3, page};
}
