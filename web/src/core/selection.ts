// What is chosen, on all figures at once: an item (photo, shot, view) and an instant.

export type Listener = () => void;

export class Selection {
  private chosen = -1;
  private instant = NaN;
  private order: number[] = [];
  private readonly listeners: Listener[] = [];

  /** Row of the command's main table; −1 of none. */
  get item(): number {
    return this.chosen;
  }
  get items(): readonly number[] {
    return this.order;
  }
  /** NaN: none chosen. */
  get time(): number {
    return this.instant;
  }
  /** The items in the order of the keys, worst first; the first is chosen. */
  offer(order: number[]): void {
    this.order = order;
    if (this.chosen < 0 && order.length > 0) this.chosen = order[0]!;
  }
  choose(item: number): void {
    if (item === this.chosen) return;
    this.chosen = item;
    this.notify();
  }
  step(by: number): void {
    if (this.order.length === 0) return;
    const at = this.order.indexOf(this.chosen);
    this.choose(this.order[(at + by + this.order.length) % this.order.length]!);
  }
  at(time: number): void {
    if (time === this.instant) return;
    this.instant = time;
    this.notify();
  }
  on(listener: Listener): void {
    this.listeners.push(listener);
  }
  private notify(): void {
    for (const listener of this.listeners) listener();
  }
}
