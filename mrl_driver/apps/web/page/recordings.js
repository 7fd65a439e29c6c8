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

/** Fetches a file with the token, which a plain link cannot send. */
async function download(name, address, token) {
  try {
    const reply = await fetch(address, { headers: { Authorization: `Bearer ${token}` } });
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

/** Returns what takes the welcome of each new connection: whether this page may record. */
export function recordings(connection, token) {
  let now = null; // the server's last message
  let since = 0;
  let listed = "";

  function show() {
    const time = now?.on ? `Recording ${now.name}${timeText((performance.now() - since) / 1000)}.` : "";
    const text = [time, now?.loss].filter(Boolean).join(" ");
    if (text || !element("record").hidden) setText(element("recording-text"), text);
  }

  function list(files) {
    const shown = JSON.stringify(files);
    if (shown === listed) return;
    listed = shown;
    const rows = files.map(({ name, size }) => {
      const row = make("li");
      const link = make("a", "", name);
      link.href = `recordings/${encodeURIComponent(name)}`;
      link.download = name;
      link.addEventListener("click", (event) => {
        if (!token) return;
        event.preventDefault();
        download(name, link.href, token);
      });
      row.append(link, make("span", "", sizeText(size)));
      return row;
    });
    element("recordings").replaceChildren(...rows);
  }

  connection.on("recording", (message) => {
    if (now && now.on !== message.on) notice(message.on ? "The recording has started." : "The recording has ended.");
    now = message;
    since = performance.now() - 1000 * message.seconds;
    document.documentElement.dataset.recording = message.on ? "yes" : "no";
    setText(element("record"), message.on ? "Stop recording" : "Start recording");
    show();
    list(message.files);
  });
  element("record").addEventListener("click", () => connection.send({ type: "record", on: !now?.on }));
  setInterval(show, 1000);
  return ({ role }) => {
    element("record").hidden = role !== "drive";
    if (role !== "drive") setText(element("recording-text"), "This link cannot record.");
  };
}
