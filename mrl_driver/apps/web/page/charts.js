/** The values of the last minute, and charts of those that the user has chosen by name: one for each unit. */

import { LEAST_HEIGHT, TIMES_HEIGHT, chartOptions, valueText } from "./chart_options.js";
import { element, make, nice, remember, remembered, setText } from "./text.js";

const SPAN_MS = 60000;
const SLACK = 600;
const PERIOD_MS = 200;
const MOST = 6;
const COLOURS = ["c1", "c2", "c3", "c4", "c5", "c6"];

const ago = (_, splits) => splits.map((second) => (Math.round(second) === 0 ? "now" : `${Math.round(second)} s`.replace("-", "−")));

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

/** Charts of some samples; `defaults` are the names shown until the user chooses others. */
export function charts(samples, defaults) {
  const box = element("charts");
  const choice = element("series");
  const chips = new Map(); // where the value of each name is written
  let chosen = remembered("series", null);
  let plots = [];
  let paused = false;
  let drawnAt = 0;
  let inSight = true;

  function namesShown() {
    const wanted = (chosen ?? defaults).filter((name) => samples.has(name));
    return wanted.length || chosen ? wanted : samples.series.slice(0, 2).map(([name]) => name);
  }

  function choose(names) {
    chosen = [...new Set(names)].slice(-MOST);
    remember("series", chosen);
    build();
  }

  /** Makes the charts of the chosen values. */
  function build() {
    for (const { plot } of plots) plot.destroy();
    box.replaceChildren();
    chips.clear();
    const names = namesShown();
    element("chart-values").replaceChildren(...names.map((name, i) => chipOf(name, COLOURS[i])));
    const units = [...new Set(names.map((name) => samples.unit(name)))];
    document.documentElement.dataset.charts = units.length;
    plots = units.map((unit, i) => {
      const shown = names.filter((name) => samples.unit(name) === unit);
      const chart = make("div", "chart");
      chart.setAttribute("role", "img");
      chart.setAttribute("aria-label", `Chart of ${shown.map(nice).join(", ")} over the last 60 seconds`);
      box.append(chart);
      const last = i === units.length - 1;
      const series = shown.map((name) => ({ name, colour: COLOURS[names.indexOf(name)] }));
      const options = chartOptions(unit, () => [-SPAN_MS / 1000, 0], last ? ago : null, series); // the last one has the times
      return { plot: new uPlot(options, dataOf(shown), chart), shown, further: last ? TIMES_HEIGHT : 0 };
    });
    resize();
    const others = samples.series.filter(([name]) => !names.includes(name));
    const options = others.map(([name, unit]) => new Option(unit ? `${nice(name)} [${unit}]` : nice(name), name));
    choice.replaceChildren(new Option("Add a value", ""), ...options);
    choice.disabled = options.length === 0;
  }

  function chipOf(name, colour) {
    const chip = make("li", `chip ${colour}`);
    const value = make("b");
    const button = make("button", "remove", "×");
    button.type = "button";
    button.setAttribute("aria-label", `Remove ${nice(name)} from the charts`);
    button.addEventListener("click", () => choose(namesShown().filter((each) => each !== name)));
    chip.append(make("i", "swatch"), make("span", "", nice(name)), value, button);
    chips.set(name, value);
    return chip;
  }

  /** Times in seconds before the newest sample, and a column for each name; null where there is no finite value. */
  function dataOf(shown) {
    const { times } = samples;
    const last = times.at(-1) ?? 0;
    const first = Math.max(0, times.findIndex((time) => time >= last - SPAN_MS));
    const finite = (value) => (Number.isFinite(value) ? value : null);
    return [times.slice(first).map((time) => (time - last) / 1000), ...shown.map((name) => samples.column(name).slice(first).map(finite))];
  }

  function resize() {
    const each = Math.max(LEAST_HEIGHT, Math.floor((box.clientHeight - TIMES_HEIGHT) / plots.length) - 2);
    for (const { plot, further } of plots) {
      const width = plot.root.parentElement.clientWidth;
      const height = each + further;
      if (width > 0 && (plot.width !== width || plot.height !== height)) plot.setSize({ width, height });
    }
  }

  /** Draws the charts at most five times a second. */
  function draw(now) {
    if (now - drawnAt < PERIOD_MS || !inSight) return;
    drawnAt = now;
    for (const { plot, shown } of plots) {
      if (!paused) plot.setData(dataOf(shown));
      shown.forEach((name, i) => {
        const at = plot.cursor.left >= 0 ? plot.cursor.idx : null;
        const value = at !== null && at !== undefined ? plot.data[i + 1][at] ?? NaN : samples.newest(name);
        setText(chips.get(name), valueText(value, samples.unit(name)));
      });
    }
  }

  choice.addEventListener("change", () => {
    if (choice.value) choose([...namesShown(), choice.value]);
    choice.value = "";
  });
  element("chart-pause").addEventListener("click", () => {
    paused = !paused;
    setText(element("chart-pause"), paused ? "Go on" : "Pause");
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", build);
  new IntersectionObserver((entries) => (inSight = entries.at(-1).isIntersecting)).observe(element("chart-panel"));
  new ResizeObserver(resize).observe(box);
  return { build, draw };
}
