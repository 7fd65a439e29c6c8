"""A board or a program that stalls for a moment, as on a busy computer: its wheels do not count as blocked."""

import pytest

from mrl_driver.driver.options import DEFAULTS
from mrl_driver.driver.robot_core import Core
from mrl_driver.safety.wheel_monitor import Mismatch
from tests.fake_board import FakeBoard
from tests.models import model as load

STEP_S = 0.01
COMMAND_S = 0.05


class Bench:
    """A driver that drives from time 0, a board, and a line on which nothing passes during a stall."""

    def __init__(self):
        self.core, self.board, self.now, self.events = Core(load("traxbot"), DEFAULTS), FakeBoard(), -2.0, []
        self.board.reset(self.now)
        self.core.begin(self.now)
        self._to_host = self._to_board = b""
        self._commanded_s = -COMMAND_S

    def run(self, end_s, board_stalls=(), reader_stalls=()):
        """Run until `end_s`; return the mismatches."""
        while self.now < end_s:
            self.now = round(self.now + STEP_S, 6)
            self._to_host += self.board.advance(self.now)
            if self.now >= self._commanded_s + COMMAND_S - 1e-6:
                self.core.drive(0.2, 0.0, self.now)
                self._commanded_s = self.now
            board_runs = not any(begin <= self.now < end for begin, end in board_stalls)
            reader_runs = not any(begin <= self.now < end for begin, end in reader_stalls)
            if board_runs:
                self.board.receive(self._to_board, self.now)
                self._to_board = b""
            if board_runs and reader_runs:
                data, self._to_host = self._to_host, b""
                self.events += self.core.turn(data, self.now)
            elif reader_runs and self.now >= self.core.due_s:
                self.events += self.core.turn(b"", self.now)
            self._to_board += self.core.session.take()
        return [event for event in self.events if isinstance(event, Mismatch)]


@pytest.fixture
def bench():
    bench = Bench()
    assert bench.run(-0.5) == []
    return bench


@pytest.mark.parametrize("begin_s", [-0.201, -0.151, -0.101, 0.099])
def test_a_board_that_stalls_again_and_again_is_no_mismatch(bench, begin_s):
    """It executes each command one stall later, and then sends what it measured meanwhile."""
    stalls = [(begin_s + 0.28 * i, begin_s + 0.28 * i + 0.27) for i in range(4)]
    assert bench.run(4.0, board_stalls=stalls) == []
    assert bench.board.speeds == (200, 0)


@pytest.mark.parametrize("seconds", [0.5, 1.0, 3.0])
def test_telemetry_that_waited_for_the_reading_thread_is_no_mismatch(bench, seconds):
    """A callback takes long: no commands are sent while telemetry is late, so the board's watchdog stops the motors."""
    bench.run(1.0)
    assert bench.run(6.0, reader_stalls=[(1.0, 1.0 + seconds)]) == []
    assert bench.board.speeds == (200, 0)


def test_a_wheel_that_is_blocked_after_a_stall_is_a_mismatch(bench):
    bench.run(2.0, board_stalls=[(1.0, 1.25)])
    bench.board.dead = {"left"}
    assert [event.wheel for event in bench.run(3.0)] == ["left"]
