"""The live view of a robot in the terminal, with keys to drive."""

import math
import time
from typing import TYPE_CHECKING, Any, Callable, NamedTuple, Optional, Tuple

from mrl_driver.clocks import clock_s
from mrl_driver.errors import BoardTimeout, MrlError
from mrl_driver.safety.operator_delay import MAX_DELAY_S, DelayGuard
from mrl_driver.view.live_model import LiveModel
from mrl_driver.view.shown_state import Shown, has_motors, moves_sideways, state_of

from .frame_log import FrameLog
from .keyboard import Keyboard
from .teleop_keys import Teleop

if TYPE_CHECKING:
    from .live_panels import Content

TICK_S, REFRESH_S = 0.05, 0.1
DRAWING = 0.2  # Share of a core that drawing takes at most: a small computer draws less often
STILL_PRESSED = "the emergency stop is still pressed, or its wire is broken"
NO_MOTORS = "this board has no motors: no driving"


class Settings(NamedTuple):
    """Settings of the live view at its start."""

    port: str = ""
    record: str = ""  # file of the recording; empty without one
    keys_drive: bool = False  # the keys drive from the start; otherwise the user must press Enter first
    ignore_battery: bool = False
    max_delay_s: float = MAX_DELAY_S
    """The keys do not drive above this delay from a key press to the board; 0 for no limit."""


class Screen:
    """The state of the live view: handles keys, drives the robot, and returns what to show.

    `driver` is a Driver, or has the attributes of one that this class uses; then a subclass has its own `state`.
    """

    keys: Tuple[Tuple[str, str], ...] = (("f", "frames"),)  # further keys, and what they do

    def __init__(
        self,
        driver: Any,
        settings: Settings,
        log: Optional[FrameLog],
        clock: Callable[[], float] = clock_s,
    ) -> None:
        self._clock, self._guard = clock, DelayGuard(settings.max_delay_s)
        self._pressed_s: Optional[float] = None
        self._key_s = math.nan
        self._driver, self._settings, self._log = driver, settings, log
        self.live, self._teleop = LiveModel(driver, clock(), self.state), Teleop()
        self.live.record = settings.record
        self._keys_drive, self._shows_log = settings.keys_drive, True
        self.ended = False

    def press(self, key: str, now_s: float) -> None:
        """Handle a key that was pressed at `now_s`."""
        if key in ("q", "escape"):
            self.ended = True
        elif key in ("\r", "\n"):
            self._toggle_keys()
        elif key == "f":
            self._shows_log = not self._shows_log
        elif key == "c":
            self.live.trail.clear()
        elif key == "space":
            self._teleop.press(key, now_s)
            self.live.notice = ""
            try:
                self._driver.stop()
            except BoardTimeout as error:  # the driver goes on looking for the board
                self.live.notice = str(error)
        elif key == "r" and self._keys_drive:
            self._release()
        elif self._keys_drive:
            if self._teleop.press(key, now_s) and self._pressed_s is None:
                self._pressed_s = now_s
        elif self._teleop.moves(key, moves_sideways(self._driver.model)):
            motors = has_motors(self._driver.model)
            self.live.notice = "press Enter first to drive with the keys" if motors else NO_MOTORS

    def _release(self) -> None:
        """Release the emergency stop of the board's input."""
        try:
            self.live.notice = "" if self._driver.release_emergency() else STILL_PRESSED
        except MrlError as error:
            self.live.notice = str(error)

    def _toggle_keys(self) -> None:
        if not has_motors(self._driver.model):
            self.live.notice = NO_MOTORS
            return
        empty = self._driver.battery_state in ("empty", "off") and not self._settings.ignore_battery
        self._keys_drive = not self._keys_drive and not empty
        self.live.notice = f"the battery is {self._driver.battery_state}: no driving" if empty else ""

    def steer(self, now_s: float) -> None:
        """Drive at the speeds of the held keys; stop if no key is held."""
        wanted: Tuple[float, ...] = self._teleop.command(now_s) if self._keys_drive else ()
        if wanted and moves_sideways(self._driver.model):
            wanted = (*wanted, self._teleop.slide(now_s))
        if self._guard.may_drive(any(wanted), self.live.delays_s(self._waited_s(now_s))[0]):
            self._driver.drive(*wanted)
        elif self._driver.command is not None:
            self._driver.stop()
        if self._pressed_s is not None:
            self._key_s, self._pressed_s = self._clock() - self._pressed_s, None

    def _waited_s(self, now_s: float) -> float:
        """Return the time from the last key press to its command [s], so far; NaN before the first."""
        return self._key_s if self._pressed_s is None else now_s - self._pressed_s

    def state(self) -> Shown:
        """Return the robot's state now."""
        return state_of(self._driver)

    def warning(self) -> str:
        """Return why the keys do not drive; empty if they may."""
        return self._guard.reason

    def shown(self, now_s: float) -> Shown:
        """Return what to show of the robot now."""
        return self.live.shown(now_s, self._waited_s(now_s), self.warning())

    def content(self, now_s: float) -> "Content":
        """Return the content of the screen now."""
        from .live_panels import Content

        return Content(
            self.shown(now_s),
            self._settings.port,
            self._log.lines() if self._log and self._shows_log else None,
            self._keys_drive,
            self.keys,
        )


def run(driver: Any, screen: Screen, seconds: float = math.inf) -> None:
    """Show a screen until it has ended, for `seconds`, or until the driver's `wait` returns True or raises."""
    from rich.console import Console
    from rich.live import Live

    from .live_panels import render

    console, start_s, due_s = Console(), clock_s(), -math.inf
    live = Live(
        console=console, screen=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
    )
    with Keyboard() as keyboard, live:
        while not screen.ended and clock_s() - start_s < seconds:
            for key in keyboard.read(TICK_S):
                screen.press(key, keyboard.pressed_s)
            now_s = clock_s()
            screen.steer(now_s)
            if now_s >= due_s:
                begun_s = time.thread_time()
                live.update(render(screen.content(now_s), console.width, console.height), refresh=True)
                due_s = now_s + max(REFRESH_S, (time.thread_time() - begun_s) / DRAWING)
            if driver.wait(0):
                return
