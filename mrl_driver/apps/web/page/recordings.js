/** Records, lists and downloads. */

import { notice } from "./announce.js";
import { element, make, setText } from "./text.js";

function sizeText(bytes) {
  if (bytes < 1000) return `${bytes} B`;
  return bytes < 1e6 ? `${(bytes / 1e3).toFixed(0)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
}

function timeText(seconds) {
  if (Number.isNaN(seconds)) return "";
  const whole = Math.max(0, Math.floor(seconds));
  return `, ${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

export class Recordings {
  #connection;
  #token;
  #on = false;
  #since = 0;
  #name = "";
  #loss = "";
  #shown = "";

  constructor(connection, token) {
    this.#connection = connection;
    this.#token = token;
    connection.on("recording", (message) => this.take(message));
    element("record").addEventListener("click", () => connection.send({ type: "record", on: !this.#on }));
    setInterval(() => this.#time(), 1000);
  }

  /** A new connection: whether this page may record, and the recordings so far. */
  welcome({ can_record: canRecord, recording, recordings }) {
    element("record").hidden = !canRecord;
    if (!canRecord) setText(element("recording-text"), "This link cannot record.");
    this.take({ on: Boolean(recording), name: recording ?? "", files: recordings ?? [] });
  }

  take({ on, name, seconds, loss, files }) {
    if (on !== undefined) {
      if (this.#on !== on && seconds !== undefined) notice(on ? "The recording has started." : "The recording has ended.");
      this.#on = on;
      this.#since = performance.now() - 1000 * (seconds ?? NaN);
      this.#name = name ?? "";
      this.#loss = loss ?? "";
      document.documentElement.dataset.recording = on ? "yes" : "no";
      setText(element("record"), on ? "Stop recording" : "Start recording");
      this.#time();
    }
    if (files) this.#list(files);
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
