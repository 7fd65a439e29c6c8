/** Puts the page together: messages of the server on one side, controls and displays on the other. */

import { alarm, notice, robotNotice, say } from "./announce.js";
import { Samples, charts } from "./charts.js";
import { Connection } from "./connection.js";
import { gamepad } from "./gamepad.js";
import { Goal } from "./goal.js";
import { joystick, keyboard, pad } from "./held_controls.js";
import { Helm } from "./helm.js";
import { FloorMap } from "./map.js";
import * as panels from "./panels.js";
import { phone } from "./phone.js";
import { Press } from "./press.js";
import { recordings } from "./recordings.js";
import { Speeds } from "./speeds.js";
import { element, markOf, number, remember, remembered, sentence, setText } from "./text.js";

const FRAME_MS = 40;
const WORDS_MS = 1000;
const ANSWER_MS = 400; // the robot reports 10 times a second whether it drives
const SHOWN_FIRST = ["speed", "asked speed"];
const page = document.documentElement.dataset;

const link = new URLSearchParams(location.hash.slice(1));
const token = link.get("drive") ?? link.get("watch") ?? "";
const name = element("name");
name.value = remembered("name", "") || `${matchMedia("(pointer: coarse)").matches ? "phone" : "computer"} ${Math.floor(10 + Math.random() * 90)}`;
remember("name", name.value);

const hello = { type: "hello", token, name: name.value };
const connection = new Connection(hello);
const helm = new Helm(connection);
const press = new Press(connection, () => helm.whyNot());
const speeds = new Speeds();
const stick = joystick(press, speeds);
const goal = new Goal(press);
const map = new FloorMap();
const samples = new Samples();
const plots = charts(samples, SHOWN_FIRST);
const welcomes = [recordings(connection, token), phone(connection, helm)];
keyboard(press, speeds, helm);
pad(press, speeds);
gamepad(press, speeds, helm);

let view = {};
let counts = {};
let wordsAt = -Infinity;
let framedAt = -Infinity;
let spentBefore = false;
let heldSince = Infinity;
let hasDriven = false;

/** The state in words, and its mark; the most important one counts. */
function stateNow() {
  if (!connection.isOpen) return [connection.words, connection.state === "connecting" ? "" : "bad"];
  if (helm.state.released_by_other) return [`${helm.released}. Press STOP to stop it`, "bad"];
  if (helm.state.latched) return [`EMERGENCY STOP${helm.stoppedBy}${helm.release}`, "bad"];
  if (view.silent) return ["No data from the robot", "bad"];
  if (press.source && press.reason === "goal_reached") return [sentence(press.why), "good"];
  if (press.source && press.why) return [sentence(press.why) + (press.drove ? ". Release and press again" : ""), "caution"];
  if (connection.state === "slow" && press.held) return [connection.words, "caution"];
  const waits = view.stopped && performance.now() - heldSince > ANSWER_MS;
  if (press.held) return [waits ? sentence(view.stopped) : "You drive", waits ? "caution" : "good"];
  if (!view.stopped) return [view.command ? "The robot drives" : view.name ? "Another program drives" : "Connected", view.command ? "good" : ""];
  if (!hasDriven && view.reason === "boot") return ["Standing", ""]; // the board was switched on
  return [sentence(view.stopped), view.reason ? "caution" : ""];
}

function showState() {
  const [words, mark] = stateNow();
  setText(element("state"), words);
  element("status").dataset.mark = mark;
  setText(element("link"), connection.brief);
  element("link").dataset.state = connection.state;
  element("retry").hidden = connection.state !== "refused";
  element("record").disabled = !connection.isOpen;
  page.held = press.held ? "yes" : "no";
  heldSince = press.held ? Math.min(heldSince, performance.now()) : Infinity;
  const spent = Boolean(press.source && press.why);
  page.spent = spent ? "yes" : "no";
  setText(element("joystick-text"), spent ? (press.drove ? "release and press again" : press.why) : "");
  if (spent && !spentBefore) alarm(`${sentence(press.why)}.${press.drove ? " Release the control and press again." : ""}`);
  spentBefore = spent;
}

press.changed = showState;
helm.changed = showState;
helm.stopping = () => press.spend("STOP was pressed");

let wasOpen = false;
let wasSlow = false;
connection.changed = () => {
  if (wasOpen && !connection.isOpen) {
    const drove = press.held;
    press.spend("the link to the server is lost");
    helm.lost();
    forget();
    alarm(`${connection.words}.${drove ? " The robot stops by itself." : ""}`);
  } else if (connection.state === "refused") {
    alarm(connection.words);
  } else if (connection.state === "slow" && !wasSlow) {
    say(`${connection.words}.`);
  }
  wasOpen = connection.isOpen;
  wasSlow = connection.state === "slow";
  showState();
};

/** Without a link nobody knows what the robot does: what was true before it was lost is not shown as if it were. */
function forget() {
  view = { name: view.name, silent: true };
  map.ranges = {};
  map.touch();
  panels.readings([pageSection()]);
  panels.nearest(null, "");
  panels.battery(null);
  wordsAt = -Infinity;
}

connection.on("welcome", (message) => {
  const { robot } = message;
  setText(element("robot"), robot.name || "Robot");
  document.title = robot.name || "Robot";
  speeds.limits = robot.limits;
  page.base = robot.drive;
  for (const id of ["slide-left", "slide-right", "slide-keys", "drag-choice"]) element(id).hidden = !speeds.sideways;
  if (!speeds.sideways) stick.slides = false;
  element("tile-nearest-box").hidden = !Object.keys(robot.sonars ?? {}).length;
  map.robot = { body: robot.body ?? [0.2, 0.2], sonars: robot.sonars ?? {} };
  map.touch();
  samples.begin(message.series);
  plots.build();
  helm.welcome(message);
  for (const welcome of welcomes) welcome(message);
});

connection.on("sample", ({ at, v }) => {
  samples.add(at, v.map(number));
  map.move(samples.newest("x"), samples.newest("y"), samples.newest("yaw"));
});

connection.on("path", ({ poses }) => {
  map.setPath(poses);
  map.setCells(1, []); // those of this server come next
});
connection.on("cells", ({ size, taken }) => map.setCells(size, taken));

connection.on("view", (message) => {
  const before = view;
  view = message;
  if (view.name) setText(element("robot"), view.name);
  robotNotice(sentence(view.notice || ""));
  if (view.silent && !before.silent) alarm("No data from the robot.");
  hasDriven ||= Boolean(view.command);
  if (view.reason && before.reason !== undefined && view.reason !== before.reason) alarm(`${sentence(view.stopped)}.`);
  map.ranges = view.ranges ?? {};
  map.marks = {};
  for (const { title, rows } of view.sections ?? []) {
    if (title === "sonars") for (const [sonar, , style, bar] of rows) map.marks[sonar] = markOf(bar?.[1] || style);
  }
  map.touch();
  if (document.hidden) return;
  const found = panels.nearestOf(view.ranges);
  panels.readings([...(view.sections ?? []), pageSection()]);
  panels.nearest(found, found ? map.marks[found[0]] ?? "" : "");
  panels.battery(view.battery);
  wordsAt = -Infinity; // the map's words say the same as the readings
  showState();
});

connection.on("refused", ({ why }) => notice(`${sentence(why)}.`));

helm.taken = (message) => {
  counts = message;
  press.answer(helm.spent, message);
};

/** The link between page and server, as a section of the readings. */
function pageSection() {
  const rows = [["transport", connection.title, ""]];
  rows.push(["delay", `${Math.round(connection.delay.ms)} ms`, connection.state === "slow" ? "yellow" : ""]);
  const dropped = ["late", "repeated", "malformed"].filter((kind) => counts[kind] > 0).map((kind) => `${counts[kind]} ${kind}`);
  rows.push(["dropped", dropped.join(", ") || "none", dropped.length ? "yellow" : ""]);
  return { title: "page", style: "", rows };
}

goal.changed = (value) => {
  map.goal = value;
  map.touch();
  wordsAt = -Infinity;
};
map.clicked = (x, y) => helm.mayDrive && helm.moves && goal.place(x, y);

element("retry").addEventListener("click", () => connection.restart());
name.addEventListener("change", () => {
  name.value = name.value.replace(/[^\p{L}\p{N}\p{P}\p{S} ]/gu, "").trim() || "page";
  remember("name", name.value);
  hello.name = name.value;
  if (helm.isMine) notice("Others see the new name after the next connection.");
  else connection.restart();
});
for (const choice of document.querySelectorAll("[name=drag]")) {
  choice.addEventListener("change", () => (stick.slides = choice.value === "slide" && choice.checked));
}
window.addEventListener("hashchange", () => location.reload());

function frame(now) {
  requestAnimationFrame(frame);
  if (now - framedAt < FRAME_MS - 5) return;
  framedAt = now;
  map.draw();
  plots.draw(now);
  panels.motion(samples.newest("speed"), samples.newest("turn rate"), samples.newest("sideways speed"), view);
  if (now - wordsAt < WORDS_MS) return;
  wordsAt = now;
  panels.map(connection.isOpen ? map.pose : null, panels.nearestOf(view.ranges), goal.value);
  showState();
}

requestAnimationFrame(frame);
showState();
connection.restart();
