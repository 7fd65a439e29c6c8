"""The numbers of a robot as JSON for other programs, such as PlotJuggler: one object for each telemetry.  No I/O.

An object is flat.  `timestamp` is the time of the measurement [s since 1970], and the keys are the names of `Series`
with the unit behind them: `x_m`, `asked_speed_m_s`, `sonar_front_m`.  A value that is not known, or infinite, is null.
"""

import json
import math
from typing import TYPE_CHECKING, Any, Callable, List

from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.events import SensorRead

from .series import Name, Series
from .shown_state import has_motors

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

DIGITS = 6  # digits behind the decimal point; the timestamp has microseconds
LONGEST = 1400
"""Longest JSON text [byte]; networks do not split a datagram of this length.  PlotJuggler for Linux reads 2048."""
LOOK_S = 1.0
"""The stream notices within this time that the robot has other values, such as those of another sensor [s]."""
_OF_TELEMETRY = ("pose", "twist", "ranges")
_MARGIN = 2  # bytes of the last brace and of a comma


def key(name: Name) -> str:
    """Return the key of a value, such as `turn_rate_rad_s`; degrees Celsius are `c`, as in the driver's names."""
    title, unit = name
    return f"{title} {unit.replace('degC', 'c').replace('/', ' ')}".strip().replace(" ", "_").lower()


class LiveJson:
    """Sends JSON texts of at most `LONGEST` bytes while a driver is connected; `send` must not block its thread.

    A robot with more values than fit gets several texts for each telemetry, with the same timestamp.  A board without
    motors has no telemetry: it gets an object for each answer of a sensor.  `ahead_s` is the difference of the wall
    clock and the driver's clock [s].  It stays the same, so that the timestamps have no gap if the wall clock is set.
    """

    def __init__(self, driver: "Driver", send: Callable[[bytes], None], ahead_s: float) -> None:
        self._send, self._ahead_s = send, ahead_s
        self._robot = AtTelemetry(driver)
        self._look_s = -math.inf
        self._take_names()
        if has_motors(driver.model):
            driver.on_telemetry(self._on_telemetry)
        else:
            driver.on(SensorRead, lambda read: self._tell(read.reading.stamp_s))

    def _take_names(self) -> None:
        self._series = Series(self._robot)
        self._keys = [json.dumps(key(name)) for name in self._series.names]

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        self._robot.telemetry = telemetry
        self._tell(telemetry.stamp_s)

    def _tell(self, stamp_s: float) -> None:
        if stamp_s >= self._look_s:
            self._look_s = stamp_s + LOOK_S
            if self._series.outdated():
                self._take_names()
        for text in texts(self._ahead_s + stamp_s, self._keys, self._series.values()):
            self._send(text)


def texts(timestamp_s: float, keys: List[str], values: List[float]) -> List[bytes]:
    """Return one JSON text, or several if the values do not fit into `LONGEST` bytes; `keys` are JSON strings."""
    head = f'{{"timestamp":{round(timestamp_s, DIGITS)}'
    found, text = [], head
    for name, value in zip(keys, values):
        part = f",{name}:{round(value, DIGITS) if math.isfinite(value) else 'null'}"
        if len(text) + len(part) > LONGEST - _MARGIN:
            found.append(text)
            text = head
        text += part
    return [f"{each}}}".encode() for each in (*found, text)]


class AtTelemetry:
    """A driver whose motion and ranges are those of one telemetry, although newer frames may have arrived with it."""

    def __init__(self, driver: "Driver") -> None:
        self._driver, self.telemetry = driver, driver.telemetry

    def __getattr__(self, name: str) -> Any:
        then = self.telemetry if name in _OF_TELEMETRY else None
        return getattr(self._driver if then is None else then, name)
