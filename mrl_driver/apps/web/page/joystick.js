/** A joystick for finger, pen or mouse: drives while the pointer is down. */

import { holdPointer } from "./hold_button.js";
import { element } from "./text.js";

const DEAD_ZONE = 0.1;

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
