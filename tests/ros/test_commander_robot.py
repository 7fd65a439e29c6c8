"""The node's commands on an emulated robot in simulated time: timeout, pauses, manual mode."""

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.options import QUEUED_S
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.protocol.stop_reason import StopReason
from ros1_bridge.control import commander as module
from ros1_bridge.control.commander import Commander
from sim_arduino.faults import hardware_faults
from sim_arduino.serve import factory

from .test_commander import FRAME_S, LIMITS

TIMEOUT_S = 0.5


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


@pytest.fixture
def robot():
    emulated = factory.make(factory.Options(robot="traxbot"))
    options = Options(command_timeout_s=TIMEOUT_S, queued_s=QUEUED_S)
    with SteppedDriver(emulated.engine, options=options) as driver:
        made = Robot(driver)
        made.plant = emulated.plant
        yield made
    emulated.close()


@pytest.mark.parametrize("before_m_s", [0.0, 0.1])
def test_a_command_that_waited_while_the_node_stood_still_does_not_move_the_robot(robot, before_m_s):
    robot.run(1.0, before_m_s)
    robot.driver.pause(0.4)
    assert not robot.commander.drive(0.1, 0.0) and robot.commander.refusal() == module.PAUSED
    assert robot.driver.command is None and robot.commander.stopped_by == StopReason.HOST_PAUSED


def test_robot_stops_when_commands_end(robot):
    """Not earlier than the timeout, nor a frame later; the driver does it, whatever the node does."""
    robot.run(0.2, 0.3)
    commanded_s = robot.driver.now_s - FRAME_S
    while robot.driver.command is not None:
        robot.driver.wait(0.001)
    assert TIMEOUT_S <= robot.driver.now_s - commanded_s < TIMEOUT_S + FRAME_S
    assert robot.commander.stopped_by == StopReason.COMMAND_TIMEOUT


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


def test_manual_mode_slows_a_robot_with_the_next_frame_on_the_same_arc(robot):
    robot.run(2.0, 0.3, 0.6)
    robot.commander.manual_m_s = 0.1
    robot.commander.set_manual(True)
    robot.driver.wait(FRAME_S)
    assert robot.driver.command == pytest.approx((0.1, 0.2))
    robot.run(1.0, -9.0)
    assert robot.driver.command == (-0.1, 0.0)
