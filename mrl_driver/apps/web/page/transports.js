/** The two ways of messages: over a WebSocket; or by POST and an event stream, for browsers and networks that refuse WebSockets. */

const MOST_IN_FLIGHT = 2;
const POST_MS = 1000;
/** Bytes that may wait in the browser before a held control is left out: it would only arrive too old. */
const MOST_WAITING = 600;

export class SocketTransport {
  static title = "WebSocket";
  static id = "websocket";
  phonePeriodMs = 20;
  #socket;

  /** `events` has `message(text)` and `ended(refused)`: why the server refuses this page, or empty. */
  constructor(hello, events) {
    const url = new URL("ws", location.href);
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    url.hash = "";
    this.#socket = new WebSocket(url);
    this.#socket.onopen = () => this.send(hello);
    this.#socket.onmessage = (event) => events.message(event.data);
    this.#socket.onclose = () => events.ended("");
  }

  send(message) {
    if (this.#socket.readyState !== WebSocket.OPEN) return false;
    this.#socket.send(JSON.stringify(message));
    return true;
  }

  control(message) {
    if (message.held && this.#socket.bufferedAmount > MOST_WAITING) return false;
    return this.send(message);
  }

  /** Sends a message that may be lost. */
  lossy(message) {
    return this.#socket.bufferedAmount === 0 && this.send(message);
  }

  close() {
    this.#socket.close();
  }
}

export class PostTransport {
  static title = "event stream";
  static id = "events";
  phonePeriodMs = 100;
  #abort = new AbortController();
  #headers;
  #events;
  #session = "";
  #inFlight = 0;
  #newest = null;
  #sendsLossy = false;
  #last = Promise.resolve();

  /** `events` has `message(text)` and `ended(refused)`: why the server refuses this page, or empty. */
  constructor(hello, events) {
    this.#events = events;
    this.#headers = { "Content-Type": "application/json" };
    if (hello.token) this.#headers.Authorization = `Bearer ${hello.token}`;
    this.#run(hello).then(
      (refused) => events.ended(refused),
      () => events.ended(""),
    );
  }

  async #run(hello) {
    const { signal } = this.#abort;
    const body = JSON.stringify(hello);
    const reply = await fetch("session", { method: "POST", headers: this.#headers, body, signal });
    if (reply.status >= 400 && reply.status < 500) return wordsOf(reply);
    if (reply.status === 503) this.#events.message(await reply.text()); // why there is no place now
    if (!reply.ok) return "";
    this.#session = `session/${encodeURIComponent((await reply.json()).session)}`;
    const stream = await fetch(`${this.#session}/events`, { headers: this.#headers, cache: "no-store", signal });
    if (stream.ok) await this.#read(stream.body.getReader());
    return "";
  }

  async #read(reader) {
    const decoder = new TextDecoder();
    for (let rest = ""; ; ) {
      const { done, value } = await reader.read();
      if (done) return;
      const events = (rest + decoder.decode(value, { stream: true })).split(/\r?\n\r?\n/);
      rest = events.pop();
      for (const event of events) {
        const data = event.split(/\r?\n/).filter((line) => line.startsWith("data:"));
        if (data.length) this.#events.message(data.map((line) => line.slice(5).trimStart()).join("\n"));
      }
    }
  }

  /** Sends a message after those before it; a stop at once, because requests that wait must not delay it. */
  send(message) {
    if (!this.#session || this.#abort.signal.aborted) return false;
    if (message.type === "stop") this.#post(message);
    else this.#last = this.#last.then(() => this.#post(message));
    return true;
  }

  /** Sends a control message; while two are in flight only the newest waits. */
  control(message) {
    if (!this.#session) return false;
    if (this.#inFlight >= MOST_IN_FLIGHT) {
      this.#newest = message;
      return true;
    }
    this.#inFlight += 1;
    this.#post(message).finally(() => {
      this.#inFlight -= 1;
      const next = this.#newest;
      this.#newest = null;
      if (next) this.control(next);
    });
    return true;
  }

  /** Sends a message that may be lost. */
  lossy(message) {
    if (this.#sendsLossy || !this.#session) return false;
    this.#sendsLossy = true;
    this.#post(message).finally(() => (this.#sendsLossy = false));
    return true;
  }

  async #post(message) {
    const timeout = new AbortController();
    const timer = setTimeout(() => timeout.abort(), POST_MS);
    try {
      const body = JSON.stringify(message);
      const request = { method: "POST", headers: this.#headers, body, keepalive: true, signal: timeout.signal };
      const reply = await fetch(this.#session, request);
      if ([401, 403, 404, 410].includes(reply.status)) this.close(); // the session has ended
    } catch {
      // the event stream shows whether the link is lost
    } finally {
      clearTimeout(timer);
    }
  }

  close() {
    this.#abort.abort();
  }
}

async function wordsOf(reply) {
  const text = await reply.text();
  try {
    return JSON.parse(text).why || text;
  } catch {
    return text || `the server answered ${reply.status}`;
  }
}
