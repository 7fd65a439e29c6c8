/** The instruments, the readings as in the terminal's view, and the map in words. */

import { degrees, element, fixed, make, markOf, nice, number, rangeText, sentence, setText } from "./text.js";
import { goalText } from "./goal.js";

let shape = ""; // the titles and names that the panels were built for
let rowNodes = [];
let panels = [];
const titled = (name) => (name === "imu" ? "IMU" : sentence(nice(name)));

function mark(node, value) {
  if (node.dataset.mark !== value) node.dataset.mark = value;
}

/** Shows the sections of a view message; `further` are sections of the page. */
export function readings(sections) {
  const now = JSON.stringify(sections.map(({ title, rows }) => [title, rows.map(([name]) => name)]));
  if (now !== shape) {
    shape = now;
    build(sections);
  }
  sections.forEach(({ style, rows }, i) => {
    mark(panels[i], markOf(style || ""));
    rows.forEach(([, value, rowStyle, bar], j) => {
      const row = rowNodes[i][j];
      setText(row.text, value);
      mark(row.value, markOf(rowStyle || ""));
      row.bar.hidden = !bar;
      if (!bar) return;
      const [share, barStyle] = bar;
      row.fill.style.width = `${Math.round(Math.max(0, Math.min(1, share)) * 100)}%`;
      mark(row.bar, markOf(barStyle || ""));
    });
  });
}

function build(sections) {
  rowNodes = [];
  panels = sections.map(({ title, rows }) => {
    const panel = make("section", "panel");
    const list = make("dl", "rows");
    panel.append(make("h2", "", titled(title)), list);
    rowNodes.push(
      rows.map(([name]) => {
        const row = make("div");
        const value = make("dd");
        const bar = make("span", "bar");
        const fill = make("i");
        const text = make("span");
        bar.setAttribute("aria-hidden", "true");
        bar.append(fill);
        value.append(bar, text);
        row.append(make("dt", "", titled(name)), value);
        list.append(row);
        return { value, bar, fill, text };
      }),
    );
    return panel;
  });
  element("readings").replaceChildren(...panels);
}

/**
 * Shows the speeds [m/s, rad/s, m/s] and the command of a view message; another program may drive without one.  `lateral` is NaN if
 * the robot cannot move sideways; otherwise the speed is that of both directions together.
 */
export function motion(linear, angular, lateral, { command, stopped, silent }) {
  const together = (forward, aside) => (Number.isNaN(aside) ? forward : Math.hypot(forward, aside));
  setText(element("tile-speed"), fixed(silent ? NaN : together(linear, lateral), 2));
  setText(element("tile-turn"), fixed(silent ? NaN : degrees(angular), 0));
  const asked = command && fixed(together(number(command[0]), number(command[2])), 2);
  setText(element("tile-speed-asked"), command ? `set ${asked}` : stopped ? "stopped" : "");
  setText(element("tile-turn-asked"), command ? `set ${fixed(degrees(number(command[1])), 0)}` : "");
}

/** Shows the nearest obstacle: [name, range], or null without sonars. */
export function nearest(found, style) {
  const [name, range] = found ?? ["", NaN];
  setText(element("tile-nearest"), Number.isFinite(range) ? fixed(range, 2) : found ? rangeText(range) : "–");
  element("tile-nearest").className = Number.isFinite(range) || !found ? "" : "words";
  element("tile-nearest-unit").hidden = !Number.isFinite(range);
  setText(element("tile-nearest-where"), Number.isFinite(range) || range === -Infinity ? nice(name) : "");
  mark(element("tile-nearest-box"), style);
}

export function battery(battery) {
  const volts = number(battery?.v);
  const share = number(battery?.share);
  const state = battery?.state ?? "";
  setText(element("tile-battery"), fixed(volts, 1));
  const percent = Number.isFinite(share) && Number.isFinite(volts) ? `${Math.round(share * 100)} %` : "";
  setText(element("tile-battery-state"), state === "ok" || !state ? percent : [state, percent].filter(Boolean).join(", "));
  mark(element("tile-battery-box"), state === "low" ? "caution" : ["empty", "off"].includes(state) ? "bad" : "");
}

/** Shows the map in words. */
export function map(pose, found, goal) {
  const where = pose ? `Robot x ${fixed(pose[0], 2)} m, y ${fixed(pose[1], 2)} m, heading ${fixed(degrees(pose[2]), 0)} deg.` : "The robot's pose is unknown.";
  const obstacle = found && found[1] !== Infinity ? `Nearest obstacle: ${rangeText(found[1])}, ${nice(found[0])}.` : found ? "No obstacle in range." : "";
  setText(element("map-text"), [where, obstacle, goal && pose ? goalText(goal, pose[0], pose[1]) : ""].filter(Boolean).join(" "));
}

/** The nearest range of `ranges`: [name, range]; null without a reading. */
export function nearestOf(ranges) {
  let found = null;
  for (const [name, value] of Object.entries(ranges ?? {})) {
    const range = number(value);
    if (!Number.isNaN(range) && (!found || range < found[1])) found = [name, range];
  }
  return found;
}
