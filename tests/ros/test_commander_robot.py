"""The node's commands on an emulated robot in simulated time: timeout, pauses, zones, manual mode."""

import math

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.options import QUEUED_S
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import FrameError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.safety.speed_limiter import LONGEST_STEP_S
from ros1_bridge.control import commander as module
from ros1_bridge.control.commander import Commander
from sim_arduino.faults import hardware_faults
from sim_arduino.serve import factory

from .test_commander import FRAME_S, LIMITS

TIMEOUT_S, ROUNDING_M_S = 0.5, 0.001


class Robot:
    """A commander and its driver on an emulated robot, in simulated time."""

    def __init__(self, driver):
        self.driver, self.commander = driver, Commander(driver, lambda: driver.now_s)
        self.commander.limits = LIMITS

    def run(self, seconds, linear=None, angular=0.0, *lateral):
        """Time passes, with a command for each frame where there is one."""
        for _ in range(round(seconds / FRAME_S)):
            if linear is not None:
                self.commander.drive(linear, angular, *lateral)
            self.driver.wait(FRAME_S)


@pytest.fixture(params=["traxbot"])
def robot(request):
    emulated = factory.make(factory.Options(robot=request.param))
    with SteppedDriver(
        emulated.engine, options=Options(command_timeout_s=TIMEOUT_S, queued_s=QUEUED_S)
    ) as driver:
        made = Robot(driver)
        made.plant = emulated.plant
        yield made
    emulated.close()


def test_a_command_that_waited_while_the_node_stood_still_does_not_move_the_robot(robot):
    robot.run(1.0, 0.1)
    robot.driver.pause(0.4)
    assert not robot.commander.drive(0.1, 0.0) and robot.commander.refusal() == module.PAUSED
    assert robot.driver.command is None


def test_robot_stops_when_commands_end(robot):
    """Not earlier than the timeout, nor a frame later; the driver does it, whatever the node does."""
    robot.run(0.2, 0.3)
    commanded_s = robot.driver.now_s - FRAME_S
    while robot.driver.command is not None:
        robot.driver.wait(0.001)
    assert TIMEOUT_S <= robot.driver.now_s - commanded_s < TIMEOUT_S + FRAME_S
    assert robot.commander.stopped_by == StopReason.COMMAND_TIMEOUT


def test_robot_that_is_still_speeding_up_stops_when_commands_end(robot):
    """One command; the steps of the ramp are no commands."""
    robot.commander.drive(0.3, 0.0)
    robot.driver.wait(TIMEOUT_S - FRAME_S)
    assert 0.0 < robot.driver.command[0] < 0.3
    robot.driver.wait(2 * FRAME_S)
    assert robot.driver.command is None and robot.commander.stopped_by == StopReason.COMMAND_TIMEOUT


def test_robot_that_was_told_to_stand_is_not_stopped_by_the_timeout(robot):
    """As a joystick does: one zero, then silence."""
    robot.run(0.5, 0.2)
    robot.run(FRAME_S, 0.0)
    robot.run(2 * TIMEOUT_S)
    assert (robot.driver.command, robot.commander.stopped_by) == (None, StopReason.NONE)


def test_a_motor_board_that_was_away_is_the_reason_and_not_the_battery_that_it_measures(robot):
    """Whenever within a second the voltage is asked for."""
    causes = set()
    for _ in range(6):
        robot.run(0.3, 0.2)
        hardware_faults.motor_board_absent(robot.plant, True)
        robot.run(0.15)
        hardware_faults.motor_board_absent(robot.plant, False)
        for _ in range(40):
            robot.run(FRAME_S)
            causes.add(robot.commander.stopped_by)
    assert causes == {"motor_board"}


class Wall:
    """Zones that allow so much ahead."""

    def __init__(self, allowed):
        self.allowed = allowed

    def limit(self, linear, now):
        return min(linear, self.allowed)


def test_zones_slow_a_robot_with_the_next_frame(robot):
    """Even while the node is stuck."""
    wall = Wall(0.3)
    robot.commander.watch(wall)
    robot.run(1.6, 0.3)
    wall.allowed = 0.1
    robot.driver.wait(FRAME_S)
    assert robot.driver.command == (0.1, 0.0)


def test_a_robot_that_the_zones_hold_stops_when_commands_end(robot):
    robot.commander.watch(Wall(0.0))
    robot.run(0.2, 0.3)
    robot.driver.wait(2 * TIMEOUT_S)
    assert robot.driver.command is None and robot.commander.stopped_by == StopReason.COMMAND_TIMEOUT


@pytest.mark.parametrize("robot", ["omni"], indirect=True)
def test_zones_slow_a_robot_that_goes_sideways_in_its_direction(robot):
    wall = Wall(0.0)
    wall.limited = lambda velocity, now: (velocity[0] / 2, velocity[1] / 2)
    robot.commander.watch(wall)
    robot.run(2.0, 0.1, 0.5, -0.2)
    assert robot.driver.command == pytest.approx((0.05, 0.5, -0.1))
    wall.limited = lambda velocity, now: (0.0, 0.0)
    robot.driver.limit_again()
    assert (
        robot.driver.command == (0.0, 0.5, 0.0) and robot.commander.stopped_by == StopReason.PROTECTIVE_ZONE
    )


def test_a_command_that_is_not_finite_stops_the_robot_and_is_named(robot):
    robot.run(0.2, 0.3)
    with pytest.raises(FrameError):
        robot.commander.drive(math.nan, 0.0)
    assert (robot.driver.command, robot.commander.stopped_by) == (None, StopReason.NOT_A_NUMBER)


def test_manual_mode_slows_a_robot_with_the_next_frame_on_the_same_arc(robot):
    robot.run(2.0, 0.3, 0.6)
    robot.commander.manual_m_s = 0.1
    robot.commander.set_manual(True)
    robot.driver.wait(FRAME_S)
    assert robot.driver.command == pytest.approx((0.1, 0.2))
    robot.run(1.0, -9.0)
    assert robot.driver.command == (-0.1, 0.0)


def test_after_manual_mode_the_robot_speeds_up_with_the_next_command_along_the_ramp(robot):
    robot.commander.manual_m_s = 0.1
    robot.commander.set_manual(True)
    robot.run(1.0, 0.3)
    robot.commander.set_manual(False)
    robot.run(0.2)
    assert robot.driver.command == (0.1, 0.0)
    speeds = []
    for _ in range(60):
        robot.run(FRAME_S, 0.3)
        speeds.append(robot.driver.command[0])
    steps = [after - before for before, after in zip([0.1, *speeds], speeds)]
    most_s = LONGEST_STEP_S + FRAME_S  # the step of the command, and that of the frame after it
    assert max(steps) <= LIMITS.linear_acceleration_m_s2 * most_s + ROUNDING_M_S and speeds[-1] == 0.3
