"""The chain of stops from the page to the motor board, link by link, in simulated time.

A page sends a command every 50 ms.  Then one thing fails, and the links that are left must stop the robot.  Time is
counted from the sending of the page's last fresh command to the stop at the motor board.
"""

import math
from collections import deque
from typing import Any, Deque, Iterable, List, NamedTuple, Sequence

from mrl_driver.apps.web.helm import Drive, Halt, Helm
from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from sim_arduino.serve import factory
from tests.driver.emulator import STOP

from .pages import Page

LIMIT_S = 0.3  # From the last fresh command to the stop at the motor outputs [s]
PERIOD_S, WAY_S = 0.05, 0.005  # Time between two messages of a page, and their way to the server [s]
COMMAND_TIMEOUT_S, WATCHDOG_MS = 0.2, 250
DRIVES_S, WATCH_S, REST_S = 0.3, 0.8, 0.3
"""Driving before the failure at least, longest wait for the stop, and standing after it [s]."""
POLLED_S = 0.5  # The driver asks the board for its state so often, which feeds its watchdog [s]


class Fault(NamedTuple):
    """What fails, which links can notice it, and what does the stopping if all are at work."""

    name: str
    links: Sequence[str]


PAGE, SERVER, DRIVER, BOARD = "page", "server", "driver", "board"
LIFTED = Fault("finger lifted", (PAGE, SERVER, DRIVER))
SILENT = Fault("page stopped", (SERVER, DRIVER))
HUNG = Fault("server hung", (DRIVER,))
DEAD = Fault("host dead", (BOARD,))
FAULTS = (LIFTED, SILENT, HUNG, DEAD)


class Chain:
    """A page, the helm, a driver and a board; links that are not named are disabled.

    Args:
        links: of `page` (it tells that its control was released), `server` (150 ms without a fresh command), `driver`
            (command timeout), `board` (watchdog).
    """

    def __init__(self, links: Iterable[str], robot: str = "traxbot", engine: str = "python") -> None:
        self.links = frozenset(links)
        self._emulated = factory.make(factory.Options(robot=robot, engine=engine))
        self.robot = SteppedDriver(
            self._emulated.engine,
            options=Options(
                command_timeout_s=COMMAND_TIMEOUT_S if DRIVER in self.links else None,
                watchdog_ms=WATCHDOG_MS if BOARD in self.links else 0,
            ),
        )
        self.robot.connect()
        off = {} if SERVER in self.links else {"stop_s": math.inf, "sent_s": math.inf}
        self.helm, self.page = Helm(**off), Page(1, ahead_s=-3.0)
        self.helm.join(1, True, self.now_s)
        self.helm.take(1, self.now_s)
        self.rest(REST_S)

    @property
    def now_s(self) -> float:
        """Simulated time [s]."""
        return self.robot.now_s

    def carry_out(self, acts: Sequence[Any]) -> None:
        """What the server does with the helm's acts."""
        for act in acts:
            if isinstance(act, Drive):
                assert self.robot.drive(act.linear_m_s, act.angular_rad_s), "the robot refuses to drive"
            elif isinstance(act, Halt):
                self.robot.stop()

    def wait(self, seconds: float) -> None:
        """The server runs."""
        end_s = self.now_s + seconds
        while self.now_s < end_s:
            self.robot.wait(min(end_s, max(self.now_s, self.helm.due_s)) - self.now_s)
            self.carry_out(self.helm.tick(self.now_s))

    def arrive(self, message: Any) -> None:
        """A message that the page sends now arrives."""
        self.wait(WAY_S)
        self.receive(message)

    def receive(self, message: Any) -> None:
        """A message arrives, and the page hears of the state now."""
        self.carry_out(self.helm.control(1, message, self.now_s))
        self.page.hear(self.now_s)

    def rest(self, seconds: float) -> None:
        """No control is held."""
        self.robot.stop()
        self.robot.wait(seconds)
        self.page.hear(self.now_s)
        self.arrive(self.page.lift(self.now_s))

    def drive(self, seconds: float) -> float:
        """The page drives; when its last command was sent [s].  It has just arrived."""
        begins_s = self.now_s
        sends = [begins_s + PERIOD_S * number for number in range(int(seconds / PERIOD_S) + 1)]
        coming: Deque[Any] = deque()
        for time_s, sends_now in sorted(
            [(each, True) for each in sends] + [(each + WAY_S, False) for each in sends]
        ):
            self.wait(time_s - self.now_s)
            if sends_now:
                made = self.page.push if time_s == begins_s else self.page.message
                coming.append(made(self.now_s))
            else:
                self.receive(coming.popleft())
        assert self.robot.command is not None, "the robot does not drive"
        return sends[-1]

    def stop_s(self, fault: Fault, phase: float) -> float:
        """Time from the last fresh command to the stop at the motor board [s]; infinity: it drives on.

        Args:
            phase: When it fails, from 0 (at the last command) to 1 (when the next one would come).
        """
        sent_s = self.drive(DRIVES_S + phase * POLLED_S)
        fails_s = sent_s + WAY_S + phase * PERIOD_S
        if fault is SILENT:
            self.wait(WATCH_S)
        elif fault is LIFTED:
            self.wait(fails_s - WAY_S - self.now_s)
            release = self.page.lift(self.now_s)
            if PAGE in self.links:
                self.arrive(release)
            self.wait(WATCH_S)
        elif fault is HUNG:
            self.robot.wait(fails_s - self.now_s)
            self.robot.wait(WATCH_S)
        else:
            self.robot.wait(fails_s - self.now_s)
            self.robot.pause(WATCH_S)
        commands = self._emulated.plant.motor_board.commands
        stops = [each.time_s for each in commands if each.code == STOP and each.time_s > sent_s]
        self.rest(REST_S)
        return stops[0] - sent_s if stops else math.inf

    def close(self) -> None:
        """The end of the board."""
        self._emulated.close()


def stop_times(
    links: Iterable[str],
    fault: Fault = SILENT,
    robot: str = "traxbot",
    engine: str = "python",
    runs: int = 20,
) -> List[float]:
    """Times from the last fresh command to the stop at the motor board [s], with phases spread evenly."""
    chain = Chain(links, robot, engine)
    try:
        return [chain.stop_s(fault, (run + 0.5) / runs) for run in range(runs)]
    finally:
        chain.close()
