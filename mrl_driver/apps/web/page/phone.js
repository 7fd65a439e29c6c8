/** Sends the motion sensors of this phone, after the user has allowed it. */

import { element, setText } from "./text.js";

const SILENT_MS = 2000;
const TURNED = "ondeviceorientationabsolute" in window ? "deviceorientationabsolute" : "deviceorientation";
const finite = (...values) => (values.every(Number.isFinite) ? values : null);
const known = (value) => (Number.isFinite(value) ? value : null);
const tell = (text) => setText(element("phone-text"), text);

/** iPhone and iPad (which calls itself a Mac) have the opposite sign in accelerationIncludingGravity. */
function isApple() {
  return /iPhone|iPad|iPod/.test(navigator.userAgent) || (navigator.platform === "MacIntel" && navigator.maxTouchPoints > 1);
}

/** Returns what takes the welcome of each new connection. */
export function phone(connection, helm) {
  const sign = isApple() ? -1 : 1;
  let orientation = { alpha: null, beta: null, gamma: null, absolute: false };
  let on = false;
  let sentAt = 0;
  let seenAt = 0;
  let sent = 0;
  let timer = 0;

  function turned({ alpha, beta, gamma, absolute }) {
    orientation = { alpha: known(alpha), beta: known(beta), gamma: known(gamma), absolute: Boolean(absolute) };
  }

  function moved({ accelerationIncludingGravity: pull, rotationRate: rate }) {
    const acceleration = pull && finite(pull.x, pull.y, pull.z)?.map((value) => value * sign);
    const rotation = rate && finite(rate.alpha, rate.beta, rate.gamma);
    if (!acceleration && !rotation && orientation.alpha === null) return; // a device without sensors
    const now = performance.now();
    seenAt = now;
    if (!helm.isMine || now - sentAt < connection.phonePeriodMs) return;
    sentAt = now;
    const message = { type: "phone", t: now, ...orientation, acceleration: acceleration ?? null, rotation };
    if (connection.lossy(message)) sent += 1;
  }

  function watch() {
    if (performance.now() - seenAt > SILENT_MS) tell("This device reports no motion.");
    else if (!helm.isMine) tell("Take the helm to send it.");
    else tell(`Sending, ${sent} readings a second.`);
    sent = 0;
  }

  /** Listens to the sensors, or no longer. */
  function listen(begins) {
    on = begins;
    const change = (begins ? window.addEventListener : window.removeEventListener).bind(window);
    change(TURNED, turned);
    change("devicemotion", moved);
    clearInterval(timer);
    if (begins) timer = setInterval(watch, 1000);
    setText(element("phone"), begins ? "Stop sending" : "Send this phone's motion");
  }

  async function begin() {
    try {
      for (const Kind of [globalThis.DeviceMotionEvent, globalThis.DeviceOrientationEvent]) {
        if (typeof Kind?.requestPermission === "function" && (await Kind.requestPermission()) !== "granted") {
          tell("The browser does not allow it. Allow motion sensors in its settings.");
          return;
        }
      }
    } catch (error) {
      tell(`The browser does not allow it: ${error.message}.`);
      return;
    }
    sent = 0;
    seenAt = performance.now();
    listen(true);
    watch();
  }

  function end(why) {
    listen(false);
    tell(why);
  }

  element("phone").addEventListener("click", () => (on ? end("Nothing is sent.") : begin()));
  document.addEventListener("visibilitychange", () => document.hidden && on && end("The page was hidden: nothing is sent."));
  return ({ role }) => {
    element("phone-panel").hidden = !(role === "drive" && "DeviceMotionEvent" in globalThis && navigator.maxTouchPoints);
  };
}
