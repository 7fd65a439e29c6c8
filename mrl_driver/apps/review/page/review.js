/** The review of a drive: one moment, shown on the map and in all charts. */

import { chartOptions, valueText } from "./chart_options.js";
import { FloorMap } from "./map.js";
import { colourOf, degrees, element, fixed, make, nice, number, setText } from "./text.js";

const CURVES = ["c1", "c2", "c3", "c4", "c5", "c6"];
const CLOSE_S = 20; // shown around a moment that somebody chose
const SHORTEST_S = 0.5;
const HEIGHT = 130;
const PAPER_PX = 680;

/** Values of whole numbers of steps, see `in_steps` in charts.py. */
const unpack = (steps, step) => steps.map((each) => number(each) * step);

const data = JSON.parse(element("data").textContent);
const duration = Math.max(data.duration, 0.001);
const times = unpack(data.times, 0.001);
const poses = data.poses.map((column) => unpack(column, 0.001));
const charts = data.charts.map(({ title, unit, curves }) => ({
  title,
  unit,
  curves: curves.map(({ name, stepped, step, values }, i) => ({
    name,
    stepped,
    colour: CURVES[i % CURVES.length],
    digits: Math.max(0, Math.round(-Math.log10(step))),
    values: unpack(values, step),
  })),
}));
const places = [...document.querySelectorAll("[data-time]")].map((node) => ({
  node,
  time: Number(node.dataset.time),
  text: node.dataset.text,
  mark: node.dataset.mark,
}));
const paper = matchMedia("print");
let shown = [0, duration];
let plots = [];

/** The index of the last time that is not after one. */
function indexAt(time) {
  let [low, high] = [0, times.length - 1];
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle - 1;
  }
  return low;
}

const poseAt = (time) => poses.map((column) => column[indexAt(time)]);
const colourFor = (mark) => (mark === "bad" || mark === "caution" ? mark : "ink-2");

// Map --------------------------------------------------------------------------------------------------------------------

const known = times.map((_, i) => i).filter((i) => Number.isFinite(poses[0][i]));
let moment = places.find(({ text }) => text)?.time ?? times[known[0] ?? 0]; // the first finding
let map = null;
if (known.length) {
  element("map-panel").hidden = false;
  map = new FloorMap(true);
  map.robot = data.robot;
  map.setPath(known.map((i) => [poses[0][i], poses[1][i]]));
  map.spots = places
    .map(({ time, text, mark }) => ({ x: poseAt(time)[0], y: poseAt(time)[1], text, colour: colourFor(mark) }))
    .filter(({ x }) => Number.isFinite(x))
    .reverse(); // the most important one is drawn last
  map.clicked = (x, y) => {
    const away = (i) => Math.hypot(poses[0][i] - x, poses[1][i] - y);
    go(times[known.reduce((best, i) => (away(i) < away(best) ? i : best))]);
  };
}

function showPlace() {
  if (!map) return;
  const pose = poseAt(moment);
  const ranges = charts.find(({ title }) => title === "Ranges")?.curves ?? [];
  map.ranges = Object.fromEntries(ranges.map(({ name, values }) => [name, values[indexAt(moment)]]));
  map.place(...pose);
  map.touch();
  const [x, y, yaw] = pose;
  setText(element("map-text"), `At ${fixed(moment, 2)} s: x ${fixed(x, 2)} m, y ${fixed(y, 2)} m, heading ${fixed(degrees(yaw), 0)}°. Click the path to go there.`);
}

// Charts -----------------------------------------------------------------------------------------------------------------

function build() {
  for (const { plot } of plots) plot.destroy();
  const box = element("charts");
  box.replaceChildren();
  plots = charts.map(({ title, unit, curves }) => {
    const part = make("section", "curves");
    const head = make("ul", "chart-values");
    const name = make("li");
    name.append(make("h3", "", title));
    const values = curves.map((curve) => {
      const chip = make("li", `chip ${curve.colour}`);
      const value = make("b");
      chip.append(make("i", "swatch"), make("span", "", nice(curve.name)), value);
      head.append(chip);
      return value;
    });
    head.prepend(name);
    const chart = make("div", "chart");
    chart.setAttribute("role", "img");
    chart.setAttribute("aria-label", `Chart of ${title}: ${curves.map((curve) => nice(curve.name)).join(", ")}`);
    part.append(head, chart);
    box.append(part);
    const numbers = curves.map((curve) => curve.values.map((value) => (Number.isFinite(value) ? value : null)));
    const plot = new uPlot(options(unit, curves), [times, ...numbers], chart);
    plot.over.addEventListener("pointermove", (event) => point(plot, event));
    plot.over.addEventListener("pointerdown", (event) => point(plot, event));
    plot.over.addEventListener("mouseleave", () => show());
    return { plot, curves, values, unit };
  });
  fit();
}

function options(unit, curves) {
  const seconds = (_, splits, __, ___, step) => splits.map((time) => `${fixed(time, step < 1 ? (step < 0.1 ? 2 : 1) : 0)} s`);
  const stepped = uPlot.paths.stepped({ align: 1 });
  const series = curves.map(({ name, colour, stepped: steps }) => ({ name, colour, ...(steps ? { paths: stepped, width: 1.4 } : {}) }));
  const made = chartOptions(unit, () => shown, seconds, series);
  made.height = HEIGHT;
  made.cursor.drag = { x: true, y: false, setScale: false };
  made.hooks = { drawClear: [drawPlaces], setSelect: [onSelect] };
  return made;
}

/** Lines at the findings and stops, below the curves. */
function drawPlaces(plot) {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.lineWidth = Math.max(1, devicePixelRatio);
  for (const { time, mark } of places) {
    const x = Math.round(plot.valToPos(time, "x", true));
    if (!(x >= bbox.left && x <= bbox.left + bbox.width)) continue;
    ctx.strokeStyle = colourOf(colourFor(mark));
    ctx.globalAlpha = 0.55;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
  }
  ctx.restore();
}

/** The moment follows mouse and finger. */
function point(plot, event) {
  const left = event.clientX - plot.over.getBoundingClientRect().left;
  moment = Math.min(duration, Math.max(0, plot.posToVal(left, "x")));
  show(plot);
}

function onSelect(plot) {
  const { left, width } = plot.select;
  if (width < 4) return;
  view(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
  plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
}

function fit() {
  const width = paper.matches ? PAPER_PX : element("charts").clientWidth;
  if (width > 0) for (const { plot } of plots) plot.setSize({ width, height: HEIGHT });
  queueMicrotask(() => show()); // plots take their size in a microtask
}

// Moment and time --------------------------------------------------------------------------------------------------------

/** Shows a part of the drive in the charts. */
function view(from, to) {
  const span = Math.min(duration, Math.max(SHORTEST_S, to - from));
  const middle = (from + to) / 2;
  const start = Math.min(Math.max(0, middle - span / 2), duration - span);
  shown = [start, start + span];
  for (const { plot } of plots) plot.setScale("x", { min: shown[0], max: shown[1] });
  show();
}

/** Shows the moment: values, cursors, robot.  `from` is the chart that already has its cursor there. */
function show(from = null) {
  const at = indexAt(moment);
  for (const { plot, curves, values, unit } of plots) {
    const part = (moment - shown[0]) / (shown[1] - shown[0]); // the plot's own scale is a little behind
    const inside = part >= 0 && part <= 1;
    if (plot !== from) plot.setCursor({ left: inside ? part * plot.over.clientWidth : -10, top: inside ? 0 : -10 }, false);
    curves.forEach((curve, i) => setText(values[i], valueText(curve.values[at], unit, curve.digits)));
  }
  element("moment").value = moment;
  element("moment").setAttribute("aria-valuetext", `${fixed(moment, 2)} seconds`);
  setText(element("moment-text"), `${fixed(moment, 2)} s`);
  document.documentElement.dataset.moment = moment;
  showPlace();
  showStrip();
}

function showStrip() {
  const first = plots[0]?.plot;
  if (!first) return;
  const ratio = devicePixelRatio || 1;
  const [left, width] = [first.bbox.left / ratio, first.bbox.width / ratio];
  for (const { time, flag } of places) {
    const part = (time - shown[0]) / (shown[1] - shown[0]);
    flag.hidden = !(part >= 0 && part <= 1);
    flag.style.left = `${left + part * width}px`;
  }
}

/** Goes to a moment that somebody chose: the charts show it closely. */
function go(time) {
  moment = Math.min(duration, Math.max(0, time));
  const span = Math.min(shown[1] - shown[0], CLOSE_S);
  view(moment - span / 2, moment + span / 2);
  for (const { node, time: of } of places) node.querySelector(".goto")?.setAttribute("aria-current", String(of === time));
}

if (charts.length) {
  element("chart-panel").hidden = false;
  element("moment").max = duration;
  element("moment").addEventListener("input", (event) => {
    moment = Number(event.target.value);
    const span = shown[1] - shown[0];
    if (moment < shown[0] || moment > shown[1]) view(moment - span / 2, moment + span / 2);
    else show();
  });
  const scaled = (factor) => {
    const half = ((shown[1] - shown[0]) * factor) / 2;
    view(moment - half, moment + half);
  };
  element("narrower").addEventListener("click", () => scaled(0.5));
  element("wider").addEventListener("click", () => scaled(2));
  element("whole").addEventListener("click", () => view(0, duration));
}
for (const place of [...places].reverse()) {
  const flag = make("button", "", place.text);
  flag.type = "button";
  flag.tabIndex = -1; // the lists have the same
  flag.dataset.mark = place.mark;
  flag.title = place.node.querySelector("h3")?.textContent ?? "";
  flag.addEventListener("click", () => go(place.time));
  place.flag = flag;
  element("strip").append(flag);
  place.node.querySelector(".goto")?.addEventListener("click", () => {
    go(place.time);
    const box = (map ? element("map-panel") : element("chart-panel")).getBoundingClientRect();
    if (box.top < 0 || box.top > innerHeight / 2) element(map ? "map-panel" : "chart-panel").scrollIntoView({ block: "start" });
  });
}
let width = 0;
new ResizeObserver(() => {
  if (element("charts").clientWidth === width) return;
  width = element("charts").clientWidth;
  fit();
}).observe(element("charts"));
for (const media of [paper, matchMedia("(prefers-color-scheme: dark)")]) {
  media.addEventListener("change", () => {
    build();
    map?.resize();
  });
}
function frame() {
  map?.draw();
  requestAnimationFrame(frame);
}
build();
frame();
document.documentElement.dataset.ready = "yes";
