"""Debian's Chromium without a screen, and its tabs.

One browser serves a whole module of tests.  It has an empty profile.  Nothing that it asks for leaves this computer: no
name resolves, and all but 127.0.0.1 would go through a proxy that does not exist.
"""

import contextlib
import os
import shutil
import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, NamedTuple, Tuple

from tests.waiting import PATIENCE_S, wait_until

if TYPE_CHECKING:
    from selenium.webdriver import Chrome

CHROMIUM, DRIVER = "/usr/bin/chromium", "/usr/bin/chromedriver"
SWITCHES = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--disable-extensions",
    "--disable-breakpad",
    "--disable-features=WebUIOmniboxPopup,WebUIOmniboxAimPopup",  # pages for the address line, half of all computing
    "--ignore-certificate-errors",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
    "--proxy-server=127.0.0.1:1",
)
PAD = """
window.pad = {id: "stubbed", index: 0, connected: true, mapping: "standard", timestamp: 0, axes: [0, 0, 0, 0],
  buttons: Array.from({length: 17}, () => ({pressed: false, touched: false, value: 0}))};
navigator.getGamepads = () => {
  window.pad.timestamp = performance.now();
  return [window.pad.connected ? window.pad : null, null, null, null];
};
"""
"""A gamepad for a page: the test writes what it does into `window.pad`."""
ASKED = """
window.sockets = [];
window.WebSocket = class extends WebSocket { constructor(...all) { super(...all); window.sockets.push(this.url); } };
window.asked = () => [...performance.getEntries().filter(e => "transferSize" in e).map(e => e.name), ...window.sockets];
document.addEventListener("securitypolicyviolation", (event) => {
  document.documentElement.dataset.refused = event.blockedURI;
});
"""
"""What a page asks for: `window.asked()`; and what its server forbids it to ask for."""
NO_WEBSOCKET = """
window.WebSocket = class extends WebSocket { constructor() { super("wss://127.0.0.1:1/"); } };
"""
"""WebSockets fail, as where a browser does not accept the certificate for them."""
NO_PLACE = """
const Open = window.WebSocket;
window.WebSocket = class {
  static OPEN = Open.OPEN;
  constructor(...all) {
    if (window.free) return new Open(...all);
    setTimeout(() => {
      this.onmessage({data: JSON.stringify({type: "closed", at: 1, why: "16 pages show this robot", again: true})});
      this.onclose();
    });
  }
  close() {}
};
"""
"""Until `window.free` is true, the server has no place for the page."""
LOST_STOP = (
    NO_WEBSOCKET
    + """
const send = window.fetch;
window.fetch = (url, options) => {
  if (window.lost || !String(options?.body).includes('"stop"')) return send(url, options);
  window.lost = true;
  return Promise.reject(new TypeError("Failed to fetch"));
};
"""
)
"""The first STOP that the page sends by POST is lost, and its event stream goes on."""
RELEASED = """
const read = JSON.parse;
JSON.parse = (text) => ({...read(text), latched: true, released_by_other: true});
"""
"""The server says that another program has released a page's emergency stop."""
_WAIT = """
const done = arguments[arguments.length - 1], holds = () => %s;
if (holds()) done(); else {
  const seen = new MutationObserver(() => { if (holds()) { seen.disconnect(); done(); } });
  seen.observe(document, {attributes: true, childList: true, characterData: true, subtree: true});
}
"""


class Size(NamedTuple):
    """A window [px]; a phone is touched, a desk has a mouse."""

    width: int
    height: int
    touch: bool


PHONE, DESK, PROJECTOR = Size(360, 740, True), Size(1280, 800, False), Size(1920, 1080, False)


class Browser:
    """Chromium until `close`; what it downloads goes to the folder `downloads`."""

    def __init__(self, folder: Path) -> None:
        from selenium.webdriver import Chrome, ChromeOptions, ChromeService  # slow to import

        for program in (CHROMIUM, DRIVER):
            assert shutil.which(program), (
                f"{program} is not installed, expected Debian's packages chromium and chromium-driver: run make setup"
            )
        self.downloads, profile = folder / "downloads", folder / "profile"
        self.downloads.mkdir()
        options = ChromeOptions()
        options.binary_location = CHROMIUM
        for switch in (*SWITCHES, f"--user-data-dir={profile}"):
            options.add_argument(switch)
        service = ChromeService(executable_path=DRIVER, log_output=str(folder / "chromedriver.log"))
        self._web = Chrome(options=options, service=service)
        self._web.set_script_timeout(PATIENCE_S)
        self._driver_pid = service.process.pid
        self._pids = _below(self._driver_pid)
        self._first = self._web.current_window_handle

    def open(self, url: str = "about:blank", size: Size = DESK, before: str = "") -> "Tab":
        """A new tab in a window of its own; the script `before` runs before those of the page."""
        self._web.switch_to.window(self._first)
        self._web.switch_to.new_window("window")
        tab = Tab(self._web, self._web.current_window_handle)
        metrics = {"width": size.width, "height": size.height, "deviceScaleFactor": 1, "mobile": size.touch}
        tab.tell("Emulation.setDeviceMetricsOverride", **metrics)
        tab.tell("Emulation.setTouchEmulationEnabled", enabled=size.touch, maxTouchPoints=5)
        tab.tell("Emulation.setFocusEmulationEnabled", enabled=True)
        tab.tell("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(self.downloads))
        if before:
            tab.tell("Page.addScriptToEvaluateOnNewDocument", source=before)
        if url != "about:blank":
            tab.load(url)
        return tab

    @property
    def processes(self) -> List[int]:
        """Ids of all its processes, its driver's not among them."""
        return _below(self._driver_pid)

    @contextlib.contextmanager
    def frozen(self) -> Iterator[None]:
        """All its processes are stopped by SIGSTOP for the length of a `with` block."""
        stopped = self.processes
        try:
            for pid in stopped:
                os.kill(pid, signal.SIGSTOP)
            yield
        finally:
            for pid in reversed(stopped):
                os.kill(pid, signal.SIGCONT)

    def close(self) -> None:
        """Ends it and all its processes."""
        pids = {*self._pids, *self.processes}
        try:
            self._web.quit()
            wait_until(lambda: not any(map(_runs, pids)), what="the end of Chromium")
        finally:
            for pid in filter(_runs, pids):
                os.kill(pid, signal.SIGKILL)


class Tab:
    """A tab in a window of its own."""

    def __init__(self, web: "Chrome", handle: str) -> None:
        self._web, self._handle, self._touched = web, handle, False

    def _look(self) -> "Chrome":
        """Turns the driver to this tab; the browser does not notice."""
        self._web.switch_to.window(self._handle)
        return self._web

    def load(self, url: str) -> None:
        """Loads a page."""
        self._look().get(url)

    def tell(self, method: str, **parameters: Any) -> Any:
        """A command of the Chrome DevTools Protocol, and its result."""
        return self._look().execute_cdp_cmd(method, parameters)

    def run(self, script: str, *args: Any) -> Any:
        """What a JavaScript function body returns."""
        return self._look().execute_script(script, *args)

    def wait(self, condition: str) -> None:
        """Waits until a JavaScript expression about the document is true; looks at each change of the document."""
        try:
            self._look().execute_async_script(_WAIT % condition)
        except Exception as error:
            said = self.run("return [{...document.documentElement.dataset}, document.body.innerText]")
            raise AssertionError(f"{condition}: not within {PATIENCE_S:g} s, the page has {said}") from error

    def centre(self, element: str) -> Tuple[float, float]:
        """Centre of an element, by its id, scrolled into sight [px of the window]."""
        script = (
            "const e = document.getElementById(arguments[0]);"
            "e.scrollIntoView({block: 'nearest'});"
            "const b = e.getBoundingClientRect(); return [b.left + b.width / 2, b.top + b.height / 2];"
        )
        x, y = self.run(script, element)
        return x, y

    def touch(self, *points: Tuple[float, float]) -> None:
        """A finger is put down at the first point, unless it is down, and moved to the others."""
        for x, y in points:
            kind = "touchMove" if self._touched else "touchStart"
            self.tell("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y}])
            self._touched = True

    def lift(self) -> None:
        """The finger is lifted, if it is down."""
        if self._touched:
            self.tell("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
        self._touched = False

    def mouse(self, kind: str, element: str) -> None:
        """The mouse is pressed (`mousePressed`) on the centre of an element, or released there (`mouseReleased`)."""
        x, y = self.centre(element)
        self.tell("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def press(self, element: str) -> None:
        """An element, by its id or a selector, gets the focus and the Enter key: it may move meanwhile."""
        self.run(
            "(document.getElementById(arguments[0]) || document.querySelector(arguments[0])).focus();",
            element,
        )
        self.type("Enter")

    def key(self, kind: str, name: str, **more: Any) -> None:
        """A key is pressed (`keyDown`) or released (`keyUp`): a letter, or a name as `ArrowUp`."""
        code, number = _KEYS[name]
        text = {"text": "\r"} if name == "Enter" and kind == "keyDown" else {}
        self.tell(
            "Input.dispatchKeyEvent",
            type=kind,
            key=name,
            code=code,
            windowsVirtualKeyCode=number,
            **text,
            **more,
        )

    def type(self, name: str) -> None:
        """A key is pressed and released."""
        self.key("keyDown", name)
        self.key("keyUp", name)

    @contextlib.contextmanager
    def hidden(self) -> Iterator[None]:
        """Its window is minimised for the length of a `with` block.

        At other times each page takes itself for the one in use, in whatever window.
        """
        self.tell("Emulation.setFocusEmulationEnabled", enabled=False)
        window = self.tell("Browser.getWindowForTarget")["windowId"]
        self.tell("Browser.setWindowBounds", windowId=window, bounds={"windowState": "minimized"})
        try:
            yield
        finally:
            self.tell("Browser.setWindowBounds", windowId=window, bounds={"windowState": "normal"})
            self.tell("Emulation.setFocusEmulationEnabled", enabled=True)

    def picture(self, file: Path) -> None:
        """A screenshot."""
        self._look().save_screenshot(str(file))

    def close(self) -> None:
        """Closes it, as a user does."""
        self._look().close()


_KEYS: Dict[str, Tuple[str, int]] = {
    **{letter: (f"Key{letter.upper()}", ord(letter.upper())) for letter in "wasd"},
    **{f"Arrow{way}": (f"Arrow{way}", 37 + at) for at, way in enumerate(("Left", "Up", "Right", "Down"))},
    "Tab": ("Tab", 9),
    "Enter": ("Enter", 13),
    "Escape": ("Escape", 27),
    " ": ("Space", 32),
}


def _below(pid: int) -> List[int]:
    """Ids of the processes that this one has started, and of theirs, in this order."""
    children: Dict[int, List[int]] = {}
    for each in map(int, filter(str.isdigit, os.listdir("/proc"))):
        children.setdefault(_parent(each), []).append(each)
    found = list(children.get(pid, ()))
    for each in found:
        found += children.get(each, ())
    return found


def _stat(pid: int) -> List[str]:
    """Fields of /proc/PID/stat from the state on; empty without such a process."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except (FileNotFoundError, ProcessLookupError):
        return []


def _parent(pid: int) -> int:
    return int((_stat(pid) or ["", "0"])[1])


def _runs(pid: int) -> bool:
    """Whether a process has not ended."""
    return (_stat(pid) or ["X"])[0] not in "XZ"
