/** Drives with the arrow keys or w a s d; Esc and Space stop. */

import { Directions } from "./directions.js";

const KEYS = {
  arrowup: "forward",
  arrowdown: "backward",
  arrowleft: "left",
  arrowright: "right",
  w: "forward",
  s: "backward",
  a: "left",
  d: "right",
  ",": "slide-left",
  ".": "slide-right",
};
const FIELDS = "input, select, textarea, [contenteditable]";
const CONTROLS = `${FIELDS}, button, a, summary`;

/** `helm` has `isMine` and `stop()`. */
export function keyboard(press, speeds, helm) {
  const directions = new Directions(press, speeds);
  const target = (event) => (event.target instanceof Element ? event.target : document.body);
  window.addEventListener("keydown", (event) => {
    if (event.key === "Escape" || (event.key === " " && !target(event).closest(CONTROLS))) {
      event.preventDefault();
      if (!event.repeat) helm.stop();
      return;
    }
    if (event.ctrlKey || event.altKey || event.metaKey) {
      directions.clear(); // the browser may keep the release of the other keys to itself
      return;
    }
    const direction = KEYS[event.key.toLowerCase()];
    if (!direction || event.isComposing || target(event).closest(FIELDS) || !helm.isMine) return;
    if (direction.startsWith("slide") && !speeds.sideways) return;
    event.preventDefault();
    if (!event.repeat) directions.down(event.code || event.key, direction);
  });
  window.addEventListener("keyup", (event) => directions.up(event.code || event.key));
  for (const type of ["blur", "pagehide"]) window.addEventListener(type, () => directions.clear());
  document.addEventListener("freeze", () => directions.clear());
  document.addEventListener("visibilitychange", () => document.hidden && directions.clear());
  document.addEventListener("focusin", (event) => target(event).closest(FIELDS) && directions.clear());
}
