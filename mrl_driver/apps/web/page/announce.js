/** Texts for everybody: stops are read out at once, notices when the screen reader has time. */

import { element, setText } from "./text.js";

const NOTICE_MS = 8000;

let ofRobot = "";
let ofPage = "";
let timer = 0;

function show() {
  const text = ofPage || ofRobot;
  setText(element("notice"), text);
  element("notice").title = text;
}

/** Reads out a stop, or why a control does nothing. */
export function alarm(text) {
  const region = element("why");
  region.textContent = region.textContent === text ? `${text}\u00a0` : text; // an equal text would not be read again
}

/** Reads out a text that is shown elsewhere. */
export function say(text) {
  setText(element("said"), text);
}

/** Shows a notice of the page for some seconds. */
export function notice(text) {
  ofPage = text;
  clearTimeout(timer);
  timer = setTimeout(() => {
    ofPage = "";
    show();
  }, NOTICE_MS);
  show();
}

/** Shows the robot's notice as long as the robot has it. */
export function robotNotice(text) {
  ofRobot = text;
  show();
}
