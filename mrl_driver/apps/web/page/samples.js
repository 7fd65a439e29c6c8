/** The values of the last minute, by name. */

export const SPAN_MS = 60000;
const SLACK = 600;

export class Samples {
  /** Names and units: [[name, unit], ...]. */
  series = [];
  /** Times of the server [ms], oldest first. */
  times = [];
  #columns = [];
  #index = new Map();

  /** Sets the series.  The same series as before keep their values; a gap marks the time without a link. */
  begin(series) {
    const same = JSON.stringify(series) === JSON.stringify(this.series);
    this.series = series;
    this.#index = new Map(series.map(([name], i) => [name, i]));
    if (same && this.times.length) this.#append(this.times.at(-1) + 1, series.map(() => NaN));
    else this.clear();
  }

  /** Adds the numbers of a sample, in the order of the series. */
  add(at, values) {
    const last = this.times.at(-1);
    if (at < last) this.clear(); // another server, with another clock
    if (at === last) return;
    this.#append(at, values);
    let old = 0;
    while (this.times[old] < at - SPAN_MS) old += 1;
    if (old <= SLACK) return;
    this.times.splice(0, old);
    for (const column of this.#columns) column.splice(0, old);
  }

  clear() {
    this.times = [];
    this.#columns = this.series.map(() => []);
  }

  has(name) {
    return this.#index.has(name);
  }

  unit(name) {
    return this.series[this.#index.get(name)]?.[1] ?? "";
  }

  /** The values of a series, as old as `times`. */
  column(name) {
    return this.#columns[this.#index.get(name)] ?? [];
  }

  /** The newest value of a series; NaN if there is none. */
  newest(name) {
    return this.column(name).at(-1) ?? NaN;
  }

  #append(at, values) {
    this.times.push(at);
    this.#columns.forEach((column, i) => column.push(values[i]));
  }
}
