/** The helm: which page drives as the server reports it, the buttons to take and give up the helm, STOP and its release. */

import { alarm, notice } from "./announce.js";
import { element, make, setText } from "./text.js";

const CONFIRM_MS = 700;

export class Helm {
  /** The robot has motors. */
  moves = false;
  changed = () => {};
  /** Called when STOP is pressed here. */
  stopping = () => {};
  /** Called with each state of the server. */
  taken = () => {};
  /** The last state of the server. */
  state = { names: {}, driver: null, wants: null, latched: false, latched_by: null, latched_by_name: "", spent: {}, why: "" };
  #connection;
  #you = null;
  #role = "";
  #stopWaits = false;
  #stopTimer = 0;

  constructor(connection) {
    this.#connection = connection;
    connection.on("helm", (message) => this.#take(message));
    const send = (type) => () => connection.send({ type });
    element("take").addEventListener("click", send("take"));
    element("yield").addEventListener("click", send("yield"));
    element("release").addEventListener("click", () => connection.send({ type: "release", heard: connection.heard }));
    // At once when the pointer goes down: a second finger may give no click.  A second stop does no harm.
    element("stop").addEventListener("pointerdown", (event) => event.button === 0 && this.stop());
    element("stop").addEventListener("click", () => this.stop());
  }

  get isMine() {
    return this.#connection.isOpen && this.#you !== null && this.state.driver === this.#you;
  }

  get mayDrive() {
    return this.#role === "drive";
  }

  /** The name of a page. */
  nameOf(id) {
    return this.state.names[id] || `page ${id}`;
  }

  /** The page that made the emergency stop: " by NAME", or empty. */
  get stoppedBy() {
    const { latched_by: id, latched_by_name: name } = this.state;
    if (id !== null && id === this.#you) return " by you";
    if (name) return ` by ${name}`;
    return id === null ? "" : " by a page that has left";
  }

  /** How this page can end the emergency stop: a sentence, or empty. */
  get release() {
    if (!this.mayDrive || !this.moves) return "";
    return this.isMine ? ". Release it to drive on" : ". Take the helm, then release it";
  }

  /** Another program has released the emergency stop of a page: a sentence. */
  released = "Another program has released the emergency stop: the robot may move";

  welcome(message) {
    this.#you = message.you;
    this.#role = message.role;
    this.moves = message.robot?.drive !== "none";
    if (this.#stopWaits) this.stop();
    this.#show();
  }

  /** Number of this page's last spent press. */
  get spent() {
    return this.state.spent?.[this.#you] ?? -1;
  }

  /** Why this page cannot drive now; empty if it can. */
  whyNot() {
    if (!this.#connection.isOpen) return "there is no link to the server";
    if (!this.mayDrive) return "this link is for watching only";
    if (!this.moves) return "this robot has no motors";
    if (!this.isMine) return "take the helm first";
    return this.state.latched ? "release the emergency stop first" : "";
  }

  /** Sends the emergency stop, again and again until the server has confirmed it, also when a link is back. */
  stop() {
    this.stopping();
    this.#stopWaits = true;
    if (!this.#connection.send({ type: "stop" })) {
      alarm("STOP is not sent: there is no link to the server. It is sent when the link is back.");
      notice("STOP waits for the link. Use the switch on the robot.");
      return;
    }
    clearInterval(this.#stopTimer);
    let said = false;
    this.#stopTimer = setInterval(() => {
      if (!this.#stopWaits) {
        clearInterval(this.#stopTimer);
        return;
      }
      this.#connection.send({ type: "stop" });
      if (!said) alarm("STOP is sent but not confirmed yet. Use the switch on the robot.");
      said = true;
      notice("STOP is not confirmed yet. Use the switch on the robot.");
    }, CONFIRM_MS);
  }

  /** Forgets which page drives when the link is lost. */
  lost() {
    this.#you = null;
    this.state = { ...this.state, driver: null, wants: null, names: {}, spent: {} };
    this.#show();
  }

  #take(message) {
    const before = this.state;
    this.state = { ...before, ...message };
    const { latched, wants } = this.state;
    if (latched) this.#stopWaits = false;
    if (latched && !before.latched) alarm(`Emergency stop${this.stoppedBy}.`);
    if (this.state.released_by_other && !before.released_by_other) alarm(`${this.released}.`);
    if (!latched && before.latched) notice("The emergency stop is released.");
    if (message.driver !== before.driver && this.#you !== null) {
      const next = message.driver ?? wants ?? before.wants;
      if (message.driver === this.#you) notice("You have the helm.");
      else if (before.driver === this.#you) notice(next === null ? "You gave up the helm." : `${this.nameOf(next)} has the helm now.`);
    }
    if (wants !== before.wants && wants !== null && this.isMine) notice(`${this.nameOf(wants)} asks for the helm.`);
    this.#show();
    this.taken(this.state);
  }

  #show() {
    const { driver, wants, latched, names } = this.state;
    const { dataset } = document.documentElement;
    dataset.role = this.#role || "watch";
    dataset.helm = this.isMine ? "mine" : driver === null ? "free" : "other";
    dataset.latched = latched ? "yes" : "no";
    for (const id of ["controls", "drive", "goal"]) element(id).hidden = !(this.mayDrive && this.moves);
    const take = element("take");
    const hadFocus = take.matches(":focus-visible");
    const waits = wants !== null && wants === this.#you;
    take.hidden = this.isMine;
    take.disabled = waits || !this.#connection.isOpen;
    setText(take, waits ? "Waiting for the helm" : driver === null ? "Take the helm" : "Ask for the helm");
    element("yield").hidden = !this.isMine;
    if (hadFocus && this.isMine) element("yield").focus();
    element("release").hidden = !(this.isMine && latched);
    setText(element("driver"), this.#driverText());
    const roles = [[this.#you, "you"], [driver, "at the helm"], [wants, "asks for the helm"]];
    const rows = Object.keys(names).map(Number).map((id) => {
      const notes = roles.filter(([who]) => who === id).map(([, note]) => note).join(", ");
      return make("li", id === driver ? "drives" : "", this.nameOf(id) + (notes && ` (${notes})`));
    });
    const text = rows.map((row) => row.textContent).join("\n");
    const people = element("people");
    if (people.dataset.shown !== text) {
      people.dataset.shown = text;
      people.replaceChildren(...rows);
    }
    this.changed();
  }

  #driverText() {
    const { driver } = this.state;
    if (!this.#connection.isOpen || !this.moves) return "";
    if (this.isMine) return "You have the helm";
    if (driver !== null) return `${this.nameOf(driver)} has the helm`;
    return this.mayDrive ? "The helm is free" : "Watching only";
  }
}
