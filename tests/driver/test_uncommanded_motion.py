"""Wheels that turn although nothing asks them to: the robot is stopped again."""

from functools import partial
from types import SimpleNamespace

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol.table import BY_NAME, STOP_CODE
from mrl_driver.session.session import Session
from tests.conformance.bench import Bench
from tests.long.soak.truth import Truth
from tests.scripted_line import ScriptedLine

MOVE = b"@%d," % BY_NAME["move_differential"].code
STOP = b"@%de" % STOP_CODE
MOVE_MOTORS = BY_NAME["move_motors_pid"].code
STOPPED_S = 0.2  # Without the driver, the board's watchdog takes at least 0.25 s
CENTIMETRE = 0.01
PERIODS_MS = (10, 20, 50)  # Of the telemetry


def stopped(period_ms, motors="omni3md", record=None, after_s=1.0):
    """A robot that has stopped, `after_s` after the stop; a line that may `deliver` a move which it has kept back."""
    bench = Bench("python", motors, battery_v=12.0)
    line, kept = ScriptedLine(bench.board), []

    def keep_a_move(data):
        """As a network may."""
        if MOVE in data and not kept:
            kept.append(data)
            return b""
        return data

    driver = SteppedDriver(line, bench.model, options=Options(period_ms=period_ms, record=record))
    driver.connect()
    for to_board in (line.to_board,) * 20 + (keep_a_move,) * 4:
        line.to_board = to_board
        driver.drive(0.2, 0.0)
        driver.wait(0.05)
    driver.stop()
    driver.wait(after_s)
    (move,) = kept
    deliver = partial(bench.board.receive, move)
    return SimpleNamespace(driver=driver, bench=bench, plant=bench.plant, line=line, deliver=deliver)


def close(robot):
    robot.driver.close()
    robot.bench.close()


@pytest.fixture(params=PERIODS_MS, ids="{}ms".format)
def robot(request):
    made = stopped(request.param)
    yield made
    close(made)


def driven_s(robot):
    """How long the motors are driven after the line has delivered the move."""
    truth = Truth(robot.plant)
    robot.deliver()
    robot.driver.wait(1.0)
    begun, ended = truth.edges
    return ended.time_s - begun.time_s


def way_m(robot):
    """How far the robot goes after the line has delivered the move."""
    before_m = robot.plant.true_pose.x_m
    robot.deliver()
    robot.driver.wait(1.0)
    return robot.plant.true_pose.x_m - before_m


def test_a_move_that_arrives_after_its_stop_is_stopped_again(robot):
    assert driven_s(robot) < STOPPED_S


def test_without_this_the_watchdog_stops_it(robot, monkeypatch):
    monkeypatch.setattr(Session, "_on_uncommanded_motion", lambda self, now: None)
    assert driven_s(robot) > STOPPED_S


def test_an_h_bridge_robot_goes_a_centimetre_at_most(monkeypatch):
    """Without the guard it goes further."""
    robot = stopped(20, "bridge")
    assert way_m(robot) < CENTIMETRE
    close(robot)
    monkeypatch.setattr(Session, "_on_uncommanded_motion", lambda self, now: None)
    robot = stopped(20, "bridge")
    assert way_m(robot) > 3 * CENTIMETRE
    close(robot)


def test_each_motion_is_counted_once_and_the_reason_of_the_stop_stays(robot):
    for motions in (1, 2):
        driven_s(robot)
        robot.driver.wait(1.0)
        assert robot.driver.link.statistics.uncommanded_motions == motions
    assert robot.driver.stop_reason == "user"


def test_a_robot_that_is_pushed_by_hand_still_counts_as_stopped_and_gets_a_stop_every_50_ms_at_most(robot):
    before = len(robot.line.sent)
    for _ in range(100):
        robot.plant.robot.motors[0].travel += 7.0
        robot.driver.wait(0.01)
        assert robot.driver.stopped
    assert 10 <= sum(data.count(STOP) for _, data in robot.line.sent[before:]) <= 21


def test_a_board_that_is_greeted_again_after_such_a_request_is_guarded_again(robot):
    robot.driver.request(MOVE_MOTORS, 20, 20)
    for robot.line.to_host in (lambda data: b"", lambda data: data):
        robot.driver.wait(1.0)
    assert robot.driver.ready and driven_s(robot) < STOPPED_S


def test_a_request_that_turns_motors_is_not_stopped(robot):
    truth = Truth(robot.plant)
    robot.driver.request(MOVE_MOTORS, 20, 20)
    robot.driver.wait(0.2)
    assert truth.driven and robot.driver.link.statistics.uncommanded_motions == 0


def test_a_command_after_such_a_request_is_guarded_again(robot):
    robot.driver.request(MOVE_MOTORS, 20, 20)
    robot.driver.drive(0.1, 0.0)
    robot.driver.wait(2.0)
    assert driven_s(robot) < STOPPED_S


@pytest.mark.parametrize("gap_s", [0.0, 0.05, 0.08, 0.2])
def test_a_request_that_follows_a_preset_of_a_counter_is_carried_out(robot, gap_s):
    """The preset looks like a motion."""
    left = robot.plant.robot.motors[0]
    begun = left.travel
    robot.driver.request(BY_NAME["preset_encoder"].code, 1, 5000)
    robot.driver.wait(gap_s)
    robot.driver.request(BY_NAME["move_to_position"].code, 1, 50, 6500)
    robot.driver.wait(2.0)
    assert left.travel - begun == pytest.approx(6500 - 5000, abs=50)
