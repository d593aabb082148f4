// The page of a capture: the camera's image, where to hold the board, what is gained; it becomes the report.
import {Chart, charts, type Pen} from '../core/chart';
import {cividis, css, onto, pixelShare} from '../core/colours';
import {readDocument, type Doc} from '../core/document';
import {button, el} from '../core/dom';
import {num} from '../core/format';
import {findImages} from '../core/images';
import {redrawAll, showHelp, toggleTheme, type KeyHelp} from '../page/keys';
import {Camera} from './camera';
import {connect, type Line, type Look, type Message, type State} from './messages';
import {CameraView} from './view';

export type Stage = 'asking' | 'refused' | 'looking' | 'paused' | 'watching' | 'goal' | 'ended' | 'lost';
const looks: Record<Stage, [string, string, string]> = {
  asking: ['○', 'may the camera be used?', 'unknown'], refused: ['■', 'the camera was refused', 'refused'],
  looking: ['●', 'looking', 'good'], paused: ['◆', 'paused', 'care'], watching: ['○', 'watching: another page is in control', 'unknown'],
  goal: ['●', 'the goal is reached: calibrating', 'good'], ended: ['●', 'ended', 'good'], lost: ['✕', 'stopped', 'bad'],
};
const min_interval_ms = 70; // between two images: the page and the solver share a machine
const maxNotes = 4;

const boardKeys: KeyHelp = [['space', 'take the image as it is'], ['u', 'undo: forget the last photo'], ['p', 'pause: nothing is taken automatically; again: go on']];
const shotKeys: KeyHelp = [['space', 'to the field of the reading'], ['Enter', 'in that field: take the image with the reading'], ['u', 'undo: forget the last shot']];
const bothKeys: KeyHelp = [['Enter', 'end: what was taken is calibrated'], ['m', 'the image as in a mirror'], ['d', 'dark or light'], ['Esc', 'close this help'], ['?', 'this help']];

function moreWords(needed: number): string {
  return needed > 200 ? 'hundreds of photos more' : `about ${needed} more photo${needed === 1 ? '' : 's'}`;
}

interface CaptureDocument {
  kind?: 'shots'; // of a rangefinder: each photo with what it read
  source: string;
  board: {cols: number; rows: number};
  until: number;
}

/** Whether this page was served by a capture that is going on. */
export function isCapture(doc: Doc): boolean {
  return location.protocol.startsWith('http') && doc.isReadable && typeof (doc.json as Record<string, unknown>)['capture'] === 'object';
}

class CapturePage {
  private readonly about: CaptureDocument;
  private readonly root = document.documentElement;
  private readonly view: CameraView;
  private readonly line: Line;
  private readonly stop = new AbortController();
  private readonly header: HTMLElement;
  private readonly symbol = el('span', {class: 'symbol', role: 'img'});
  private readonly word = el('span', {class: 'word'});
  private readonly facts = el('span', {class: 'live-facts'});
  private readonly advice = el('p', {class: 'capture-advice', 'aria-live': 'polite'});
  private readonly target = el('p', {class: 'caption'});
  private readonly figure = el('p', {class: 'capture-figure'});
  private readonly goal = el('p', {class: 'caption'});
  private readonly notes = el('ul', {class: 'live-log capture-notes', 'aria-live': 'polite'});
  private readonly again = button('ask again', 'Ask for the camera again', () => void this.openCamera(), {hidden: true});
  private readonly buttons: Record<'take' | 'undo' | 'pause' | 'end' | 'mirror', HTMLButtonElement>;
  private readonly map: Chart;
  private readonly isShots: boolean;
  private readonly reading = el('input', {id: 'reading', type: 'number', min: '0', step: 'any', inputmode: 'decimal', autocomplete: 'off', 'aria-label': 'what the rangefinder reads, in metres'});
  private camera: Camera | null = null;
  private state: State | null = null;
  private hasControl: boolean | null = null;
  private isOpening = false;
  private isOver = false;
  private answered: (() => void) | null = null;
  private sound: AudioContext | null = null;
  private stage: Stage = 'asking';

  constructor(doc: Doc, private readonly host: HTMLElement, private readonly ended: (result: Doc) => void) {
    this.about = (doc.json as Record<string, unknown>)['capture'] as CaptureDocument;
    const isBrowsers = this.about.source === 'browser', isShots = this.about.kind === 'shots';
    this.isShots = isShots;
    this.view = new CameraView(isBrowsers);
    const made = (id: string, text: string, label: string, act: () => void, more = {}) => {
      const one = button(text, label, act, {id, ...more});
      one.addEventListener('click', (event) => event.detail > 0 && one.blur()); // after a click the keys are the page's again
      return one;
    };
    this.buttons = {
      take: made('take', 'take', isShots ? 'Take this image with the reading (Enter in its field)' : 'Take this image (space)', () => this.take()),
      undo: made('undo', 'undo', isShots ? 'Forget the last shot (u)' : 'Forget the last photo (u)', () => this.line.ask('undo')),
      pause: made('pause', 'pause', 'Take nothing by itself for now (p)', () => this.togglePause(), {'aria-pressed': 'false'}),
      end: made('end', 'end', 'End and calibrate (Enter)', () => this.line.ask('end')),
      mirror: made('mirror', 'mirror', 'Show the image as a mirror does (m)', () => this.mirror(), {'aria-pressed': 'false'}),
    };
    this.header = el('header', {class: 'top live'},
      el('div', {class: 'headline'}, el('h1', {}, this.symbol, ' ', this.word, ' ', this.facts),
        el('div', {class: 'buttons'}, this.again, button('?', 'Keys and help', () => this.help()), button('◐', 'Dark or light', toggleTheme))),
      el('p', {class: 'counts'}, el('b', {}, `alidade ${isShots ? 'rangefinder' : 'calibrate'} --live`), ` · board ${this.about.board.cols}×${this.about.board.rows}${this.goalWords()}`), this.notes);
    const mapBody = el('div', {class: 'body'}), main = el('main'), {take, undo, pause, mirror, end} = this.buttons;
    const buttons = isShots ? [el('label', {class: 'capture-reading'}, 'reading ', this.reading, ' m'), take, undo, end, mirror] : Object.values({take, undo, pause, end, mirror});
    main.append(
      el('section', {class: 'card', id: 'fig-camera', style: '--span:16'},
        this.view.element, this.advice, this.target,
        el('div', {class: 'capture-buttons'}, ...buttons),
        el('p', {class: 'good'}, isShots ? 'space goes to the reading, Enter in it takes · u undo · m mirror · Enter ends · d dark or light' : 'space takes · u undo · p pause · m mirror · Enter ends · d dark or light')),
      el('section', {class: 'card', id: 'fig-sigma', style: '--span:8'},
        el('div', {class: 'title'}, el('h2', {}, isShots ? 'How well is the beam known?' : 'How well is a pixel known?'), el('span', {class: 'note'}, isShots ? '3σ, mm' : '3σ, px')),
        this.figure, this.goal, mapBody));
    host.append(this.header, main);
    this.map = new Chart(mapBody, {height: 180, aspect: 0.75, most: 420, label: isShots ? '3σ of the origin, shot by shot' : '3σ over the image'}, (pen) => (isShots ? this.drawHistory(pen) : this.drawMap(pen)));
    this.listen();
    this.set('asking');
    this.line = connect((message) => this.hear(message), (jpeg) => void this.view.show(jpeg), () => this.lose('the run has gone. Its photos are on disk: go on with --resume'));
    this.view.say(isBrowsers ? '' : 'waiting for an image');
    this.showState();
  }

  private set(stage: Stage, why = ''): void {
    this.stage = stage;
    const [symbol, usual, colour] = looks[stage], word = why || usual;
    this.root.dataset['capture'] = stage;
    this.header.dataset['state'] = stage;
    this.header.style.setProperty('--state', `var(--${colour})`);
    this.symbol.textContent = symbol;
    this.symbol.setAttribute('aria-label', `state: ${word}`);
    this.word.textContent = word;
    this.again.hidden = stage !== 'refused';
    const isActive = stage === 'looking' || stage === 'paused';
    for (const [name, one] of Object.entries(this.buttons)) one.disabled = name !== 'mirror' && !isActive && !(stage === 'refused' && name === 'end');
    this.reading.disabled = !isActive;
  }
  private goalWords(): string {
    if (!this.isShots) return ` · goal 3σ ≤ ${num(this.about.until, 3)} px at the worst pixel`;
    return this.about.until > 0 ? ` · goal 3σ ≤ ${num(this.about.until, 3)} mm at the origin` : '';
  }
  private help(): void {
    showHelp([...(this.isShots ? shotKeys : boardKeys), ...bothKeys], 'Every photo that was taken is on disk: a run that was ended or lost goes on with --resume. “±” is 3σ everywhere.');
  }
  /** A photo; of a rangefinder with what it reads, once. */
  private take(): void {
    if (!this.isShots) return this.line.ask('take');
    const read = this.reading.value.trim() === '' ? NaN : Number(this.reading.value);
    if (!(read > 0)) return this.advise('enter the rangefinder’s reading first'), this.reading.focus();
    this.line.ask('take', read);
  }
  private note(words: string, level = 'info'): void {
    if (this.notes.lastElementChild?.textContent === words) return;
    this.notes.append(el('li', {class: level}, words));
    while (this.notes.childElementCount > maxNotes) this.notes.firstElementChild!.remove();
  }
  private lose(words: string): void {
    if (this.isOver) return;
    this.set('lost');
    this.note(`▲ ${words}`, 'warning');
    this.finishCamera();
    this.finishGuidance('nothing is taken any more');
  }
  private finishCamera(): void {
    this.camera?.stop();
    this.camera = null;
    this.answered?.();
  }

  private isDone(): boolean {
    return this.stage === 'goal' || this.stage === 'ended' || this.stage === 'lost';
  }
  /** No image comes any more: nothing is to be filled. */
  private finishGuidance(words: string): void {
    this.view.finish();
    this.target.textContent = '';
    this.advise(words);
  }

  private hear(message: Message): void {
    if (message.op === 'control') return void this.control(message.yes);
    if (message.op === 'state') return this.takeState(message);
    if (message.op === 'look') return this.takeLook(message);
    if (message.op === 'took') return this.isDone() ? undefined : this.celebrate(message.file); // an answer that was on its way
    if (message.op === 'note') return this.note(message.words);
    if (message.op === 'goal') {
      if (message.holds) this.set('goal');
      return this.finishGuidance(message.holds ? 'the goal is reached: the report follows' : 'calibrating: the report follows');
    }
    void this.end(message.report);
  }
  private async control(isOurs: boolean): Promise<void> {
    this.hasControl = isOurs;
    if (!isOurs) {
      if (this.view.video) this.view.say('the camera’s image is in the page in control');
      return this.set('watching');
    }
    if (this.about.source !== 'browser') return this.set(this.state?.paused ? 'paused' : 'looking');
    await this.openCamera();
  }
  private async openCamera(): Promise<void> {
    if (this.isOpening || this.camera || !this.view.video) return;
    this.isOpening = true;
    this.set('asking');
    this.view.say('the browser asks whether the camera may be used');
    try {
      this.camera = await Camera.open(this.view.video, () => this.lose('the camera is gone: plug it in, and load this page again'));
      this.view.say('');
      this.root.dataset['exact'] = this.camera.isExact ? '1' : '0';
      this.set(this.state?.paused ? 'paused' : 'looking');
      void this.pump();
    } catch (error) {
      const name = (error as Error).name;
      const why = name === 'NotFoundError' || name === 'OverconstrainedError' ? 'there is no camera' : name === 'NotReadableError' ? 'the camera is used by another program' : '';
      this.set('refused', why);
      this.view.say(why === '' ? 'allow the camera in the address bar, then ask again' : `${why}${name === 'NotReadableError' ? ': end that one' : ': plug one in'}, then ask again`);
    }
    this.isOpening = false;
  }
  /** One image after the other: the next when this one has been looked at. */
  private async pump(): Promise<void> {
    for (let isFirst = true; this.camera && !this.isOver; isFirst = false) {
      const begun = performance.now(), image = await this.camera.next();
      if (!this.camera || this.isOver) return;
      if (!image) {
        await new Promise((later) => setTimeout(later, 50));
        continue;
      }
      const wasExact = this.root.dataset['exact'];
      this.root.dataset['exact'] = image.isExact ? '1' : '0';
      if (!image.isExact && (isFirst || wasExact === '1')) this.note('this browser gives no exact images: they come by a canvas, some grey values off, and the result says so');
      const answer = new Promise<void>((come) => (this.answered = come));
      this.line.send(image);
      await answer;
      await new Promise((later) => setTimeout(later, Math.max(0, min_interval_ms - (performance.now() - begun))));
    }
  }

  private takeState(state: State): void {
    const warnings = this.state?.warnings ?? [];
    this.state = state;
    for (const warning of state.warnings) if (!warnings.includes(warning)) this.note(`▲ ${warning}`, 'warning');
    if (this.stage === 'looking' || this.stage === 'paused') this.set(state.paused ? 'paused' : 'looking');
    this.buttons.pause.textContent = state.paused ? 'go on' : 'pause';
    this.buttons.pause.setAttribute('aria-pressed', String(state.paused));
    this.view.takeState(state);
    this.showState();
  }
  private showState(): void {
    const state = this.state, photos = state?.photos ?? 0;
    this.root.dataset['photos'] = String(photos);
    if (this.isShots) return this.showShots();
    this.facts.textContent = `· ${photos} photo${photos === 1 ? '' : 's'}${state?.last ? `, the last ${state.last}` : ''}`;
    const worst = state?.worst ?? null;
    this.figure.textContent = worst === null ? '–' : `${num(worst, 2)} px`;
    const needed = state?.needed;
    this.goal.textContent = worst === null
      ? 'a few photos first: there is no camera yet'
      : worst <= this.about.until ? `at the goal of ${num(this.about.until, 3)} px` : `3σ at the worst pixel; the goal is ${num(this.about.until, 3)} px${needed ? `, ${moreWords(needed)}` : ''}`;
    const next = this.isDone() ? null : state?.next;
    this.target.textContent = next ? `Next: ${this.view.isMirrored ? next.words_mirrored : next.words}. Fill the outline.` : '';
    this.map.redraw();
  }
  private showShots(): void {
    const state = this.state, shots = state?.photos ?? 0, next = this.isDone() ? null : state?.next;
    this.facts.textContent = `· ${shots} shot${shots === 1 ? '' : 's'}`;
    this.figure.textContent = state?.worst == null ? '–' : `${num(state.worst, 2)} mm`;
    this.goal.textContent = shots === 0 ? 'no shot yet' : state?.sentence ?? '';
    this.target.textContent = next ? `Next: ${this.view.isMirrored ? next.words_mirrored : next.words}.${next.outline.length > 0 ? ' Fill the outline.' : ''}` : '';
    this.map.redraw();
  }
  private takeLook(look: Look): void {
    this.answered?.();
    if (this.isDone()) return;
    this.view.takeLook(look);
    if (this.hasControl === false || this.about.source !== 'browser') this.root.dataset['exact'] = look.exact ? '1' : '0';
    const words = this.view.isMirrored ? look.words_mirrored : look.words;
    if (this.isShots) return this.advise(words);
    this.advise(look.sight === 'useful' ? (!this.state?.paused ? 'taken' : this.hasControl === false ? 'worth taking' : 'worth taking: space takes it') : look.sight === 'moving' ? words || 'hold it still' : words === 'as outlined' ? 'hold it still' : words);
  }
  private advise(words: string): void {
    if (this.advice.textContent !== words) this.advice.textContent = words;
  }
  private celebrate(file: string): void {
    this.view.flash();
    this.advise(`taken: ${file}`);
    if (this.isShots) this.reading.value = '';
    if (!navigator.userActivation?.hasBeenActive) return; // browsers let no page sound before
    this.sound ??= new AudioContext();
    const tone = this.sound.createOscillator(), volume = this.sound.createGain(), now = this.sound.currentTime;
    tone.frequency.value = 880;
    volume.gain.setValueAtTime(0.15, now);
    volume.gain.exponentialRampToValueAtTime(0.001, now + 0.18);
    tone.connect(volume).connect(this.sound.destination);
    tone.start(now);
    tone.stop(now + 0.2);
  }

  /** Shot by shot, on a logarithmic scale. */
  private drawHistory(pen: Pen): void {
    const values = this.state?.history ?? [], known = values.filter((one): one is number => one !== null && one > 0);
    pen.rect(0, 0, pen.w, pen.h, pen.c.panel);
    if (known.length === 0) return pen.text('no beam yet', pen.w / 2, pen.h / 2, {align: 'center', colour: pen.c.soft});
    const low = Math.log(Math.min(...known)) - 0.2, high = Math.log(Math.max(...known)) + 0.2, left = 34, right = 14, top = 12, bottom = 22;
    const x = (shot: number) => left + ((pen.w - left - right) * (shot - 0.5)) / values.length, y = (value: number) => top + ((pen.h - top - bottom) * (high - Math.log(value))) / (high - low);
    const places: number[] = [];
    values.forEach((value, i) => places.push(x(i + 1), value !== null && value > 0 ? y(value) : NaN));
    pen.path(places, pen.c.soft, 1.5);
    values.forEach((value, i) => {
      if (value === null || !(value > 0)) return;
      pen.circle(x(i + 1), y(value), 4, pen.c.green);
      pen.hit({x: x(i + 1), y: y(value), r: 9, tip: () => [`shot ${i + 1}`, `3σ ${num(value, 2)} mm`]});
    });
    for (const value of [Math.max(...known), Math.min(...known)]) pen.text(num(value, 2), 2, y(value), {size: 11.5, colour: pen.c.ink});
    pen.text('shot 1', x(1), pen.h - 10, {align: 'center', size: 11.5, colour: pen.c.soft});
    if (values.length > 1) pen.text(String(values.length), x(values.length), pen.h - 10, {align: 'center', size: 11.5, colour: pen.c.soft});
  }
  private drawMap(pen: Pen): void {
    const sigma = this.state?.sigma, state = this.state;
    pen.rect(0, 0, pen.w, pen.h, pen.c.panel);
    if (!sigma || !state) return pen.text('no camera yet', pen.w / 2, pen.h / 2, {align: 'center', colour: pen.c.soft});
    const s = Math.min(pen.w / state.width, pen.h / state.height), w = s * state.width, h = s * state.height, left = (pen.w - w) / 2, top = (pen.h - h) / 2;
    const dx = w / sigma.cols, dy = h / sigma.rows;
    sigma.three_sigma.forEach((value, i) => {
      if (value === null) return;
      pen.rect(left + (i % sigma.cols) * dx, top + Math.floor(i / sigma.cols) * dy, dx + 0.6, dy + 0.6, css(cividis(pixelShare(value))));
    });
    const [u, v] = state.worst_px, hasWorst = state.worst !== null && u !== undefined && v !== undefined;
    const ringX = Math.min(left + w - 7, Math.max(left + 7, left + s * (u ?? 0))), ringY = Math.min(top + h - 7, Math.max(top + 7, top + s * (v ?? 0)));
    if (hasWorst) pen.circle(ringX, ringY, 6, null, '#ffb43c', 2.5);
    const label = (col: number, row: number) => {
      const value = sigma.three_sigma[row * sigma.cols + col];
      if (value === null || value === undefined) return;
      const x = Math.min(left + w - 20, Math.max(left + 20, left + (col + 0.5) * dx)), y = Math.min(top + h - 9, Math.max(top + 9, top + (row + 0.5) * dy));
      if (hasWorst && Math.hypot(x - ringX, y - ringY) < 26) return; // its figure stands above
      pen.text(num(value, 2), x, y, {align: 'center', size: 11.5, colour: onto(cividis(pixelShare(value)))});
    };
    for (const col of [0, Math.floor(sigma.cols / 2), sigma.cols - 1]) for (const row of [0, Math.floor(sigma.rows / 2), sigma.rows - 1]) label(col, row);
  }

  private togglePause(): void {
    this.line.ask(this.state?.paused ? 'resume' : 'pause');
  }
  private mirror(): void {
    this.view.mirror(!this.view.isMirrored);
    this.buttons.mirror.setAttribute('aria-pressed', String(this.view.isMirrored));
    this.showState();
  }
  private listen(): void {
    const press = (one: HTMLButtonElement) => !one.disabled && one.click();
    const keys: Record<string, () => void> = {
      ' ': () => (this.isShots ? this.reading.focus() : press(this.buttons.take)), Enter: () => press(this.buttons.end), u: () => press(this.buttons.undo), p: () => press(this.buttons.pause),
      m: () => press(this.buttons.mirror), d: toggleTheme, '?': () => this.help(), Escape: () => document.querySelector<HTMLDialogElement>('dialog.help[open]')?.close(),
    };
    document.addEventListener('keydown', (event) => {
      const target = event.target as HTMLElement | null;
      if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
      if ((event.key === ' ' || event.key === 'Enter') && target?.matches('button, a, dialog')) return; // that one is pressed
      if (target === this.reading) {
        if (event.key === 'Enter') event.preventDefault(), press(this.buttons.take);
        if (event.key === 'Escape') this.reading.blur();
        return;
      }
      const act = keys[event.key];
      if (!act) return;
      event.preventDefault();
      act();
    }, {signal: this.stop.signal});
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', redrawAll, {signal: this.stop.signal});
  }

  /** The same page becomes the report, with the images that the report has. */
  private async end(hasReport: boolean): Promise<void> {
    this.isOver = true;
    this.finishCamera();
    let json = '';
    try {
      const text = await (await fetch(`${hasReport ? '/report.html' : '/result.json'}${location.search}`)).text();
      json = text;
      if (hasReport) {
        const report = new DOMParser().parseFromString(text, 'text/html');
        json = report.getElementById('result')?.textContent ?? '';
        document.body.append(...[...report.querySelectorAll('script[type="text/plain"][id^="image-"]')].map((block) => document.adoptNode(block)));
      }
    } catch {
      this.isOver = false;
      return this.lose('the run has ended, and is gone; its report is in its folder');
    }
    this.line.close();
    this.stop.abort();
    void this.sound?.close();
    charts.clear();
    this.host.replaceChildren();
    findImages();
    this.ended(readDocument(json));
    this.root.dataset['capture'] = 'ended';
  }
}

export function showCapture(doc: Doc, host: HTMLElement, ended: (result: Doc) => void): void {
  const page = new CapturePage(doc, host, ended);
  (window as unknown as Record<string, unknown>)['alidade'] = {doc, charts, page}; // for tests
}
