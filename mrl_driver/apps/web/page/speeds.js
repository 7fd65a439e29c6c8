/** The speeds of a fully deflected control: a share of the robot's limits, set by the slider. */

import { degrees, element, fixed, remember, remembered, setText } from "./text.js";

export class Speeds {
  sideways = false;
  #limits = { linear: 0, angular: 0, lateral: 0 };
  #slider = element("speed");

  constructor() {
    this.#slider.value = String(remembered("speed", 50));
    this.#slider.addEventListener("input", () => {
      remember("speed", Number(this.#slider.value));
      this.#show();
    });
    // Arrow keys drive again after the pointer has set the slider.
    this.#slider.addEventListener("pointerup", () => this.#slider.blur());
  }

  /** Sets the limits [m/s, rad/s, m/s]; without a limit that speed is zero. */
  set limits(limits) {
    for (const name of ["linear", "angular", "lateral"]) this.#limits[name] = Number(limits?.[name]) || 0;
    this.sideways = this.#limits.lateral > 0;
    this.#show();
  }

  /** The command of a deflection: each part from -1 to 1; forward, to the left, and sideways to the left. */
  command(forward, left, aside = 0) {
    const share = Number(this.#slider.value) / 100;
    const scaled = (value, limit) => Math.max(-1, Math.min(1, value)) * share * limit || 0;
    return {
      linear: scaled(forward, this.#limits.linear),
      angular: scaled(left, this.#limits.angular),
      lateral: scaled(aside, this.#limits.lateral),
    };
  }

  #show() {
    const full = this.command(1, 1);
    const [linear, angular] = [fixed(full.linear, 2), fixed(degrees(full.angular), 0)];
    setText(element("speed-text"), `${linear} m/s, ${angular}°/s`);
    this.#slider.setAttribute("aria-valuetext", `${linear} metres per second, ${angular} degrees per second`);
  }
}
