// Rows of a live run as they come, of each head by itself, as columns.

const maxRows = 36_000; // of a head: ten minutes at 60 a second

export class Rows {
  readonly t: number[] = [];
  private readonly columns = new Map<string, number[]>();

  push(t: number, row: Record<string, unknown>): void {
    this.t.push(t);
    for (const [name, value] of Object.entries(row)) {
      if (typeof value === 'string') continue;
      let column = this.columns.get(name);
      if (!column) this.columns.set(name, (column = new Array<number>(this.t.length - 1).fill(NaN)));
      column.push(typeof value === 'number' ? value : typeof value === 'boolean' ? Number(value) : NaN);
    }
    for (const column of this.columns.values()) if (column.length < this.t.length) column.push(NaN);
    if (this.t.length <= maxRows) return;
    for (const column of [this.t, ...this.columns.values()]) column.splice(0, maxRows / 4);
  }
  get count(): number {
    return this.t.length;
  }
  has(name: string): boolean {
    return this.columns.has(name);
  }
  last(name: string): number {
    return this.columns.get(name)?.[this.t.length - 1] ?? NaN;
  }
  /** The newest finite one. */
  newest(name: string): number {
    const column = this.columns.get(name) ?? [];
    for (let i = column.length; i-- > 0;) if (Number.isFinite(column[i]!)) return column[i]!;
    return NaN;
  }
  /** First row at or after a time. */
  from(time: number): number {
    let low = 0, high = this.t.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.t[middle]! < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }
  /** Each `every`-th value from a row on; NaN where there is no such column. */
  slice(name: string, first: number, every: number): Float64Array {
    const column = name === '' ? this.t : this.columns.get(name), count = Math.max(0, Math.ceil((this.t.length - first) / every));
    const values = new Float64Array(count).fill(NaN);
    if (column) for (let i = 0; i < count; ++i) values[i] = column[first + i * every]!;
    return values;
  }
}

/** All heads of a run; one without heads is head 0. */
export class HeadRows {
  readonly heads = new Map<number, Rows>();
  all = new Rows();
  trial = '';
  received = 0;
  private newest = -Infinity;

  /** True where a new trial begins: the time runs anew. */
  push(row: Record<string, unknown>): boolean {
    const t = Number(row['t_s']), head = typeof row['head'] === 'number' ? row['head'] : 0, trial = String(row['controller'] ?? '');
    if (!Number.isFinite(t)) return false;
    const isNew = trial !== this.trial || t < this.newest - 1;
    if (isNew) this.heads.clear(), (this.all = new Rows()), (this.newest = -Infinity);
    this.trial = trial;
    this.newest = Math.max(this.newest, t);
    ++this.received;
    let rows = this.heads.get(head);
    if (!rows) this.heads.set(head, (rows = new Rows()));
    for (const one of [rows, this.all]) one.push(one.count > 0 ? Math.max(t, one.t[one.count - 1]!) : t, row);
    return isNew;
  }
  get time(): number {
    return this.newest;
  }
  get first(): number {
    return this.all.t[0] ?? NaN;
  }
}
