/** A joystick for finger, pen or mouse: drives while the pointer is down. */

import { element } from "./text.js";

const DEAD_ZONE = 0.1;

export class Joystick {
  /** To the side the joystick turns the robot, or moves it sideways. */
  slides = false;
  #press;
  #speeds;
  #box = element("joystick");
  #knob = element("knob");
  #pointer = null;
  #x = 0;
  #y = 0;

  constructor(press, speeds) {
    this.#press = press;
    this.#speeds = speeds;
    const box = this.#box;
    box.addEventListener("pointerdown", (event) => this.#down(event));
    box.addEventListener("pointermove", (event) => this.#move(event));
    const ended = (event) => event.pointerId === this.#pointer && this.#release();
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) box.addEventListener(type, ended);
    box.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  command() {
    return this.slides ? this.#speeds.command(this.#y, 0, -this.#x) : this.#speeds.command(this.#y, -this.#x);
  }

  #down(event) {
    if (event.button !== 0 || this.#pointer !== null) return;
    event.preventDefault();
    this.#pointer = event.pointerId;
    this.#box.setPointerCapture(event.pointerId);
    this.#deflect(event);
    this.#press.begin(this);
  }

  #move(event) {
    if (event.pointerId !== this.#pointer) return;
    if (event.buttons === 0) this.#release(); // the pointer went up where the page could not see it
    else this.#deflect(event);
  }

  #release() {
    this.#pointer = null;
    this.#x = this.#y = 0;
    this.#draw();
    this.#press.end(this);
  }

  #deflect(event) {
    const box = this.#box.getBoundingClientRect();
    const radius = box.width / 2 - this.#knob.offsetWidth / 2;
    const x = (event.clientX - box.left - box.width / 2) / radius;
    const y = (box.top + box.height / 2 - event.clientY) / radius;
    const length = Math.hypot(x, y);
    const scale = length < DEAD_ZONE ? 0 : Math.min(1, (length - DEAD_ZONE) / (1 - DEAD_ZONE)) / length;
    this.#x = x * scale;
    this.#y = y * scale;
    this.#draw();
  }

  #draw() {
    const reach = this.#box.clientWidth / 2 - this.#knob.offsetWidth / 2;
    this.#knob.style.transform = `translate(${this.#x * reach}px, ${-this.#y * reach}px)`;
  }
}
