/** Drives with a gamepad while a shoulder button (the dead-man button) is held. */

const PERIOD_MS = 50;
const FROZEN_MS = 2000; // a gamepad out of radio range keeps its last state
const SHOULDERS = [4, 5, 6, 7];
const STOP_BUTTON = 1;
const DEAD_ZONE = 0.12;

const bent = (value = 0) => (Math.abs(value) < DEAD_ZONE ? 0 : (value - Math.sign(value) * DEAD_ZONE) / (1 - DEAD_ZONE));
const isHeld = (pad) => SHOULDERS.some((button) => pad.buttons[button]?.pressed);

export function gamepad(press, speeds, helm) {
  let index = null; // of the gamepad that is held
  let axes = [];
  let timestamp = -1;
  let changedAt = 0;
  let stopped = false;
  const source = {
    command() {
      const [x, y, turn] = axes.map(bent);
      if (speeds.sideways) return speeds.command(-y, -(turn || 0), -x);
      return speeds.command(-y, Math.abs(turn || 0) > Math.abs(x) ? -turn : -x);
    },
  };

  function poll() {
    const pads = [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad && pad.connected !== false);
    const stop = pads.some((pad) => pad.buttons[STOP_BUTTON]?.pressed);
    if (stop && !stopped) helm.stop();
    stopped = stop;
    const pad = index === null ? pads.find(isHeld) : pads.find((each) => each.index === index);
    if (!pad || !isHeld(pad)) {
      index = null;
      timestamp = -1;
      press.end(source);
      return;
    }
    const now = performance.now();
    if (pad.timestamp !== timestamp) changedAt = now;
    timestamp = pad.timestamp;
    axes = [...pad.axes].slice(0, 3);
    if (index === null) {
      index = pad.index;
      if (helm.isMine) press.begin(source);
    } else if (press.source === source && now - changedAt > FROZEN_MS) {
      press.spend("the gamepad has reported nothing new for 2 s");
    }
  }

  window.addEventListener("gamepaddisconnected", poll);
  setInterval(poll, PERIOD_MS);
}
