"""Timeout, zones and emergency stop of the node's commands; why the robot stands."""

import math

import pytest

from mrl_driver.driver import Options
from mrl_driver.driver.options import QUEUED_S
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import FrameError, LinkLost
from mrl_driver.problems import PROBLEMS
from mrl_driver.robot import models
from mrl_driver.robot.models import Limits
from mrl_driver.safety.operation_mode import manual_speed_m_s, reduced
from mrl_driver.safety.speed_limiter import LONGEST_STEP_S
from mrl_driver.safety.wheel_monitor import DEAD, Mismatch
from mrl_driver.view import words
from ros1_bridge.control import commander as module
from ros1_bridge.control.commander import Commander, lowered
from ros1_bridge.robot import reconfigure
from ros1_bridge.status.robot_status import state_of
from sim_arduino.faults import hardware_faults
from sim_arduino.serve import factory

LIMITS = Limits(0.3, 1.0, 0.2, 1.0)
REQUESTED = dict(zip(reconfigure.LIMITS, (0.1, 0.5, 0.05, 0.2)))
TIMEOUT_S, FRAME_S = 0.5, 0.02
ROUNDING_M_S = 0.001
"""Of speeds on the wire."""


class Noted:
    """A driver's commands, and what it would say of itself."""

    def __init__(self):
        self.command, self.ready, self.battery_state, self.battery_v = None, True, "ok", 12.0
        self.stops, self.lost, self.may_be_moving = 0, False, False
        self.mismatch, self.stop_reason, self.hold = None, "none", None
        self.model, self.telemetry = models.load("pioneer"), None
        self.inhibited, self.limits = set(), LIMITS
        self.since_pause_s = math.inf

    def drive(self, *speeds):
        if not self.ready or self.inhibited:
            return False
        self.command = speeds
        return True

    def stop(self):
        if self.lost:
            raise LinkLost("gone")
        self.stops += 1
        self.command = None

    def inhibit(self, reason):
        self.inhibited.add(reason)
        self.stop()

    def allow(self, reason):
        self.inhibited.discard(reason)


class Bench:
    """A commander with a clock of its own, and a driver that only notes what it is told."""

    def __init__(self):
        self.now_s = 100.0
        self.driver = Noted()
        self.commander = Commander(self.driver, lambda: self.now_s)

    def run(self, seconds, linear=None, angular=0.0, *lateral):
        """Frames of the stream, with a command before each where there is one."""
        for _ in range(round(seconds / FRAME_S)):
            self.now_s += FRAME_S
            if linear is not None:
                self.commander.drive(linear, angular, *lateral)


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
def bench():
    return Bench()


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


def test_an_emergency_stop_is_the_reason_named_after_a_pause_too(bench):
    bench.driver.since_pause_s = 0.0
    bench.commander.latch()
    assert bench.commander.refusal() == module.REFUSALS[module.EMERGENCY]


@pytest.fixture
def paused(robot):
    """A robot whose node stood still while it drove."""
    robot.run(1.0, 0.1)
    robot.driver.pause(0.4)
    return robot


def test_a_command_that_waited_while_the_node_stood_still_does_not_move_the_robot(paused):
    assert not paused.commander.drive(0.1, 0.0) and paused.commander.refusal() == module.PAUSED
    assert paused.driver.command is None


def test_a_command_of_zero_that_waited_counts(paused):
    assert paused.commander.drive(0.0, 0.0)


def test_a_command_to_move_counts_a_while_after_the_pause(paused):
    paused.run(QUEUED_S)
    assert paused.commander.drive(0.1, 0.0)


def test_limits_change_in_their_order():
    assert reconfigure.limits_of(dict(REQUESTED), LIMITS) == Limits(0.1, 0.5, 0.05, 0.2)


@pytest.mark.parametrize("name", reconfigure.LIMITS)
def test_limit_that_is_no_number_stays_as_it_was(name):
    """And the answer says so."""
    config = {**REQUESTED, name: math.nan}
    at = reconfigure.LIMITS.index(name)
    assert reconfigure.limits_of(config, LIMITS)[at] == config[name] == LIMITS[at]


def test_robot_stops_when_commands_end(robot):
    """Not earlier than the timeout, nor a frame later; the driver does it, whatever the node does."""
    robot.run(0.2, 0.3)
    commanded_s = robot.driver.now_s - FRAME_S
    while robot.driver.command is not None:
        robot.driver.wait(0.001)
    assert TIMEOUT_S <= robot.driver.now_s - commanded_s < TIMEOUT_S + FRAME_S
    assert robot.commander.stopped_by == module.TIMEOUT


def test_robot_that_is_still_speeding_up_stops_when_commands_end(robot):
    """One command; the steps of the ramp are no commands."""
    robot.commander.drive(0.3, 0.0)
    robot.driver.wait(TIMEOUT_S - FRAME_S)
    assert 0.0 < robot.driver.command[0] < 0.3
    robot.driver.wait(2 * FRAME_S)
    assert robot.driver.command is None and robot.commander.stopped_by == module.TIMEOUT


def test_robot_that_was_told_to_stand_is_not_stopped_by_the_timeout(robot):
    """As a joystick does: one zero, then silence."""
    robot.run(0.5, 0.2)
    robot.run(FRAME_S, 0.0)
    robot.run(2 * TIMEOUT_S)
    assert (robot.driver.command, robot.commander.stopped_by) == (None, module.NONE)


@pytest.mark.parametrize("before", ["boot", "command_timeout", "link_watchdog"])
def test_command_to_stand_ends_what_stopped_the_robot_before(bench, before):
    bench.driver.stop_reason = before
    bench.run(FRAME_S, 0.0)
    assert bench.commander.stopped_by == module.NONE


def test_board_that_was_switched_on_is_no_stop_until_the_robot_has_driven(bench):
    """A board that restarts on the way is one."""
    bench.driver.stop_reason = "boot"
    assert bench.commander.stopped_by == module.NONE
    bench.run(FRAME_S, 0.2)
    bench.driver.command = None
    assert bench.commander.stopped_by == "boot"


@pytest.mark.parametrize("reason", ["link_lost", "restarted", "link_watchdog"])
def test_robot_that_the_driver_stopped_waits_for_a_new_command(bench, reason):
    """Though it was still speeding up, and its commands have not ended."""
    bench.run(0.2, 0.3)
    bench.driver.command, bench.driver.stop_reason = None, reason
    assert bench.commander.dropped
    bench.run(2 * FRAME_S)
    assert (bench.driver.command, bench.commander.dropped) == (None, True)
    bench.run(FRAME_S, 0.3)
    assert bench.driver.command and not bench.commander.dropped


def test_command_that_only_timed_out_was_not_dropped(bench):
    """Unless nobody could command meanwhile, for there was no telemetry."""
    bench.run(0.2, 0.3)
    bench.driver.command, bench.driver.stop_reason = None, "command_timeout"
    assert not bench.commander.dropped
    bench.now_s += module.STALE_S
    assert bench.commander.dropped


def test_emergency_stop_is_latched(bench):
    bench.run(0.2, 0.3)
    bench.commander.latch()
    assert bench.driver.command is None
    assert not bench.commander.drive(0.1, 0.0)
    assert bench.commander.stopped_by == module.EMERGENCY
    assert "release_stop" in bench.commander.refusal()


def test_released_robot_stands_until_the_next_command(bench):
    bench.run(0.2, 0.3)
    bench.commander.latch()
    bench.commander.release()
    bench.run(0.2)
    assert bench.driver.command is None
    assert bench.commander.drive(0.1, 0.0)


def test_emergency_stop_is_latched_even_when_the_link_is_gone(bench):
    bench.driver.lost = True
    with pytest.raises(LinkLost):
        bench.commander.latch()
    assert bench.commander.latched


@pytest.mark.parametrize("stop", [Commander.latch, lambda commander: commander.enable(False)])
def test_stop_that_stays_ends_the_drive_to_a_pose(bench, stop):
    bench.commander.seeking = True
    stop(bench.commander)
    assert not bench.commander.seeking


def test_stop_ends_the_drive_to_a_pose_even_when_the_link_is_gone(bench):
    bench.commander.seeking, bench.driver.lost = True, True
    with pytest.raises(LinkLost):
        bench.commander.latch()
    assert not bench.commander.seeking


def test_disabled_motors_refuse(bench):
    bench.commander.enable(False)
    assert bench.driver.stops == 1
    assert not bench.commander.drive(0.1, 0.0)
    bench.commander.enable(True)
    assert bench.commander.drive(0.1, 0.0)


def test_command_that_is_held_back_while_telemetry_is_late_is_not_refused(bench, monkeypatch):
    drive = bench.driver.drive
    monkeypatch.setattr(bench.driver, "drive", lambda *speeds: not drive(*speeds))
    assert bench.commander.drive(0.2, 0.0)


def test_refused_command_is_not_taken_up_later(bench):
    bench.driver.ready = False
    assert not bench.commander.drive(0.3, 0.0)
    assert bench.commander.stopped_by == module.LINK
    bench.driver.ready = True
    bench.run(0.2)
    assert bench.driver.command is None


def test_empty_battery_is_named(bench):
    bench.driver.battery_state = "empty"
    assert not bench.commander.ready
    assert "charge it" in bench.commander.refusal()


def test_wheel_that_does_not_follow_is_named(bench):
    bench.driver.mismatch = Mismatch("right", DEAD, 0.037, 0.0)
    assert bench.commander.stopped_by == module.WHEEL and not bench.commander.ready
    assert "encoder dead" in bench.commander.refusal()


def test_wheel_for_which_the_board_has_stopped_the_robot_is_named_with_its_remedy(bench):
    bench.driver.mismatch = Mismatch("", "wheel_blocked")
    assert bench.commander.stopped_by == "wheel blocked" and not bench.commander.ready
    assert PROBLEMS["wheel_blocked"].remedy in bench.commander.refusal()
    assert "a command of zero lets it drive again" in bench.commander.refusal()


def test_stop_of_the_driver_is_named(bench):
    bench.driver.stop_reason = "restarted"
    assert bench.commander.stopped_by == "restarted"
    assert bench.commander.ready


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
    assert causes == {"motor board"}


class Wall:
    """Zones that allow so much ahead."""

    def __init__(self, allowed):
        self.allowed = allowed

    def limit(self, linear, now):
        return min(linear, self.allowed)


def test_zones_slow_a_robot_between_two_commands(robot):
    wall = Wall(0.3)
    robot.commander.watch(wall)
    robot.run(1.6, 0.3)
    wall.allowed = 0.1
    robot.driver.limit_again()
    assert robot.driver.command == (0.1, 0.0)


def test_zones_slow_a_robot_with_the_next_frame(robot):
    """Even while the node is stuck."""
    wall = Wall(0.3)
    robot.commander.watch(wall)
    robot.run(1.6, 0.3)
    wall.allowed = 0.1
    robot.driver.wait(FRAME_S)
    assert robot.driver.command == (0.1, 0.0)


def test_a_robot_that_the_zones_hold_may_turn_and_says_why_it_stands(robot):
    wall = Wall(0.0)
    robot.commander.watch(wall)
    robot.run(1.0, 0.3, 0.5)
    assert robot.driver.command == (0.0, 0.5)
    assert robot.commander.stopped_by == module.ZONE and robot.commander.ready
    wall.allowed = 1.0
    robot.run(1.0, 0.3)
    assert robot.driver.command[0] > 0.1 and robot.commander.stopped_by == module.NONE


def test_a_robot_that_the_zones_hold_stops_when_commands_end(robot):
    robot.commander.watch(Wall(0.0))
    robot.run(0.2, 0.3)
    robot.driver.wait(2 * TIMEOUT_S)
    assert robot.driver.command is None and robot.commander.stopped_by == module.TIMEOUT


@pytest.mark.parametrize("robot", ["omni"], indirect=True)
def test_zones_slow_a_robot_that_goes_sideways_in_its_direction(robot):
    wall = Wall(0.0)
    wall.limited = lambda velocity, now: (velocity[0] / 2, velocity[1] / 2)
    robot.commander.watch(wall)
    robot.run(2.0, 0.1, 0.5, -0.2)
    assert robot.driver.command == pytest.approx((0.05, 0.5, -0.1))
    wall.limited = lambda velocity, now: (0.0, 0.0)
    robot.driver.limit_again()
    assert robot.driver.command == (0.0, 0.5, 0.0) and robot.commander.stopped_by == module.ZONE


def test_a_command_that_is_not_finite_stops_the_robot_and_is_named(robot):
    robot.run(0.2, 0.3)
    with pytest.raises(FrameError):
        robot.commander.drive(math.nan, 0.0)
    assert (robot.driver.command, robot.commander.stopped_by) == (None, module.NOT_FINITE)


def test_an_emergency_stop_holds_until_it_is_released(robot):
    robot.run(0.2, 0.3)
    robot.commander.latch()
    robot.run(0.2, 0.3)
    assert robot.driver.command is None
    robot.commander.release()
    robot.run(FRAME_S, 0.3)
    assert robot.driver.command is not None


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


def test_limits_that_change_in_manual_mode_hold_after_it(robot):
    robot.commander.manual_m_s = 0.1
    robot.commander.set_manual(True)
    robot.commander.limits = LIMITS._replace(linear_m_s=0.2)
    assert robot.driver.limits == Limits(0.1, 0.5, 0.2, 1.0)
    robot.commander.set_manual(False)
    assert robot.driver.limits == Limits(0.2, 1.0, 0.2, 1.0)


def test_a_robot_that_is_slower_than_manual_mode_stays_as_slow():
    assert reduced(LIMITS, 0.31) == LIMITS


@pytest.mark.parametrize("model, speed_m_s", [("traxbot", 0.15), ("stingbot", 0.25)])
def test_speed_of_manual_mode_is_half_the_robots_but_at_most_a_quarter_metre(model, speed_m_s):
    assert manual_speed_m_s(models.load(model).limits) == speed_m_s


def test_manual_mode_ends_the_drive_to_a_pose_which_is_no_safety_stop(bench):
    bench.run(0.2, 0.3)
    bench.commander.seeking = True
    bench.commander.set_manual(True)
    assert (bench.driver.stops, bench.commander.seeking) == (1, False)
    assert bench.commander.stopped_by == module.TO_MANUAL and bench.commander.ready
    assert not state_of(bench.commander).safety_stop


def test_a_robot_that_is_driven_by_hand_is_not_stopped_by_manual_mode(bench):
    bench.run(0.2, 0.3)
    bench.commander.set_manual(True)
    assert bench.driver.stops == 0 and bench.commander.driving


def test_limits_are_lowered_never_raised():
    assert lowered(LIMITS, 0.1, 5.0, 0.0, 0.5) == Limits(0.1, 1.0, 0.2, 0.5)


def test_low_limit_of_the_parameters_is_not_raised_at_the_start():
    """dynamic_reconfigure raises a value to the least that is allowed."""
    start = Limits(0.005, 0.001, 0.002, 0.003)
    offered = reconfigure.limits_description(models.load("traxbot"), start)
    assert [offered.min[name] for name in reconfigure.LIMITS] == list(start[:4])


def test_every_cause_has_words():
    names = "EMERGENCY DISABLED LINK BATTERY WHEEL ADRIFT ZONE LATE TIMEOUT NOT_FINITE NONE HELD TO_MANUAL UNPAUSED"
    assert {getattr(module, name) for name in names.split()} - set(words.STOPS) == set()
