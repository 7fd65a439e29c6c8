/** The connection to the server: opens it, opens it again, measures its delay, and describes it in words. */

import { number } from "./text.js";
import { PostTransport, SocketTransport } from "./transports.js";

const OPEN_MS = 3000; // without a welcome after this time the other transport is tried
const QUIET_MS = 1500; // the server sends at least one message a second
const DEAD_MS = 4000;
const LATE_MS = 100; // the server drops commands older than 150 ms
const SOCKET_TRIES = 2; // WebSockets that fail before the other transport is tried
const TRIES_AFTER_ONE = 6; // the same if one has worked before: then the server is gone, not refused by the browser
const PAUSES_MS = [100, 250, 500, 1000, 2000];
const STEADY_MS = 2000;
const WINDOW_MS = 10000;
const CHECK_MS = 250;
const SLOW_CHECKS = 4; // the link is slow if each of these was late
const PING_MS = 1000;

/** Delay of the server's messages beyond the shortest delay of the last 10 to 20 s. */
class Delay {
  #shortest = [Infinity, Infinity];
  #since = 0;
  #shownAt = 0;
  ms = 0;

  add(difference, now) {
    if (now - this.#since > WINDOW_MS) {
      this.#shortest = [Infinity, this.#shortest[0]];
      this.#since = now;
    }
    this.#shortest[0] = Math.min(this.#shortest[0], difference);
    const late = difference - Math.min(...this.#shortest);
    this.ms = Math.max(late, this.ms * Math.exp((this.#shownAt - now) / 500)); // a peak stays visible for a second
    this.#shownAt = now;
  }
}

export class Connection {
  state = "connecting";
  words = "Connecting to the server";
  /** The same in a few words, for a narrow place. */
  brief = "Connecting";
  delay = new Delay();
  changed = () => {};
  #hello;
  #handlers = new Map();
  #transport = null;
  #usesPost = false;
  #socketTries = SOCKET_TRIES;
  #failures = 0;
  #attempts = 0;
  #welcomeAt = 0;
  #timer = 0;
  #openTimer = 0;
  #heard = null;
  #heardAt = -Infinity;
  #pingAt = 0;
  #closedWhy = "";
  #mayReturn = true;
  #sequence = 0;
  #mayDrive = false;
  #late = [];

  constructor(hello) {
    this.#hello = hello;
    setInterval(() => this.#check(), CHECK_MS);
    window.addEventListener("online", () => this.#hurry());
    document.addEventListener("visibilitychange", () => document.hidden || this.#hurry());
    window.addEventListener("pageshow", (event) => event.persisted && this.restart());
  }

  /** Calls `handler` with each message of a type. */
  on(type, handler) {
    this.#handlers.set(type, handler);
  }

  get isOpen() {
    return this.#welcomeAt > 0;
  }

  /** How long nothing has come from the server [ms]. */
  get quietMs() {
    return performance.now() - this.#heardAt;
  }

  get title() {
    return this.#usesPost ? PostTransport.title : SocketTransport.title;
  }

  get phonePeriodMs() {
    return this.#transport?.phonePeriodMs ?? Infinity;
  }

  /** Opens the connection, also if it is open or refused. */
  restart() {
    this.#drop();
    this.#attempts = 0;
    this.#open();
  }

  /** Time of the newest message from the server, by its clock [ms]; null before the first. */
  get heard() {
    return this.#heard;
  }

  /** Sends a message; returns whether there is a connection to send it over. */
  send(message) {
    return this.isOpen && this.#transport.send(message);
  }

  /** Sends a control message with its number and times; only a page that may drive has any. */
  control(fields) {
    if (!this.isOpen || !this.#mayDrive || this.#heard === null) return false;
    this.#sequence += 1;
    return this.#transport.control({ type: "control", seq: this.#sequence, ...this.#times(), ...fields });
  }

  /** Sends a message that may be lost. */
  lossy(message) {
    return this.isOpen && this.#transport.lossy(message);
  }

  #times() {
    return { t: performance.now(), heard: this.#heard, heard_t: this.#heardAt };
  }

  #open() {
    clearTimeout(this.#timer);
    clearTimeout(this.#openTimer);
    this.#closedWhy = "";
    this.#mayReturn = true;
    this.#heard = null;
    this.delay = new Delay();
    this.#usesPost ||= typeof WebSocket === "undefined";
    const Kind = this.#usesPost ? PostTransport : SocketTransport;
    const transport = new Kind(this.#hello, {
      message: (text) => transport === this.#transport && this.#take(text),
      ended: (refused) => transport === this.#transport && this.#ended(refused),
    });
    this.#transport = transport;
    this.#openTimer = setTimeout(() => this.isOpen || this.#ended("", true), OPEN_MS);
    this.#late = [];
    if (this.#attempts === 0) this.#show("connecting", "Connecting to the server", "Connecting");
  }

  #take(text) {
    let message;
    try {
      message = JSON.parse(text);
    } catch {
      return;
    }
    const now = performance.now();
    const at = number(message.at);
    if (!Number.isNaN(at) && (this.#heard === null || at > this.#heard)) {
      this.#heard = at;
      this.#heardAt = now;
      this.delay.add(now - at, now);
    }
    if (message.type === "welcome") {
      this.#welcomeAt = now;
      this.#mayDrive = message.role === "drive";
      this.#failures = 0;
      if (!this.#usesPost) this.#socketTries = TRIES_AFTER_ONE;
      document.documentElement.dataset.transport = this.#usesPost ? PostTransport.id : SocketTransport.id;
      this.#show("open", "Connected");
    } else if (message.type === "closed") {
      this.#closedWhy = message.why || "no reason given";
      this.#mayReturn = message.again !== false;
    }
    this.#handlers.get(message.type)?.(message);
  }

  #ended(refused, tookTooLong = false) {
    const wasOpen = this.isOpen;
    const steady = performance.now() - this.#welcomeAt > STEADY_MS;
    const why = this.#closedWhy;
    this.#drop();
    if (refused || (!wasOpen && !this.#mayReturn)) {
      this.#show("refused", `The server refuses this page: ${refused || why}`, "Refused");
      return;
    }
    if (!wasOpen && !why) this.#choose(tookTooLong);
    else if (steady) this.#attempts = 0;
    const pause = PAUSES_MS[Math.min(this.#attempts, PAUSES_MS.length - 1)];
    this.#attempts += 1;
    this.#timer = setTimeout(() => this.#open(), pause);
    if (wasOpen || why || this.#attempts > 1) {
      const words = why ? `The server closed the link: ${why}. Connecting again` : "Link to the server lost. Connecting again";
      this.#show("closed", words, "Link lost");
    }
  }

  /** Chooses the transport of the next try after one that did not open. */
  #choose(tookTooLong) {
    this.#failures += 1;
    if (this.#usesPost) {
      this.#usesPost = false;
      this.#failures = this.#socketTries - 1;
    } else if (tookTooLong || this.#failures >= this.#socketTries) {
      this.#usesPost = true;
    }
  }

  #drop() {
    const transport = this.#transport;
    this.#transport = null;
    this.#welcomeAt = 0;
    clearTimeout(this.#openTimer);
    transport?.close();
  }

  /** Ends a pause between two tries. */
  #hurry() {
    if (this.state === "closed" && !this.#transport) this.#open();
  }

  #check() {
    if (!this.isOpen) return;
    const quiet = this.quietMs;
    if (quiet > DEAD_MS) {
      this.#ended("");
      return;
    }
    if (!this.#mayDrive && performance.now() - this.#pingAt > PING_MS) {
      this.#pingAt = performance.now();
      this.send({ type: "ping", ...this.#times() });
    }
    this.#late = [...this.#late, this.delay.ms].slice(-SLOW_CHECKS);
    const late = this.#late.length < SLOW_CHECKS ? 0 : Math.round(Math.min(...this.#late));
    const seconds = (quiet / 1000).toFixed(0);
    if (quiet > QUIET_MS) this.#show("slow", `No data from the server for ${seconds} s`, `No data for ${seconds} s`);
    else if (late > LATE_MS) this.#show("slow", `Slow link: data is ${late} ms late`, `Slow, ${late} ms`);
    else this.#show("open", "Connected");
  }

  #show(state, words, brief = words) {
    if (state === this.state && words === this.words) return;
    this.state = state;
    this.words = words;
    this.brief = brief;
    document.documentElement.dataset.link = state;
    this.changed();
  }
}
