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

/** A joystick; if it `slides`, its way to the side moves the robot sideways instead of turning it. */
export function joystick(press, speeds) {
  const [box, knob] = [element("joystick"), element("knob")];
  let [x, y] = [0, 0];
  const source = {
    slides: false,
    command: () => (source.slides ? speeds.command(y, 0, -x) : speeds.command(y, -x)),
  };

  function show(right, up) {
    [x, y] = [right, up];
    const reach = box.clientWidth / 2 - knob.offsetWidth / 2;
    knob.style.transform = `translate(${x * reach}px, ${-y * reach}px)`;
  }

  function deflect(event) {
    const { left, top, width, height } = box.getBoundingClientRect();
    const radius = width / 2 - knob.offsetWidth / 2;
    const right = (event.clientX - left - width / 2) / radius;
    const up = (top + height / 2 - event.clientY) / radius;
    const length = Math.hypot(right, up);
    const scale = length < DEAD_ZONE ? 0 : Math.min(1, (length - DEAD_ZONE) / (1 - DEAD_ZONE)) / length;
    show(right * scale, up * scale);
  }

  holdPointer(box, {
    down: (event) => {
      event.preventDefault();
      deflect(event);
      press.begin(source);
    },
    move: deflect,
    up: () => {
      show(0, 0);
      press.end(source);
    },
  });
  return source;
}

/** A control made of directions that may be held together: the keys, or the buttons with arrows. */
function directions(press, speeds) {
  const held = new Map();
  const source = {
    command() {
      const sum = [0, 0, 0];
      for (const direction of held.values()) WAYS[direction].forEach((part, i) => (sum[i] += part));
      return speeds.command(...sum);
    },
  };
  return {
    /** A key or button is down; `id` names it.  The first one begins the press, further ones change its direction. */
    down(id, direction) {
      if (held.has(id)) return;
      held.set(id, direction);
      if (held.size === 1) press.begin(source);
    },
    /** A key or button is up; the last one ends the press. */
    up(id) {
      if (held.delete(id) && held.size === 0) press.end(source);
    },
    /** Forgets all that is held. */
    clear() {
      held.clear();
      press.end(source);
    },
  };
}

/** The buttons with arrows: each drives while it is held. */
export function pad(press, speeds) {
  const ways = directions(press, speeds);
  for (const button of document.querySelectorAll("[data-direction]")) {
    const { direction } = button.dataset;
    holdButton(
      button,
      () => ways.down(direction, direction),
      () => ways.up(direction),
    );
  }
}

/** Arrow keys or w a s d drive; Esc stops, and Space where it presses no button.  `helm` has `isMine` and `stop()`. */
export function keyboard(press, speeds, helm) {
  const ways = directions(press, speeds);
  const target = (event) => (event.target instanceof Element ? event.target : document.body);
  const stops = (event) => event.key === "Escape" || (event.key === " " && (press.held || !target(event).closest(CONTROLS)));
  const stop = (event) => {
    if (!stops(event)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!event.repeat) helm.stop();
  };
  window.addEventListener("keydown", stop, true); // before a button that has the focus
  document.addEventListener("mousedown", (event) => {
    if (!target(event).closest("button")) return;
    event.preventDefault(); // the mouse gives no button the focus, which would take the next Space
    document.activeElement?.blur();
  });
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) {
      ways.clear(); // the browser may keep the release of the other keys to itself
      return;
    }
    const direction = KEYS[event.key.toLowerCase()];
    if (!direction || event.isComposing || target(event).closest(FIELDS) || !helm.isMine) return;
    if (direction.startsWith("slide") && !speeds.sideways) return;
    event.preventDefault();
    if (!event.repeat) ways.down(event.code || event.key, direction);
  });
  window.addEventListener("keyup", (event) => ways.up(event.code || event.key));
  for (const type of ["blur", "pagehide"]) window.addEventListener(type, () => ways.clear());
  document.addEventListener("freeze", () => ways.clear());
  document.addEventListener("visibilitychange", () => document.hidden && ways.clear());
  document.addEventListener("focusin", (event) => target(event).closest(FIELDS) && ways.clear());
}
