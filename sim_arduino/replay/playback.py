"""Plays the board's side of a recording on a virtual port, from its start for each program that opens the port.

While a program greets the board, each reply waits for its request.  From the first stream on, all bytes come at their
recorded time.
"""

import os
import re
import select
import time
from typing import Callable, List, Optional

from mrl_driver.protocol.table import BY_CODE, WRAP
from mrl_driver.recording.recording import FROM_BOARD, TO_BOARD, Entry, Recording
from sim_arduino.serve.pty import PtyPort
from sim_arduino.serve.socket_port import read_all

POLL_S = 0.02
QUIET_POLLS = 5
LISTENER_S = 1.0  # a program that has not sent the recorded request within this time counts as a listener
MOST_ASKED = 100
_REQUEST = re.compile(rb"@([0-9]{1,5})[,e]")


class Left(Exception):
    """The program closed the port."""


class Audience:
    """The programs that open a port, one after the other.

    Requests are handled in order, so that the last requests of one program do not count as the next one's greeting.
    """

    def __init__(self, port: PtyPort) -> None:
        self._port = port
        self._next = False
        """Another program opened the port when the last one closed it."""
        self._listens = False
        self._unread = b""
        self._asked: List[int] = []

    def await_program(self) -> None:
        """Returns when a program has opened the port."""
        while not self._next and self._port.watch is not None:
            select.select([self._port.watch], [], [], POLL_S)
            self._next = self._port.newly_opened()
        self._next, self._listens = False, False

    def await_question(self, code: int) -> None:
        """Returns when the program has sent this request, or counts as a listener; Left if it closed the port."""
        end_s = time.monotonic() + LISTENER_S
        while code not in self._asked and not self._listens:
            self._listens = time.monotonic() >= end_s
            self.wait(POLL_S)
        if not self._listens:
            del self._asked[: self._asked.index(code) + 1]

    def wait(self, seconds: float) -> None:
        """Waits for this time, or until the program sends bytes; raises Left if the program closed the port."""
        watched = [each for each in (self._port.master, self._port.watch) if each is not None]
        select.select(watched, [], [], seconds)
        self._listen()

    def give(self, data: bytes) -> None:
        """Sends all of `data`, at the speed at which the program reads; raises Left if the program closed the port."""
        self._listen()
        while data and self._port.master is not None:
            if select.select([], [self._port.master], [], POLL_S)[1]:
                data = data[os.write(self._port.master, data) :]
            self._listen()

    def drain(self) -> None:
        """Waits until the program has read all bytes or closed the port; closing the port would lose the rest.

        The system refills its read buffer from further buffers, so the buffer must stay empty for some time.
        """
        quiet = 0
        while self._port.is_open and quiet < QUIET_POLLS:
            quiet = 0 if self._port.unread() else quiet + 1
            time.sleep(POLL_S)
            self._port.newly_opened()

    def _listen(self) -> None:
        """Reads before it checks for another program, so that requests of that program never count for this one."""
        self._unread += read_all(self._port)
        found = list(_REQUEST.finditer(self._unread))
        self._asked = (self._asked + [int(each.group(1)) % WRAP for each in found])[-MOST_ASKED:]
        self._unread = self._unread[found[-1].end() if found else 0 :][-8:]
        self._next = self._port.newly_opened()
        if self._next or not self._port.is_open:
            raise Left


def play(recording: Recording, port: PtyPort, speed: float, tell: Callable[[str], None]) -> None:
    """Plays until a program has received the whole recording; `tell` gets a message if one leaves earlier."""
    audience = Audience(port)
    while port.plugged:
        audience.await_program()
        try:
            _play_once(recording, audience, speed)
            break
        except Left:
            tell(f"the program closed the port; another one gets {recording.path} from its start")
    audience.drain()


def _play_once(recording: Recording, audience: Audience, speed: float) -> None:
    clock, greets = ReplayPace(speed, audience.wait), True
    for entry in recording:
        if entry.direction == TO_BOARD and greets:
            for code in _answered(entry):
                audience.await_question(code)
                greets = greets and not BY_CODE[code].repeats
            clock.resume(entry.time_s)
        elif entry.direction == FROM_BOARD:
            clock.await_time(entry.time_s)
            audience.give(entry.data)


def _answered(entry: Entry) -> List[int]:
    """Codes of the requests in the entry that the board replies to."""
    rows = (BY_CODE.get(int(each.group(1)) % WRAP) for each in _REQUEST.finditer(entry.data))
    return [row.code for row in rows if row and (row.reply or row.repeats)]


class ReplayPace:
    """The timing of a replay, `speed` times as fast as the recording."""

    def __init__(self, speed: float, wait: Callable[[float], None]) -> None:
        self._speed, self._wait = speed, wait
        self._start_s: Optional[float] = None

    def resume(self, time_s: float) -> None:
        """Makes now the moment that was recorded at `time_s`."""
        self._start_s = time.monotonic() - time_s / self._speed

    def await_time(self, time_s: float) -> None:
        """Returns when `time_s` of the recording is due; the first call returns at once."""
        if self._start_s is None:
            self.resume(time_s)
        assert self._start_s is not None
        due_s = self._start_s + time_s / self._speed
        while due_s > time.monotonic():
            self._wait(due_s - time.monotonic())
