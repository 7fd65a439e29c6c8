"""Periodic requests to the board: status, robot info, sensors, and sonars that are not in its stream."""

import math
from typing import Callable, Set

from mrl_driver.protocol.table import BY_NAME

from .handshake import Board
from .link_counters import Counters
from .sensor_polling import SensorPoll

STATUS_S = 0.5
"""Period of `read_status` [s].  It also keeps checksums on; they end after 2 s without a valid frame."""
INFO_S = 1.0
POLL_2013_S = 2.0
SONAR_2013_S = 0.3
BUSY_S = 3.0
"""After a motion request such as `calibrate`, the status is read more often for this time [s], to feed the board's
watchdog.
"""
INFO, STATUS, SONARS = (BY_NAME[n].code for n in ("robot_info", "read_status", "read_sonars"))


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
        self.due_s = -math.inf
        """No request is due before this time [s]."""
        self._asked: Set[int] = set()
        self._status_s = self._info_s = self._sonar_s = math.inf
        self._info_period_s = INFO_S
        self._busy = False
        self._busy_until_s = -math.inf

    def begin(self, board: Board, now: float) -> None:
        """Start: the board has been greeted."""
        old = board.protocol < 2
        self._info_period_s = POLL_2013_S if old else INFO_S
        self._status_s = math.inf if old else now + STATUS_S
        self._info_s = now + self._info_period_s
        self.sensors.begin(board.capabilities, board.protocol, now)
        self.due_s = -math.inf

    def end(self) -> None:
        """Stop: nothing more is requested, and no answer is expected."""
        self._asked.clear()
        self.sensors.end()
        self._status_s = self._info_s = self._sonar_s = math.inf

    def add_sonars(self, now: float) -> None:
        """Request the sonars as well, because the stream does not carry them."""
        if self._sonar_s == math.inf:
            self._sonar_s, self.due_s = now, -math.inf

    def hurry(self) -> None:
        """A motion begins during which only these requests feed the watchdog: read the status more often."""
        if self._status_s < math.inf:
            self._busy, self._status_s, self.due_s = True, -math.inf, -math.inf

    def answered(self, code: int) -> None:
        """A frame with this code arrived."""
        self._asked.discard(code)
        self.due_s = -math.inf

    def take(self, now: float, quick_s: float) -> None:
        """Send the requests that are due; `quick_s` is the period of `read_status` after `hurry` [s]."""
        if self._busy:
            self._busy, self._busy_until_s = False, now + BUSY_S
        soon = now + self._lead_s
        if soon >= self._status_s:
            period_s = quick_s if now < self._busy_until_s else STATUS_S
            self._status_s = self._ask(STATUS, self._status_s, now, period_s)
        if soon >= self._info_s:
            self._info_s = self._ask(INFO, self._info_s, now, self._info_period_s)
        if soon >= self._sonar_s:
            self._sonar_s = self._ask(SONARS, self._sonar_s, now, SONAR_2013_S)
        if soon >= self.sensors.next_s:
            for code in self.sensors.take(soon):
                self._send(code)
        self.due_s = min(self._status_s, self._info_s, self._sonar_s, self.sensors.next_s)

    def _ask(self, code: int, due_s: float, now: float, period_s: float) -> float:
        """Send a request and return when it is due again [s]; count the last one as lost if its answer is missing."""
        self._counters.unanswered += code in self._asked
        self._asked.add(code)
        self._send(code)
        return max(now, due_s) + period_s
