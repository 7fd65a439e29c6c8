"""The driver in simulated time, on the emulator's board."""

import math

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.options import COMMAND_TIMEOUT_S
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import BY_NAME
from sim_arduino.serve import factory

LASTING = Options(command_timeout_s=None)
BRAKING_S = 0.3  # From the stop to standing still; the motor board brakes at once


@pytest.fixture
def emulated(close_later):
    return close_later(factory.make(factory.Options(robot="traxbot", world="square")))


@pytest.fixture
def robot(emulated):
    """Its commands stay in force."""
    with SteppedDriver(emulated.engine, options=LASTING) as robot:
        yield robot


def test_a_command_that_is_not_repeated_ends_after_half_a_second(emulated):
    """Unless the program sets another time: one that hangs leaves no robot driving."""
    with SteppedDriver(emulated.engine) as robot:
        robot.drive(0.2, 0.0)
        robot.wait(9.0)
        assert robot.stopped and robot.stop_reason == "command_timeout"
        assert robot.pose.x_m < 0.2 * (COMMAND_TIMEOUT_S + BRAKING_S)


def test_a_question_without_an_answer_ends_in_simulated_time(robot):
    with pytest.raises(BoardTimeout, match="3 attempts"):
        robot.ask(BY_NAME["stop"].code)


def test_limits_are_the_models_speeds_and_no_acceleration_until_others_are_set(robot):
    model = robot.model.limits
    assert robot.limits[:2] == model[:2] and robot.limits.linear_acceleration_m_s2 == math.inf
    robot.drive(9.0, 0.0)
    assert robot.command == (model.linear_m_s, 0.0)


def test_a_robot_that_slows_down_for_its_battery_speeds_up_no_more(robot, emulated):
    robot.limits = robot.limits._replace(linear_acceleration_m_s2=0.03)
    robot.drive(0.4, 0.0)
    robot.wait(3.0)
    emulated.plant.robot.set_battery(8.3)
    while robot.battery_state != "empty":
        robot.wait(0.01)
    speed_m_s = robot.command.linear_m_s
    assert 0.1 < speed_m_s < 0.4
    while robot.command is not None:
        assert robot.command.linear_m_s <= speed_m_s
        speed_m_s = robot.command.linear_m_s
        robot.wait(0.02)
    assert robot.stop_reason == "battery"


def test_what_restricts_commands_is_given_speeds_and_the_drivers_time(robot):
    asked = []
    robot.restrict(lambda speeds, now: asked.append((speeds, now)) or (0.1, 0.0))
    robot.drive(0.2, 0.5)
    assert robot.command == (0.1, 0.0) and asked == [((0.2, 0.5), robot.now_s)]
    robot.restrict(None)
    robot.limit_again()
    assert robot.command == (0.2, 0.5)


def test_a_lower_limit_holds_from_the_next_frame_on(emulated):
    """Also if no other command ever comes."""
    with SteppedDriver(emulated.engine, options=Options(command_timeout_s=None)) as robot:
        robot.drive(0.3, 0.5)
        robot.wait(0.1)
        robot.limits = robot.limits._replace(linear_m_s=0.1)
        robot.wait(0.1)
        assert robot.command == pytest.approx((0.1, 0.5 / 3), abs=1e-3)
        robot.limits = robot.limits._replace(linear_m_s=0.3)
        robot.wait(0.1)
        assert robot.command.linear_m_s == pytest.approx(0.1)


def test_what_is_no_covariance_is_refused_and_the_pose_stays(robot):
    before = robot.pose
    for spread in ((1e-4, 0, 0, 1e-4, 0), (-1e-4, 0, 0, 1e-4, 0, 1e-4)):
        with pytest.raises(ConfigError, match="covariance"):
            robot.reset_pose(Pose(1.0, 2.0, 0.0), spread)
    assert robot.pose == before


def test_a_pose_is_taken_with_its_yaw_in_range_and_as_sure_as_it_was_given(robot):
    given = (0.04, 0.01, 0.0, 0.09, 0.0, 0.01)
    robot.reset_pose((1, 2, 2 * math.pi + 0.5), given)
    robot.wait(0.2)
    assert robot.pose == (1, 2, pytest.approx(0.5)) and robot.telemetry.spread == given
    robot.drive(0.2, 0.0)
    robot.wait(0.2)
    assert robot.pose.x_m > 1


@pytest.mark.parametrize("speeds", [None, (0.1, 0.0)], ids=["at rest", "driving"])
def test_a_pause_is_known_until_the_next_one(robot, speeds):
    if speeds is not None:
        robot.drive(*speeds)
    robot.pause(0.3)
    assert robot.link.since_pause_s < 0.05
    robot.wait(1.0)
    assert robot.link.since_pause_s == pytest.approx(1.0, abs=0.05)


class Tty:
    """A port that keeps 4095 bytes while nobody reads, as Linux does, and loses the others."""

    def __init__(self, engine):
        self.engine = engine
        self.receive = engine.receive

    @property
    def next_event_s(self):
        return self.engine.next_event_s

    def advance(self, to_s):
        return self.engine.advance(to_s)[:4095]


@pytest.mark.parametrize("seconds", [7.0, 30.0])
def test_after_a_pause_stamps_are_those_of_the_present(emulated, seconds):
    """The board has ended its stream meanwhile, so that no number is missing."""
    with SteppedDriver(Tty(emulated.engine)) as robot:
        robot.wait(3.0)
        robot.pause(seconds)
        robot.wait(0.5)
        assert robot.now_s - robot.telemetry.stamp_s < 0.05
