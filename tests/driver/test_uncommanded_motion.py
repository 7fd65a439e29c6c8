"""Wheels that turn although nothing asks them to: the robot is stopped again."""

from types import SimpleNamespace

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.session.session import Session
from tests.conformance.bench import Bench
from tests.soak.truth import Truth

MOVE = b"@%d," % BY_NAME["move_differential"].code
STOPPED_S = 0.2
"""Without the driver, the board's watchdog takes at least 0.25 s."""


class Line:
    """A board behind a line that keeps back the first move while `keeps`, as a network may, until it is delivered."""

    def __init__(self, board):
        self._board, self.keeps, self.kept = board, False, b""

    @property
    def next_event_s(self):
        return self._board.next_event_s

    def receive(self, data):
        if self.keeps and MOVE in data and not self.kept:
            self.kept = data
        else:
            self._board.receive(data)

    def advance(self, to_s):
        return self._board.advance(to_s)

    def deliver(self):
        self._board.receive(self.kept)


@pytest.fixture(params=[10, 20, 50], ids="{} ms".format)
def robot(request):
    """A robot that has stopped, and whose line still has one of its moves; by period of the telemetry."""
    bench = Bench("python", "omni3md", battery_v=12.0)
    line = Line(bench.board)
    driver = SteppedDriver(line, bench.model, options=Options(period_ms=request.param))
    driver.connect()
    for line.keeps in (False,) * 20 + (True,) * 4:
        driver.drive(0.2, 0.0)
        driver.wait(0.05)
    driver.stop()
    driver.wait(1.0)
    assert line.kept
    yield SimpleNamespace(driver=driver, plant=bench.plant, truth=Truth(bench.plant), line=line)
    driver.close()
    bench.close()


def driven_s(robot):
    """How long the motors are driven after the line has delivered the move."""
    robot.line.deliver()
    robot.driver.wait(1.0)
    (begun, ended) = robot.truth.edges
    return ended.time_s - begun.time_s


def test_a_move_that_arrives_after_its_stop_is_stopped_again(robot):
    assert driven_s(robot) < STOPPED_S


def test_without_this_the_watchdog_stops_it(robot, monkeypatch):
    monkeypatch.setattr(Session, "_on_uncommanded_motion", lambda self, now: None)
    assert driven_s(robot) > STOPPED_S


def test_the_motion_is_counted_and_the_reason_of_the_stop_stays(robot):
    driven_s(robot)
    assert (robot.driver.statistics.uncommanded_motions, robot.driver.stop_reason) == (1, "user")


def test_a_request_that_turns_motors_is_not_stopped(robot):
    robot.driver.request(BY_NAME["move_motors_pid"].code, 20, 20)
    robot.driver.wait(0.2)
    assert robot.truth.driven and robot.driver.statistics.uncommanded_motions == 0
