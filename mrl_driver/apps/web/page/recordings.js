/** Records, lists and downloads. */

import { notice } from "./announce.js";
import { element, make, setText } from "./text.js";

function sizeText(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

function timeText(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  return `, ${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

export class Recordings {
  #connection;
  #token;
  #on = false;
  #known = false;
  #since = 0;
  #name = "";
  #loss = "";
  #shown = "";

  constructor(connection, token) {
    this.#connection = connection;
    this.#token = token;
    connection.on("recording", (message) => this.#take(message));
    element("record").addEventListener("click", () => connection.send({ type: "record", on: !this.#on }));
    setInterval(() => this.#time(), 1000);
  }

  /** A new connection: whether this page may record. */
  welcome({ role }) {
    const records = role === "drive";
    element("record").hidden = !records;
    if (!records) setText(element("recording-text"), "This link cannot record.");
  }

  #take({ on, name, seconds, loss, files }) {
    if (this.#on !== on && this.#known) notice(on ? "The recording has started." : "The recording has ended.");
    this.#on = on;
    this.#known = true;
    this.#since = performance.now() - 1000 * seconds;
    this.#name = name;
    this.#loss = loss;
    document.documentElement.dataset.recording = on ? "yes" : "no";
    setText(element("record"), on ? "Stop recording" : "Start recording");
    this.#time();
    this.#list(files);
  }

  #time() {
    const text = this.#on ? `Recording ${this.#name}${timeText((performance.now() - this.#since) / 1000)}.` : "";
    if (this.#on || this.#loss) setText(element("recording-text"), [text, this.#loss].filter(Boolean).join(" "));
    else if (!element("record").hidden) setText(element("recording-text"), "");
  }

  #list(files) {
    const shown = JSON.stringify(files);
    if (shown === this.#shown) return;
    this.#shown = shown;
    element("recordings").replaceChildren(
      ...files.map(({ name, size }) => {
        const row = make("li");
        const link = make("a", "", name);
        link.href = `recordings/${encodeURIComponent(name)}`;
        link.download = name;
        if (this.#token) link.addEventListener("click", (event) => this.#download(event, name, link.href));
        row.append(link, make("span", "", sizeText(size)));
        return row;
      }),
    );
  }

  /** Fetches a file with the token, which a plain link cannot send. */
  async #download(event, name, address) {
    event.preventDefault();
    try {
      const reply = await fetch(address, { headers: { Authorization: `Bearer ${this.#token}` } });
      if (!reply.ok) throw new Error(`the server answered ${reply.status}`);
      const link = make("a");
      link.href = URL.createObjectURL(await reply.blob());
      link.download = name;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    } catch (error) {
      notice(`${name} cannot be downloaded: ${error.message}.`);
    }
  }
}
