"""The live view of a robot in the terminal, with keys to drive."""

import contextlib
import math
import sys
import time
from typing import TYPE_CHECKING, Any, Callable, Iterator, List, NamedTuple, Optional, Tuple, Union

from mrl_driver.errors import BoardTimeout
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.safety.operator_delay import MAX_DELAY_S, DelayGuard
from mrl_driver.session.events import ImuChanged, Lost, PathUnknown, Reconnected, Slowed
from mrl_driver.view.shown_state import ShownState, has_motors, moves_sideways, state_of
from mrl_driver.view.trail import Trail

from .frame_log import FrameLog
from .keyboard import Keyboard, NoKeyboard
from .teleop_keys import Teleop

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

    from .live_panels import Shown

TICK_S, REFRESH_S = 0.05, 0.1
NO_MOTORS = "this board has no motors: no driving"


class Rate:
    """Frames per second over the last second."""

    def __init__(self) -> None:
        self._seen: List[Tuple[float, int]] = []

    def update(self, frames: int, now_s: float) -> float:
        """Return the rate from the number of frames so far [Hz]."""
        self._seen = [each for each in self._seen if now_s - each[0] <= 1.0][-20:]
        self._seen.append((now_s, frames))
        (first_s, first), (last_s, last) = self._seen[0], self._seen[-1]
        return (last - first) / (last_s - first_s) if last_s > first_s else 0.0


class Settings(NamedTuple):
    """Settings of the live view at its start."""

    port: str = ""
    record: str = ""
    """File of the recording; empty without one."""
    keys_drive: bool = False
    """The keys drive from the start; otherwise the user must press Enter first."""
    ignore_battery: bool = False
    max_delay_s: float = MAX_DELAY_S
    """The keys do not drive above this delay from a key press to the board; 0 for no limit."""


class Screen:
    """The state of the live view: handles keys, drives the robot, and returns what to show.

    `driver` is a Driver, or has the attributes of one that this class uses; then a subclass has its own `state`.
    """

    keys: Tuple[Tuple[str, str], ...] = (("f", "frames"),)
    """Further keys, and what they do."""

    def __init__(
        self,
        driver: Any,
        settings: Settings,
        log: Optional[FrameLog],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._clock, self._guard = clock, DelayGuard(settings.max_delay_s, "--max-delay")
        self._pressed_s: Optional[float] = None
        self._key_s = math.nan
        self._driver, self._settings, self._log = driver, settings, log
        self.trail, self._rate, self._teleop = Trail(), Rate(), Teleop()
        self._keys_drive, self._shows_log, self._notice = settings.keys_drive, True, driver.warning
        self._start_s = clock()
        self.frames = 0
        self._moves = has_motors(driver.model)
        self.ended = False
        driver.on_telemetry(self._on_telemetry)
        driver.on_event(self._on_event)

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        self.frames += 1
        self.trail.add(telemetry.pose)

    def _on_event(self, event: object) -> None:
        if isinstance(event, (Lost, Reconnected, Slowed, PathUnknown, ImuChanged)):
            self._notice = str(event)

    def press(self, key: str, now_s: float) -> None:
        """Handle a key that was pressed at `now_s`."""
        if key in ("q", "escape"):
            self.ended = True
        elif key in ("\r", "\n"):
            self._toggle_keys()
        elif key == "f":
            self._shows_log = not self._shows_log
        elif key == "c":
            self.trail.clear()
        elif key == "space":
            self._teleop.press(key, now_s)
            self._notice = ""
            try:
                self._driver.stop()
            except BoardTimeout as error:  # the driver goes on looking for the board
                self._notice = str(error)
        elif self._keys_drive:
            if self._teleop.press(key, now_s) and self._pressed_s is None:
                self._pressed_s = now_s
        elif self._teleop.moves(key, moves_sideways(self._driver.model)):
            motors = has_motors(self._driver.model)
            self._notice = "press Enter first to drive with the keys" if motors else NO_MOTORS

    def _toggle_keys(self) -> None:
        if not has_motors(self._driver.model):
            self._notice = NO_MOTORS
            return
        empty = self._driver.battery_state in ("empty", "off") and not self._settings.ignore_battery
        self._keys_drive = not self._keys_drive and not empty
        self._notice = f"the battery is {self._driver.battery_state}: no driving" if empty else ""

    def steer(self, now_s: float) -> None:
        """Drive at the speeds of the held keys; stop if no key is held."""
        wanted: Tuple[float, ...] = self._teleop.command(now_s) if self._keys_drive else ()
        if wanted and moves_sideways(self._driver.model):
            wanted = (*wanted, self._teleop.slide(now_s))
        if self._guard.may_drive(any(wanted), self.delays_s(now_s)[0]):
            self._driver.drive(*wanted)
        elif self._driver.command is not None:
            self._driver.stop()
        if self._pressed_s is not None:
            self._key_s, self._pressed_s = self._clock() - self._pressed_s, None

    def delays_s(self, now_s: float) -> Tuple[float, float, float]:
        """Return the operator's delay [s], and its parts: key press to written command, and the link.

        A part that is not known yet is NaN and does not count.
        """
        key_s = self._key_s if self._pressed_s is None else now_s - self._pressed_s
        link_s = self._driver.link_delay_s
        known = [part for part in (key_s, link_s) if not math.isnan(part)]
        return math.fsum(known) if known else math.nan, key_s, link_s

    def state(self) -> ShownState:
        """Return the robot's state now."""
        return state_of(self._driver)

    @property
    def _streamed(self) -> int:
        """Number of frames so far; boards without motors have no telemetry that could be counted."""
        count: int = self.frames if self._moves else self._driver.statistics.streamed
        return count

    def shown(self, now_s: float) -> "Shown":
        """Return what to show now."""
        from .live_panels import Shown

        mismatch, recorder = self._driver.mismatch, self._driver.recorder
        loss = recorder.loss if recorder is not None else ""
        return Shown(
            self.state(),
            self._settings.port,
            self._settings.record,
            bool(loss),
            now_s - self._start_s,
            self._rate.update(self._streamed, now_s),
            self.trail.poses,
            self.trail.distance_m,
            self._log.lines() if self._log and self._shows_log else None,
            self._keys_drive,
            f"{mismatch}; space goes on"
            if mismatch is not None
            else self._guard.reason or loss or self._notice,
            self.keys,
            now_s,
            self.delays_s(now_s),
        )


def show(driver: "Driver", settings: Settings, log: FrameLog, seconds: float) -> None:
    """Show the robot for `seconds`, or until `q`.

    Raises:
        MrlError: the driver failed; this is the error.
    """
    run(driver, Screen(driver, settings, log), seconds)


def run(driver: Any, screen: Screen, seconds: float = math.inf) -> None:
    """Show a screen until it has ended, for `seconds`, or until the driver's `wait` returns True."""
    from rich.console import Console
    from rich.live import Live

    from .live_panels import render

    console, start_s, shown_s = Console(), time.monotonic(), -math.inf
    live = Live(
        console=console, screen=True, auto_refresh=False, redirect_stdout=False, redirect_stderr=False
    )
    with _keyboard() as keyboard, live:
        while not screen.ended and time.monotonic() - start_s < seconds:
            for key in keyboard.read(TICK_S):
                screen.press(key, keyboard.pressed_s)
            now_s = time.monotonic()
            screen.steer(now_s)
            if now_s >= shown_s + REFRESH_S:
                shown_s = now_s
                live.update(render(screen.shown(now_s), console.width, console.height), refresh=True)
            if driver.wait(0):
                return


@contextlib.contextmanager
def _keyboard() -> Iterator[Union[Keyboard, NoKeyboard]]:
    """The keyboard of the terminal; without keys if stdin is not a terminal."""
    if not sys.stdin.isatty():
        yield NoKeyboard()
        return
    with Keyboard() as keyboard:
        yield keyboard
