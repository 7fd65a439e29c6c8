/** Messages over a WebSocket. */

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
