/** A control made of directions that may be held together: the keys, or the buttons with arrows. */

import { holdButton } from "./hold_button.js";

const WAYS = {
  forward: [1, 0, 0],
  backward: [-1, 0, 0],
  left: [0, 1, 0],
  right: [0, -1, 0],
  "slide-left": [0, 0, 1],
  "slide-right": [0, 0, -1],
};

export class Directions {
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

  has(id) {
    return this.#held.has(id);
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
