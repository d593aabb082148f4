// Reads the document of result.json leniently: a page must come out of whatever a run could write.

type Json = unknown;
export type Cell = string | number | boolean | null;

export interface Check {
  name: string;
  state: string;
  text: string;
  figure: string;
  value: number;
  limit: number;
  unit: string;
}

/** Something taken as given, and what it would do to the answer if it were off by its σ, or by an ordinary error. */
export interface Assumed {
  name: string;
  value: number;
  sigma: number; // NaN: none is given; 0: exact
  ordinary: number; // where there is no σ: the error supposed
  moves: number; // in σ of what it moves most; NaN: `moved` says it in a sentence
  moved: string;
  movedBy: number; // in its unit
}

export interface Quantity {
  path: string;
  value: number; // NaN: not a number
  sigma: number;
  sigmaModel: number; // if every single measurement erred by itself; NaN where it is not told
  text: string;
}

const maxLeaves = 400; // more than that is a table, and stands in `data`

function isObject(value: Json): value is Record<string, Json> {
  return typeof value === 'object' && value !== null && !Array.isArray(value);
}
export function numberOf(value: Json): number {
  if (typeof value === 'boolean') return value ? 1 : 0;
  return typeof value === 'number' ? value : NaN;
}
function textOf(value: Json): string {
  if (value === null || value === undefined) return '';
  return typeof value === 'string' ? value : (JSON.stringify(value) ?? '');
}
function member(value: Json, name: string): Json {
  return isObject(value) && Object.prototype.hasOwnProperty.call(value, name) ? value[name] : null;
}
function list(value: Json): Json[] {
  return Array.isArray(value) ? value : [];
}

/** Columns of equal length. */
export class Table {
  readonly rows: number = 0;
  private readonly cells = new Map<string, Json[]>();
  private readonly numeric = new Map<string, Float64Array>();
  readonly thinned: {from: number; to: number; how: string} | null = null;

  constructor(readonly name: string, columns: Record<string, Json>) {
    for (const [column, values] of Object.entries(columns)) {
      if (!Array.isArray(values)) continue;
      this.cells.set(column, values);
      this.rows = Math.max(this.rows, values.length);
    }
    const thinned = columns['thinned'];
    if (isObject(thinned))
      this.thinned = {from: numberOf(thinned['from']), to: numberOf(thinned['to']), how: textOf(thinned['how'])};
  }
  get names(): string[] {
    return [...this.cells.keys()];
  }
  has(column: string): boolean {
    return this.cells.has(column);
  }
  /** NaN where missing; all NaN where there is no such column. */
  numbers(column: string): Float64Array {
    let values = this.numeric.get(column);
    if (!values) {
      values = new Float64Array(this.rows).fill(NaN);
      const cells = this.cells.get(column) ?? [];
      for (let i = 0; i < cells.length; ++i) values[i] = numberOf(cells[i]);
      this.numeric.set(column, values);
    }
    return values;
  }
  number(column: string, row: number): number {
    return this.numbers(column)[row] ?? NaN;
  }
  text(column: string, row: number): string {
    return textOf(this.cells.get(column)?.[row]);
  }
  cell(column: string, row: number): Cell {
    const value = this.cells.get(column)?.[row];
    if (value === undefined || value === null) return null;
    return typeof value === 'object' ? textOf(value) : (value as Cell);
  }
  /** Whether the column has a finite number. */
  hasValues(column: string): boolean {
    return this.has(column) && this.numbers(column).some(Number.isFinite);
  }
}

/** Values on a regular grid of pixels, row by row from (u0, v0). */
export class Grid {
  readonly cols: number;
  readonly rows: number;
  readonly u0: number;
  readonly v0: number;
  readonly du: number;
  readonly dv: number;

  constructor(readonly name: string, private readonly json: Record<string, Json>) {
    const whole = (key: string) => Math.min(1e4, Math.max(0, Math.floor(numberOf(json[key]) || 0)));
    this.cols = whole('cols');
    this.rows = whole('rows');
    this.u0 = numberOf(json['u0_px']) || 0;
    this.v0 = numberOf(json['v0_px']) || 0;
    this.du = numberOf(json['du_px']);
    this.dv = numberOf(json['dv_px']);
  }
  get isOfPixels(): boolean {
    return this.cols > 1 && this.rows > 1 && this.du > 0 && this.dv > 0;
  }
  /** Null if missing or of another length. */
  values(name: string): Float64Array | null {
    const cells = this.json[name];
    if (!Array.isArray(cells) || cells.length !== this.cols * this.rows) return null;
    const values = Float64Array.from(cells, numberOf);
    return values.some(Number.isFinite) ? values : null;
  }
}

export interface InputFile {
  role: string;
  name: string;
  bytes: number;
  sha256: string;
}
export interface Skipped {
  file: string;
  line: number;
  reason: string;
}

export class Doc {
  readonly isReadable: boolean;
  readonly command: string;
  readonly version: string;
  readonly createdUtc: string;
  readonly seed: string;
  readonly argv: string[];
  readonly state: string;
  readonly sentence: string;
  readonly toAdd: string;
  readonly exitCode: number; // NaN: not told
  readonly checks: Check[];
  readonly assumed: Assumed[];
  readonly counts: Record<string, number> = {};
  readonly skipped: Skipped[];
  readonly seconds: [string, number][];
  readonly inputs: InputFile[];
  readonly files: string[];
  readonly estimates: Quantity[] = [];
  readonly covarianceNames: string[];
  readonly covarianceUpper: number[];
  readonly tables = new Map<string, Table>();
  readonly grids = new Map<string, Grid>();
  private readonly byPath = new Map<string, Quantity>();

  constructor(readonly json: Json, readonly source: string) {
    this.isReadable = isObject(json);
    this.command = textOf(member(json, 'command'));
    this.version = textOf(member(json, 'version'));
    this.createdUtc = textOf(member(json, 'created_utc'));
    this.seed = textOf(member(json, 'seed'));
    this.argv = list(member(json, 'argv')).map(textOf);
    this.files = list(member(json, 'files')).map(textOf);
    const verdict = member(json, 'verdict');
    this.state = textOf(member(verdict, 'state'));
    this.sentence = this.isReadable ? textOf(member(verdict, 'sentence')) : 'The result document cannot be read.';
    this.toAdd = textOf(member(verdict, 'to_add'));
    this.exitCode = numberOf(member(verdict, 'exit_code'));
    this.checks = list(member(verdict, 'checks')).map(readCheck);
    this.assumed = list(member(json, 'assumed')).map(readAssumed);
    const counts = member(json, 'counts');
    if (isObject(counts))
      for (const [name, value] of Object.entries(counts)) if (typeof value === 'number') this.counts[name] = value;
    this.skipped = list(member(counts, 'skipped')).map((one) => ({
      file: textOf(member(one, 'file')), line: numberOf(member(one, 'line')), reason: textOf(member(one, 'reason'))}));
    const seconds = member(json, 'seconds');
    this.seconds = isObject(seconds) ? Object.entries(seconds).map(([k, v]) => [k, numberOf(v)]) : [];
    this.inputs = list(member(json, 'inputs')).map((one) => ({
      role: textOf(member(one, 'role')), name: textOf(member(one, 'name')),
      bytes: numberOf(member(one, 'bytes')), sha256: textOf(member(one, 'sha256'))}));
    this.flatten('', member(json, 'estimate'), member(json, 'stddev'), member(json, 'stddev_model'));
    const covariance = member(json, 'covariance');
    this.covarianceNames = list(member(covariance, 'names')).map(textOf);
    this.covarianceUpper = list(member(covariance, 'upper')).map(numberOf);
    this.readData(json);
  }

  private readData(json: Json): void {
    const data = member(json, 'data'), grids = member(json, 'grids');
    if (isObject(data))
      for (const [name, columns] of Object.entries(data))
        if (isObject(columns)) this.tables.set(name, new Table(name, columns));
    if (isObject(grids))
      for (const [name, grid] of Object.entries(grids)) if (isObject(grid)) this.grids.set(name, new Grid(name, grid));
  }

  // `sigmas` and `models` walk along with `value`: σ has the same path.
  private flatten(path: string, value: Json, sigmas: Json, models: Json): void {
    if (this.estimates.length >= maxLeaves) return;
    if (isObject(value)) {
      for (const [name, child] of Object.entries(value))
        this.flatten(path === '' ? name : `${path}.${name}`, child, member(sigmas, name), member(models, name));
    } else if (Array.isArray(value)) {
      value.forEach((child, i) => this.flatten(`${path}[${i}]`, child, list(sigmas)[i] ?? null, list(models)[i] ?? null));
    } else if (path !== '') {
      const quantity = {path, value: typeof value === 'boolean' ? NaN : numberOf(value), sigma: numberOf(sigmas), sigmaModel: numberOf(models),
        text: typeof value === 'number' ? '' : textOf(value)};
      this.estimates.push(quantity);
      this.byPath.set(path, quantity);
    }
  }

  /** Null if missing or without rows. */
  table(name: string): Table | null {
    const table = this.tables.get(name);
    return table && table.rows > 0 ? table : null;
  }
  grid(name: string): Grid | null {
    return this.grids.get(name) ?? null;
  }
  pixelGrid(name: string): Grid | null {
    const grid = this.grid(name);
    return grid?.isOfPixels ? grid : null;
  }
  /** NaN if missing. */
  estimate(path: string): number {
    return this.byPath.get(path)?.value ?? NaN;
  }
  sigma(path: string): number {
    return this.byPath.get(path)?.sigma ?? NaN;
  }
  /** σ over what it would be if every single measurement erred by itself; NaN where the document does not tell. */
  inflation(path: string): number {
    const one = this.byPath.get(path);
    return one && one.sigma > 0 && one.sigmaModel > 0 ? one.sigma / one.sigmaModel : NaN;
  }
  estimateText(path: string): string {
    return this.byPath.get(path)?.text ?? '';
  }
  get isAnswer(): boolean {
    return this.state === 'good' || this.state === 'care' || this.state === 'bad';
  }
  /** Size of the image in pixels; null if the document does not tell. */
  get imageSize(): {width: number; height: number} | null {
    const width = this.estimate('camera.width'), height = this.estimate('camera.height');
    return width >= 1 && height >= 1 && width < 1e5 && height < 1e5 ? {width, height} : null;
  }
}

function readCheck(check: Json): Check {
  return {
    name: textOf(member(check, 'name')), state: textOf(member(check, 'state')), text: textOf(member(check, 'text')),
    figure: textOf(member(check, 'figure')), value: numberOf(member(check, 'value')),
    limit: numberOf(member(check, 'limit')), unit: textOf(member(check, 'unit'))};
}

function readAssumed(one: Json): Assumed {
  return {name: textOf(member(one, 'name')), value: numberOf(member(one, 'value')), sigma: numberOf(member(one, 'sigma')), ordinary: numberOf(member(one, 'ordinary')),
    moves: numberOf(member(one, 'moves')), moved: textOf(member(one, 'moved')), movedBy: numberOf(member(one, 'moved_by'))};
}

export function readDocument(text: string): Doc {
  let json: Json = null;
  try {
    json = JSON.parse(text);
  } catch {
    json = null; // the page says so
  }
  return new Doc(json, text);
}
