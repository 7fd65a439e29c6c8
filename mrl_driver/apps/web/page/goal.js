/** A goal from the map or from fields, and the button that drives there while it is held. */

import { holdButton } from "./held_controls.js";
import { degrees, element, setText } from "./text.js";

const FARTHEST_M = 1000;

/** The number in a field: NaN if it is empty, null if it is not a number. */
function read(field) {
  const text = field.value.trim().replace(",", ".").replace("−", "-");
  if (!text) return NaN;
  const value = Number(text);
  return Number.isFinite(value) ? value : null;
}

export class Goal {
  /** Called with the goal after each change: [x, y] or [x, y, yaw] in m and rad, or null. */
  changed = () => {};
  value = null;
  #press;
  #fields = ["goal-x", "goal-y", "goal-yaw"].map(element);

  constructor(press) {
    this.#press = press;
    for (const field of this.#fields) field.addEventListener("input", () => this.#change());
    element("goal-clear").addEventListener("click", () => {
      for (const field of this.#fields) field.value = "";
      this.#change();
    });
    holdButton(
      element("go"),
      () => press.begin(this),
      () => {
        press.end(this);
        this.#read();
      },
    );
  }

  /** Sets x and y, as the map does; the heading stays. */
  place(x_m, y_m) {
    if (this.#press.source === this) return;
    this.#fields[0].value = x_m.toFixed(2);
    this.#fields[1].value = y_m.toFixed(2);
    this.#read();
  }

  command() {
    return this.value && { goal: this.value };
  }

  #change() {
    if (this.#press.source === this) this.#press.spend("the goal was changed");
    this.#read();
  }

  #read() {
    const [x, y, yaw] = this.#fields.map(read);
    const wrong = [x, y, yaw].map((value, i) => value === null || (i < 2 && Math.abs(value) > FARTHEST_M));
    this.#fields.forEach((field, i) => field.setAttribute("aria-invalid", String(wrong[i])));
    const known = !wrong.includes(true) && !Number.isNaN(x) && !Number.isNaN(y);
    this.value = known ? [x, y, ...(Number.isNaN(yaw) ? [] : [wrapped(yaw)])] : null;
    element("go").disabled = !known && this.#press.source !== this; // a disabled button would miss its release
    element("goal-clear").disabled = this.#fields.every((field) => !field.value);
    const help = wrong.includes(true) ? `Enter numbers: x and y within ${FARTHEST_M} m, the heading in degrees.` : "Click the map, or enter x and y.";
    setText(element("goal-help"), known ? "The robot drives there while the button is held." : help);
    this.changed(this.value);
  }
}

/** An angle in degrees as radians from -pi to pi. */
function wrapped(angle_deg) {
  const turns = angle_deg - 360 * Math.round(angle_deg / 360);
  return (turns * Math.PI) / 180;
}

/** The goal in words, seen from a pose. */
export function goalText(goal, x_m, y_m) {
  if (!goal) return "No goal.";
  const heading = goal.length > 2 ? `, heading ${degrees(goal[2]).toFixed(0)} deg` : "";
  return `Goal x ${goal[0].toFixed(2)} m, y ${goal[1].toFixed(2)} m${heading}, ${Math.hypot(goal[0] - x_m, goal[1] - y_m).toFixed(1)} m away.`;
}
