"""Periodic requests to the board: status, robot info, holds by radio, inputs that stop it, sensors, sonars and
ranges that are not in its stream, and the stream of its IMU.
"""

import math
from typing import Callable, Dict, Set

from mrl_driver.protocol.table import BY_NAME

from .handshake import Board
from .link_counters import Counters
from .sensor_polling import BY_CODE, SensorPoll

STATUS_S = 0.5
"""Period of `read_status` [s].  It also keeps checksums on; they end after 2 s without a valid frame."""
INFO_S = 1.0
INPUTS_S = 0.1
"""Period of `read_inputs` [s], on boards that have some; the board stops by itself, and this tells where it was hit."""
POLL_2013_S = 2.0
SONAR_2013_S = 0.3
RANGES_S, RANGES_LOST_S = 0.06, 0.3
"""Time from a request of the HC-SR04 to the next, and to the next without an answer [s].  One fires every 60 ms."""
# After a motion request such as `calibrate`, the status is read more often for this time [s], to feed the board's
# watchdog.
BUSY_S = 3.0
IMU_S = 1.0
"""If the IMU's stream is silent for this time, it is started again [s]: a request may be lost on the line."""
LOST_S = 2.0  # without an answer for this time, a `robot_info` counts as lost and is sent again [s]
INFO, STATUS, SONARS, RANGES = (
    BY_NAME[n].code for n in ("robot_info", "read_status", "read_sonars", "read_ranges")
)
RADIO, INPUTS = (BY_NAME[n].code for n in ("read_radio", "read_inputs"))
START_IMU, STOP_IMU = (BY_NAME[n].code for n in ("start_imu_stream", "stop_imu_stream"))


class RoundTrip:
    """Time from a request to its answer.  The answer to a request that follows a lost one may be that of the lost one,
    and is not measured.

    Attributes:
        begun_s: time of the last request [s].
    """

    def __init__(self) -> None:
        self.begun_s = self._certain_s = -math.inf
        self._last_s = math.nan
        self._certain = False
        self._missed = 0

    def begin(self, now: float, certain: bool) -> None:
        """A request is sent; `certain` says that none before it waits for an answer."""
        if self._certain_s == -math.inf:
            self._certain_s = now
        self.begun_s, self._certain = now, certain
        self._missed += not certain

    def end(self, now: float) -> None:
        """The answer has arrived."""
        if self._certain:
            self._certain_s, self._last_s, self._missed = self.begun_s, now - self.begun_s, 0

    def delay_s(self, now: float) -> float:
        """The last round trip [s], NaN before the first; after two lost answers, the time since its request."""
        return now - self._certain_s if self._missed > 1 else self._last_s


class Poll:
    """Sends periodic requests from `begin` to `end`.

    Args:
        send: `send(code)` sends a request.
        counters: its `unanswered` counts lost requests.
        lead_s: requests due within this time are sent together with those already due [s].
    """

    def __init__(self, send: Callable[..., None], counters: Counters, lead_s: float) -> None:
        self._send, self._counters, self._lead_s = send, counters, lead_s
        self.sensors = SensorPoll()
        self.due_s = -math.inf  # no request is due before this time [s]
        self._next_s: Dict[int, float] = {}  # when each of the requests is due [s]
        self._period_s = {
            **{STATUS: STATUS_S, RADIO: STATUS_S, INFO: INFO_S},
            **{SONARS: SONAR_2013_S, INPUTS: INPUTS_S, RANGES: RANGES_LOST_S},
        }
        self._asked: Set[int] = set()
        self.imu_s = math.inf  # the IMU's stream is started then; `IMU_S` after its last frame [s]
        self._imu_period_ms = 0
        self._sonars = True
        self._busy = False
        self._busy_until_s = -math.inf
        self.round_trip = RoundTrip()

    def begin(
        self,
        board: Board,
        now: float,
        imu_period_ms: int,
        sensors_streamed: bool = False,
        sonars: bool = True,
    ) -> None:
        """Start: the board has been greeted.  Without `imu_period_ms` the stream of an IMU is stopped.

        `sensors_streamed` says that the telemetry is `SENSOR_STREAM`; without `sonars` they are never requested.
        """
        old = board.protocol < 2
        self._period_s[INFO] = POLL_2013_S if old else INFO_S
        self._next_s = {} if old else {STATUS: now + STATUS_S}
        if "hold" in board.capabilities:
            self._next_s[RADIO] = now
        if "wiring" in board.capabilities:
            self._next_s[INPUTS] = now
        self._next_s[INFO] = now + self._period_s[INFO]
        self.round_trip = RoundTrip()
        self._sonars = sonars
        self.sensors.begin(board.capabilities, board.protocol, now, sensors_streamed)
        if "imu" in board.capabilities:
            self._imu_period_ms = imu_period_ms
            self.imu_s = now if imu_period_ms else math.inf
            if not imu_period_ms:
                self._send(STOP_IMU)
        self.due_s = -math.inf

    def end(self) -> None:
        """Stop: nothing more is requested, and no answer is expected."""
        self._asked.clear()
        self._next_s.clear()
        self.sensors.end()
        self.imu_s = math.inf

    def add_sonars(self, now: float) -> None:
        """Request the sonars as well, because the stream does not carry them."""
        if self._sonars and SONARS not in self._next_s:
            self._next_s[SONARS], self.due_s = now, -math.inf

    def add_ranges(self, now: float) -> None:
        """Request the HC-SR04 as well."""
        self._next_s[RANGES], self.due_s = now, -math.inf

    def hurry(self) -> None:
        """A motion begins during which only these requests feed the watchdog: read the status more often."""
        if STATUS in self._next_s:
            self._busy, self._next_s[STATUS], self.due_s = True, -math.inf, -math.inf

    def ask_info(self) -> None:
        """Send `robot_info` soon, unless one may still be answered."""
        if INFO in self._next_s:
            self._next_s[INFO] = self.due_s = -math.inf

    def drop(self, code: int) -> None:
        """Request this no more until the next `begin`."""
        self._next_s.pop(code, None)

    def answered(self, code: int, now: float) -> None:
        """A frame with this code arrived."""
        if code == INFO and code in self._asked:
            self.round_trip.end(now)
        elif code == RANGES and code in self._asked:
            self._next_s[code], self.due_s = self._next_s[code] - RANGES_LOST_S + RANGES_S, -math.inf
        self._asked.discard(code)
        if code in BY_CODE:  # it may have been absent, and is asked more often from now on
            self.due_s = -math.inf

    def take(self, now: float, quick_s: float) -> None:
        """Send the requests that are due; `quick_s` is the period of `read_status` after `hurry` [s]."""
        if now + self._lead_s < self.due_s:
            return
        if self._busy:
            self._busy, self._busy_until_s = False, now + BUSY_S
        soon = now + self._lead_s
        self._period_s[STATUS] = quick_s if now < self._busy_until_s else STATUS_S
        for code, due_s in self._next_s.items():
            if soon >= due_s:
                self._next_s[code] = self._ask(code, due_s, now)
        if soon >= self.sensors.next_s:
            for code in self.sensors.take(soon):
                self._send(code)
        if now >= self.imu_s:
            self._send(START_IMU, self._imu_period_ms)
            self.imu_s = now + IMU_S
        self.due_s = min(self.sensors.next_s, self.imu_s, *self._next_s.values())

    def _ask(self, code: int, due_s: float, now: float) -> float:
        """Send a request and return when it is due again [s]; count the last one as lost if its answer is missing.

        The request of `INFO` measures the round trip: it waits while the last one may still be answered.
        """
        if code == INFO:
            lost_s = self.round_trip.begun_s + LOST_S
            if code in self._asked and now < lost_s:
                return lost_s
            self.round_trip.begin(now, certain=code not in self._asked)
        self._counters.unanswered += code in self._asked
        self._asked.add(code)
        self._send(code)
        return max(now, due_s) + self._period_s[code]
