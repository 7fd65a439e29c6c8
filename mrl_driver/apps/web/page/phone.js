/** Sends the motion sensors of this phone, after the user has allowed it. */

import { element, setText } from "./text.js";

const SILENT_MS = 2000;
const TURNED = "ondeviceorientationabsolute" in window ? "deviceorientationabsolute" : "deviceorientation";
const finite = (...values) => (values.every(Number.isFinite) ? values : null);
const known = (value) => (Number.isFinite(value) ? value : null);

/** iPhone and iPad (which calls itself a Mac) have the opposite sign in accelerationIncludingGravity. */
function isApple() {
  return /iPhone|iPad|iPod/.test(navigator.userAgent) || (navigator.platform === "MacIntel" && navigator.maxTouchPoints > 1);
}

export class Phone {
  #connection;
  #helm;
  #on = false;
  #sentAt = 0;
  #seenAt = 0;
  #sent = 0;
  #orientation = { alpha: null, beta: null, gamma: null, absolute: false };
  #timer = 0;
  #sign = isApple() ? -1 : 1;
  #turned = (event) => this.#turn(event);
  #moved = (event) => this.#move(event);

  constructor(connection, helm) {
    this.#connection = connection;
    this.#helm = helm;
    element("phone").addEventListener("click", () => (this.#on ? this.#end("") : this.#begin()));
    document.addEventListener("visibilitychange", () => document.hidden && this.#on && this.#end("The page was hidden: nothing is sent."));
  }

  welcome(message) {
    element("phone-panel").hidden = !(message.role === "drive" && "DeviceMotionEvent" in globalThis && navigator.maxTouchPoints);
  }

  async #begin() {
    try {
      for (const Kind of [globalThis.DeviceMotionEvent, globalThis.DeviceOrientationEvent]) {
        if (typeof Kind?.requestPermission === "function" && (await Kind.requestPermission()) !== "granted") {
          this.#tell("The browser does not allow it. Allow motion sensors in its settings.");
          return;
        }
      }
    } catch (error) {
      this.#tell(`The browser does not allow it: ${error.message}.`);
      return;
    }
    this.#on = true;
    this.#sent = 0;
    this.#seenAt = performance.now();
    window.addEventListener(TURNED, this.#turned);
    window.addEventListener("devicemotion", this.#moved);
    this.#timer = setInterval(() => this.#watch(), 1000);
    this.#show();
    this.#watch();
  }

  #end(why) {
    this.#on = false;
    window.removeEventListener(TURNED, this.#turned);
    window.removeEventListener("devicemotion", this.#moved);
    clearInterval(this.#timer);
    this.#show();
    this.#tell(why || "Nothing is sent.");
  }

  #turn({ alpha, beta, gamma, absolute }) {
    this.#orientation = { alpha: known(alpha), beta: known(beta), gamma: known(gamma), absolute: Boolean(absolute) };
  }

  #move(event) {
    const { accelerationIncludingGravity: pull, rotationRate: rate } = event;
    const acceleration = pull && finite(pull.x, pull.y, pull.z);
    const rotation = rate && finite(rate.alpha, rate.beta, rate.gamma);
    if (!acceleration && !rotation && this.#orientation.alpha === null) return; // a device without sensors
    const now = performance.now();
    this.#seenAt = now;
    if (!this.#helm.isMine || now - this.#sentAt < this.#connection.phonePeriodMs) return;
    this.#sentAt = now;
    const message = {
      type: "phone",
      t: now,
      ...this.#orientation,
      acceleration: acceleration && acceleration.map((value) => value * this.#sign),
      rotation,
    };
    if (this.#connection.lossy(message)) this.#sent += 1;
  }

  #watch() {
    if (performance.now() - this.#seenAt > SILENT_MS) this.#tell("This device reports no motion.");
    else if (!this.#helm.isMine) this.#tell("Take the helm to send it.");
    else this.#tell(`Sending, ${this.#sent} readings a second.`);
    this.#sent = 0;
  }

  #show() {
    setText(element("phone"), this.#on ? "Stop sending" : "Send this phone's motion");
  }

  #tell(text) {
    setText(element("phone-text"), text);
  }
}
