/** What drives while it is held: a joystick for finger, pen or mouse, buttons, and keys. */

import { element } from "./text.js";

const DEAD_ZONE = 0.1;
const WAYS = {
  forward: [1, 0, 0],
  backward: [-1, 0, 0],
  left: [0, 1, 0],
  right: [0, -1, 0],
  "slide-left": [0, 0, 1],
  "slide-right": [0, 0, -1],
};
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

/**
 * Follows the pointer that is pressed on a node: `down(event)`, then `move(event)`, and `up()` once it is released, also if the release
 * is never seen.  While `busy()` no pointer counts.  Returns a function that releases the pointer.
 */
function holdPointer(node, { down, move = () => {}, up, busy = () => false }) {
  let pointer = null;
  const release = () => {
    if (pointer === null) return;
    pointer = null;
    up();
  };
  node.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || pointer !== null || busy()) return;
    pointer = event.pointerId;
    node.setPointerCapture(pointer);
    down(event);
  });
  node.addEventListener("pointermove", (event) => {
    if (event.pointerId !== pointer) return;
    if (event.buttons === 0) release(); // the pointer went up where the page could not see it
    else move(event);
  });
  const ended = (event) => event.pointerId === pointer && release();
  for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) node.addEventListener(type, ended);
  node.addEventListener("contextmenu", (event) => event.preventDefault());
  return release;
}

/** Calls `down()` when the button is pressed and `up()` when it is released. */
export function holdButton(button, down, up) {
  let key = "";
  const press = () => {
    button.classList.add("pressed");
    down();
  };
  const lift = () => {
    key = "";
    button.classList.remove("pressed");
    up();
  };
  const pressed = () => button.classList.contains("pressed");
  const releasePointer = holdPointer(button, { down: press, up: lift, busy: () => pressed() || button.disabled });
  const release = () => (key ? lift() : releasePointer());
  button.addEventListener("keydown", (event) => {
    if (event.key !== " " && event.key !== "Enter") return;
    event.preventDefault();
    if (event.repeat || pressed() || button.disabled) return;
    key = event.key;
    press();
  });
  button.addEventListener("keyup", (event) => event.key === key && release());
  button.addEventListener("blur", () => key && release());
  window.addEventListener("blur", release);
  document.addEventListener("visibilitychange", () => document.hidden && release());
}

export class Joystick {
  /** To the side the joystick turns the robot, or moves it sideways. */
  slides = false;
  #speeds;
  #box = element("joystick");
  #knob = element("knob");
  #x = 0;
  #y = 0;

  constructor(press, speeds) {
    this.#speeds = speeds;
    holdPointer(this.#box, {
      down: (event) => {
        event.preventDefault();
        this.#deflect(event);
        press.begin(this);
      },
      move: (event) => this.#deflect(event),
      up: () => {
        this.#show(0, 0);
        press.end(this);
      },
    });
  }

  command() {
    return this.slides ? this.#speeds.command(this.#y, 0, -this.#x) : this.#speeds.command(this.#y, -this.#x);
  }

  #deflect(event) {
    const box = this.#box.getBoundingClientRect();
    const radius = box.width / 2 - this.#knob.offsetWidth / 2;
    const x = (event.clientX - box.left - box.width / 2) / radius;
    const y = (box.top + box.height / 2 - event.clientY) / radius;
    const length = Math.hypot(x, y);
    const scale = length < DEAD_ZONE ? 0 : Math.min(1, (length - DEAD_ZONE) / (1 - DEAD_ZONE)) / length;
    this.#show(x * scale, y * scale);
  }

  #show(x, y) {
    this.#x = x;
    this.#y = y;
    const reach = this.#box.clientWidth / 2 - this.#knob.offsetWidth / 2;
    this.#knob.style.transform = `translate(${x * reach}px, ${-y * reach}px)`;
  }
}

/** A control made of directions that may be held together: the keys, or the buttons with arrows. */
class Directions {
  #press;
  #speeds;
  #held = new Map();

  constructor(press, speeds) {
    this.#press = press;
    this.#speeds = speeds;
  }

  /** A key or button is down; `id` names it.  The first one begins the press, further ones change its direction. */
  down(id, direction) {
    if (this.#held.has(id)) return;
    this.#held.set(id, direction);
    if (this.#held.size === 1) this.#press.begin(this);
  }

  /** A key or button is up; the last one ends the press. */
  up(id) {
    if (this.#held.delete(id) && this.#held.size === 0) this.#press.end(this);
  }

  /** Forgets all that is held. */
  clear() {
    this.#held.clear();
    this.#press.end(this);
  }

  command() {
    const sum = [0, 0, 0];
    for (const direction of this.#held.values()) WAYS[direction].forEach((part, i) => (sum[i] += part));
    return this.#speeds.command(...sum);
  }
}

/** The buttons with arrows: each drives while it is held. */
export function pad(press, speeds) {
  const directions = new Directions(press, speeds);
  for (const button of document.querySelectorAll("[data-direction]")) {
    const { direction } = button.dataset;
    holdButton(
      button,
      () => directions.down(direction, direction),
      () => directions.up(direction),
    );
  }
}

/** Arrow keys or w a s d drive; Esc and Space stop.  `helm` has `isMine` and `stop()`. */
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
