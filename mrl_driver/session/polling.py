"""What a board is asked of its own accord, again and again: status, robot info, and what it does not stream."""

import math
from typing import Callable, Set

from mrl_driver.protocol.table import BY_NAME

from .handshake import Board
from .link_counters import Counters
from .sensor_polling import SensorPoll

STATUS_S = 0.5
"""Period of `read_status`; it also keeps the check value on, which ends after 2 s without a valid frame."""
INFO_S = 1.0
POLL_2013_S = 2.0
SONAR_2013_S = 0.3
BUSY_S = 3.0
"""A motion that was requested by itself, such as the calibration, is watched closely for so long, which feeds the
board's watchdog.
"""
INFO, STATUS, SONARS = (BY_NAME[n].code for n in ("robot_info", "read_status", "read_sonars"))


class Poll:
    """Asks from `begin` to `end`; `send(code)` puts a question on its way.

    Args:
        lead_s: what falls due within this time is asked together with what is due.
    """

    def __init__(self, send: Callable[..., None], counters: Counters, lead_s: float) -> None:
        self._send, self._counters, self._lead_s = send, counters, lead_s
        self.sensors = SensorPoll()
        self.due_s = -math.inf
        """No question is due before this time."""
        self._asked: Set[int] = set()
        self._status_s = self._info_s = self._sonar_s = math.inf
        self._info_period_s = INFO_S
        self._busy = False
        self._busy_until_s = -math.inf

    def begin(self, board: Board, now: float) -> None:
        """The board is greeted."""
        old = board.protocol < 2
        self._info_period_s = POLL_2013_S if old else INFO_S
        self._status_s = math.inf if old else now + STATUS_S
        self._info_s = now + self._info_period_s
        self.sensors.begin(board.capabilities, board.protocol, now)
        self.due_s = -math.inf

    def end(self) -> None:
        """Nothing more is asked, and no answer awaited."""
        self._asked.clear()
        self.sensors.end()
        self._status_s = self._info_s = self._sonar_s = math.inf

    def add_sonars(self, now: float) -> None:
        """The stream has no sonars."""
        if self._sonar_s == math.inf:
            self._sonar_s, self.due_s = now, -math.inf

    def hurry(self) -> None:
        """A motion begins that is fed by nothing but these questions."""
        if self._status_s < math.inf:
            self._busy, self._status_s, self.due_s = True, -math.inf, -math.inf

    def answered(self, code: int) -> None:
        """A frame of this code came."""
        self._asked.discard(code)
        self.due_s = -math.inf

    def take(self, now: float, quick_s: float) -> None:
        """Ask what is due; `quick_s` is the period of `read_status` during a motion that is fed by it."""
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
        """When to ask again.  A question whose answer is still missing at the next turn was lost."""
        self._counters.unanswered += code in self._asked
        self._asked.add(code)
        self._send(code)
        return max(now, due_s) + period_s
