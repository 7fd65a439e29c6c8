/** How a chart of uPlot looks: axes, colours, texts of values. */

import { colourOf, fixed, nice } from "./text.js";

export const LEAST_HEIGHT = 70;
export const TIMES_HEIGHT = 26;
const FONT = "12px system-ui, sans-serif";
const LEAST_SPANS = { m: 0.2, "m/s": 0.1, "rad/s": 0.1, "°/s": 5, rad: 0.2, V: 0.5, degC: 2, s: 0.02, ms: 20 }; // noise stays small

export function valueText(value, unit, digits = Math.abs(value) >= 100 ? 1 : 3) {
  if (value === Infinity) return "nothing";
  if (value === -Infinity) return "too close";
  return `${fixed(value, digits)}${unit ? ` ${unit}` : ""}`;
}

/** Options of a chart of values with one unit.  `times` makes texts of the times below it; null leaves them out. */
export function chartOptions(unit, range, times, series) {
  const axis = { stroke: colourOf("ink-2"), grid: { stroke: colourOf("grid"), width: 1 }, ticks: { show: false }, font: FONT };
  const round = (_, splits, __, ___, step) => splits.map((value) => fixed(value, digitsOf(step)));
  return {
    width: 300,
    height: LEAST_HEIGHT,
    legend: { show: false },
    cursor: { y: false, drag: { x: false, y: false }, points: { size: 7 } },
    padding: [8, 14, times ? 0 : 6, 0],
    scales: { x: { time: false, range }, y: { range: (_, low, high) => around(low, high, LEAST_SPANS[unit] ?? 0) } },
    axes: [
      { ...axis, size: times ? TIMES_HEIGHT : 0, space: 56, values: times ?? (() => []) },
      { ...axis, size: 54, space: 26, label: unit, labelSize: 18, labelGap: 0, values: round, labelFont: FONT },
    ],
    series: [{}, ...series.map(({ name, colour, ...more }) => ({ label: nice(name), stroke: colourOf(colour), width: 1.8, points: { show: false }, ...more }))],
  };
}

/** Digits after the point of a multiple of a step. */
function digitsOf(step) {
  let digits = 0;
  while (digits < 6 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits += 1;
  return digits;
}

/** The range of an axis: all values, zero if it is close, and some room. */
function around(low, high, least) {
  if (low === null || low === undefined) return [-1, 1];
  if (high - low < least) [low, high] = [(low + high - least) / 2, (low + high + least) / 2];
  const [from, to] = [low > 0 && low < high * 0.5 ? 0 : low, high < 0 && high > low * 0.5 ? 0 : high];
  const room = Math.max((to - from) * 0.08, Math.abs(to) * 0.01, 0.01);
  return [from === 0 ? 0 : from - room, to === 0 ? 0 : to + room];
}
