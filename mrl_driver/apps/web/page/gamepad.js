/** Drives with a gamepad while a shoulder button (the dead-man button) is held. */

const PERIOD_MS = 50;
const FROZEN_MS = 2000; // a gamepad out of radio range keeps its last state
const SHOULDERS = [4, 5, 6, 7];
const STOP_BUTTON = 1;
const DEAD_ZONE = 0.12;

const bent = (value = 0) => (Math.abs(value) < DEAD_ZONE ? 0 : (value - Math.sign(value) * DEAD_ZONE) / (1 - DEAD_ZONE));

export class Gamepad {
  #press;
  #speeds;
  #helm;
  #index = null;
  #axes = [];
  #timestamp = -1;
  #changedAt = 0;
  #stopped = false;

  constructor(press, speeds, helm) {
    this.#press = press;
    this.#speeds = speeds;
    this.#helm = helm;
    window.addEventListener("gamepaddisconnected", () => this.#poll());
    setInterval(() => this.#poll(), PERIOD_MS);
  }

  command() {
    const [x, y, turn] = this.#axes.map(bent);
    if (this.#speeds.sideways) return this.#speeds.command(-y, -(turn || 0), -x);
    return this.#speeds.command(-y, Math.abs(turn || 0) > Math.abs(x) ? -turn : -x);
  }

  #poll() {
    const pads = [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad && pad.connected !== false);
    const held = (pad) => SHOULDERS.some((button) => pad.buttons[button]?.pressed);
    const stop = pads.some((pad) => pad.buttons[STOP_BUTTON]?.pressed);
    if (stop && !this.#stopped) this.#helm.stop();
    this.#stopped = stop;
    const pad = this.#index === null ? pads.find(held) : pads.find(({ index }) => index === this.#index);
    const now = performance.now();
    if (!pad || !held(pad)) {
      this.#end();
    } else if (this.#index === null) {
      this.#index = pad.index;
      this.#read(pad, now);
      if (this.#helm.isMine) this.#press.begin(this);
    } else {
      this.#read(pad, now);
      if (this.#press.source === this && now - this.#changedAt > FROZEN_MS) {
        this.#press.spend("the gamepad has reported nothing new for 2 s");
      }
    }
  }

  #read(pad, now) {
    if (pad.timestamp !== this.#timestamp) this.#changedAt = now;
    this.#timestamp = pad.timestamp;
    this.#axes = [...pad.axes].slice(0, 3);
  }

  #end() {
    this.#index = null;
    this.#timestamp = -1;
    this.#press.end(this);
  }
}
