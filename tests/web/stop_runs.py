"""A finger holds the page's joystick, something goes wrong, and the motors stop: how long after the last fresh command.

The fresh commands are what passes the proxy between browser and server; the motors are those of the emulated board.
"""

import contextlib
import signal
import time
from typing import Callable, ContextManager, Dict, Iterator, NamedTuple

from tests.driver.emulator import MOVE, STOP
from tests.waiting import wait_until

from .browser import PHONE, Browser
from .robot_page import RobotPage
from .served import Served

COMMANDS = 3  # So many commands pass before something goes wrong


class StopTime(NamedTuple):
    """When the motors stopped [s]."""

    after_command_s: float  # After the last command that passed
    after_fault_s: float


class StopRuns:
    """A page on a phone, and the robot that it drives, in real time."""

    def __init__(self, browser: Browser, served: Served) -> None:
        self.browser, self.served = browser, served
        self.page = RobotPage(browser, served.links[0], PHONE).take()
        self.faults: Dict[str, Callable[[], ContextManager[float]]] = {
            "finger lifted": self._lifted,
            "tab hidden": self._hidden,
            "browser stopped": self._frozen,
            "socket stalled": self._stalled,
            "server killed": self._killed,
            "server stopped": self._stopped,
        }

    def measure(self, fault: str, further: int = 0) -> StopTime:
        """Drives, lets the fault happen until the motors stop, and sees that so many further messages move nothing.

        Raises:
            AssertionError: the robot moved again although the finger was not lifted.
        """
        robot = self.served.robot
        while True:
            self._drive()
            moved_s = robot.times(MOVE)[-1]
            with self.faults[fault]() as fault_s:
                stopped_s = robot.wait_for(STOP, moved_s)
            if stopped_s > fault_s:
                break
            self._rest()  # a busy computer was late before: the robot has stopped for that
        self._sees_no_motion(stopped_s, further)
        self._rest()
        command_s = max(at for at, _ in self.served.proxy.sent if at <= fault_s)
        return StopTime(stopped_s - command_s, stopped_s - fault_s)

    def _drive(self) -> None:
        """A finger holds the joystick, and the robot moves."""
        self.page.take()
        sent = len(self.served.proxy.sent)
        self.page.push_until(
            lambda: self.served.robot.moves and len(self.served.proxy.sent) >= sent + COMMANDS
        )

    def _rest(self) -> None:
        """The finger is lifted, and the page knows that it was."""
        self.page.tab.lift()
        self.page.arrive().wait(held="no", spent="no")

    def _sees_no_motion(self, since_s: float, further: int) -> None:
        self.page.arrive()
        sent = len(self.served.proxy.sent)
        wait_until(lambda: len(self.served.proxy.sent) >= sent + further)
        assert not self.served.robot.times(MOVE, since_s), "it moved again"

    # Each fault gives the time after which no further command counts.

    @contextlib.contextmanager
    def _lifted(self) -> Iterator[float]:
        now_s = time.monotonic()
        self.page.tab.lift()
        yield now_s

    @contextlib.contextmanager
    def _hidden(self) -> Iterator[float]:
        now_s = time.monotonic()
        with self.page.tab.hidden():
            yield now_s

    @contextlib.contextmanager
    def _frozen(self) -> Iterator[float]:
        with self.browser.frozen():
            yield time.monotonic()

    @contextlib.contextmanager
    def _stalled(self) -> Iterator[float]:
        self.served.proxy.flows.clear()
        try:
            yield time.monotonic()
        finally:
            self.served.proxy.flows.set()

    @contextlib.contextmanager
    def _killed(self) -> Iterator[float]:
        self.served.signal(signal.SIGKILL)
        yield time.monotonic()
        self.served.process.wait()
        self.served.start()

    @contextlib.contextmanager
    def _stopped(self) -> Iterator[float]:
        self.served.signal(signal.SIGSTOP)
        try:
            yield time.monotonic()
        finally:
            self.served.signal(signal.SIGCONT)
