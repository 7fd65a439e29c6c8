/**
 * Decides whether a control is held, and sends control messages.
 *
 * A source is a joystick, the keys, the buttons, a gamepad or a goal: `begin` when it is pressed, `end` when it is released.  One source
 * counts at a time.  A press is spent after any stop: its source must be released and pressed again.  The server has its own
 * time limits; nothing here makes the robot drive longer than they allow.
 */

import { notice } from "./announce.js";

const PERIOD_MS = 50;
const IDLE_MS = 200;
const STALL_MS = 150; // a page that was busy for longer no longer knows what is held
const QUIET_MS = 1500;

export class Press {
  /** Called after each change. */
  changed = () => {};
  /** Why the source does not drive although it is pressed; empty otherwise. */
  why = "";
  /** The same as the server's stop reason; empty if this page has ended the press. */
  reason = "";
  /** The press drove before it was spent; otherwise it never drove. */
  drove = false;
  held = false;
  /** The pressed source, also if its press is spent. */
  source = null;
  #connection;
  #whyNot;
  #number = 0;
  #sentAt = -Infinity;
  #tickedAt = 0;

  /** `whyNot()` returns why nothing may drive now, or an empty text. */
  constructor(connection, whyNot) {
    this.#connection = connection;
    this.#whyNot = whyNot;
    setInterval(() => this.#tick(), PERIOD_MS);
    window.addEventListener("blur", () => this.spend("the window lost the focus"));
    window.addEventListener("pagehide", () => this.spend("the page was left"));
    window.addEventListener("contextmenu", (event) => event.defaultPrevented || this.spend("a menu opened"));
    document.addEventListener("freeze", () => this.spend("the browser stopped the page"));
    document.addEventListener("visibilitychange", () => document.hidden && this.spend("the page was hidden"));
  }

  /** Begins a press; returns whether it drives.  `source.command()` returns the speeds or the goal, or null. */
  begin(source) {
    if (this.held && this.source !== source) {
      notice("Another control is held: release it first.");
      return false;
    }
    if (this.source === source) return this.held;
    this.source = source;
    this.#number += 1;
    this.#tickedAt = performance.now();
    this.why = document.hidden ? "the page is hidden" : this.#whyNot();
    this.reason = "";
    this.held = this.drove = !this.why;
    this.#send();
    this.changed();
    return this.held;
  }

  /** Ends the press of a source. */
  end(source) {
    if (source !== this.source) return;
    this.source = null;
    this.held = false;
    this.why = "";
    this.#send();
    this.changed();
  }

  /** Ends what is held until it is released and pressed again. */
  spend(why, reason = "") {
    if (!this.held) return;
    this.held = false;
    this.why = why;
    this.reason = reason;
    this.#send();
    this.changed();
  }

  /** Answers the helm's state: presses up to a number are spent.  Without an answer the server lets no press count. */
  answer(spent, { why, reason }) {
    if (this.held && spent >= this.#number) this.spend(why || "the robot stopped", reason);
    else if (this.held && this.#whyNot()) this.spend(this.#whyNot());
    else this.#send();
  }

  #tick() {
    const now = performance.now();
    const late = now - this.#tickedAt;
    this.#tickedAt = now;
    if (this.held) {
      const quiet = this.#connection.quietMs;
      if (late > STALL_MS) this.spend(`this page was busy for ${Math.round(late)} ms`);
      else if (document.hidden) this.spend("the page is hidden");
      else if (quiet > QUIET_MS) this.spend("no data comes from the server");
      else if (this.#whyNot()) this.spend(this.#whyNot());
      else this.#send();
    } else if (now - this.#sentAt >= IDLE_MS) {
      this.#send();
    }
  }

  #send() {
    const command = this.held ? this.source.command() : null;
    if (this.held && !command) {
      this.spend("there is nothing to drive to");
      return;
    }
    this.#sentAt = performance.now();
    this.#connection.control({ press: this.#number, held: this.held, ...command });
  }
}
