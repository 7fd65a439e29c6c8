"""Limits, timeout and emergency stop, with a driver that only notes what it is told."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import LinkLost
from mrl_driver.robot.models import Limits
from ros1_bridge.control import speed_limiter as module
from ros1_bridge.control.speed_limiter import Commander, lowered, ramped
from ros1_bridge.robot import reconfigure

LIMITS = Limits(0.3, 1.0, 0.2, 1.0)
REQUESTED = dict(zip(reconfigure.LIMITS, (0.1, 0.5, 0.05, 0.2)))
TIMEOUT_S, FRAME_S = 0.5, 0.02
SPEEDS = st.floats(-2, 2)


class Noted:
    """A driver's commands, and what it would say of itself."""

    def __init__(self):
        self.command, self.ready, self.battery_state, self.battery_v = None, True, "ok", 12.0
        self.stops, self.lost, self.may_be_moving = 0, False, False
        self.mismatch, self.stop_reason = None, "none"

    def drive(self, *speeds):
        if not self.ready:
            return False
        self.command = speeds
        return True

    def stop(self):
        if self.lost:
            raise LinkLost("gone")
        self.stops += 1
        self.command = None


class Bench:
    """A commander with a clock of its own."""

    def __init__(self):
        self.now_s = 100.0
        self.driver = Noted()
        self.commander = Commander(self.driver, LIMITS, TIMEOUT_S, lambda: self.now_s)

    def run(self, seconds, linear=None, angular=0.0, *lateral):
        """Frames of the stream, with a command before each where there is one."""
        for _ in range(round(seconds / FRAME_S)):
            self.now_s += FRAME_S
            if linear is not None:
                self.commander.drive(linear, angular, *lateral)
            self.commander.tick()


@pytest.fixture
def bench():
    return Bench()


def test_first_command_is_in_force_at_once(bench):
    assert bench.commander.drive(0.3, 0.0)
    assert bench.driver.command == (pytest.approx(0.2 * FRAME_S), 0.0)


def test_speeding_up_takes_as_long_as_the_limit_says(bench):
    bench.run(1.0, 0.3)
    assert bench.driver.command[0] == pytest.approx(0.2, abs=0.01)
    bench.run(0.6, 0.3)
    assert bench.driver.command[0] == 0.3


def test_single_command_goes_on_speeding_up_with_the_stream(bench):
    bench.commander.drive(0.3, 0.0)
    bench.run(0.4)
    assert bench.driver.command[0] == pytest.approx(0.2 * 0.42, abs=0.01)


def test_slowing_down_is_not_delayed(bench):
    bench.run(1.6, 0.3)
    bench.commander.drive(0.05, 0.0)
    assert bench.driver.command == (0.05, 0.0)


def test_reversing_starts_from_standstill(bench):
    bench.run(1.6, 0.3)
    bench.now_s += FRAME_S
    bench.commander.drive(-0.3, 0.0)
    assert bench.driver.command[0] == pytest.approx(-0.2 * FRAME_S)


def test_too_fast_a_command_keeps_its_arc(bench):
    bench.run(3.0, 3.0, 5.0)
    assert bench.driver.command == (pytest.approx(0.3), pytest.approx(0.5))


def test_largest_number_is_clamped(bench):
    bench.run(3.0, 1e308)
    assert bench.driver.command == (pytest.approx(0.3), 0.0)


def test_limits_change_in_their_order():
    assert reconfigure.limits_of(dict(REQUESTED), LIMITS) == Limits(0.1, 0.5, 0.05, 0.2)


@pytest.mark.parametrize("name", reconfigure.LIMITS)
def test_limit_that_is_no_number_stays_as_it_was(name):
    """And the answer says so."""
    config = {**REQUESTED, name: math.nan}
    at = reconfigure.LIMITS.index(name)
    assert reconfigure.limits_of(config, LIMITS)[at] == config[name] == LIMITS[at]


@given(st.floats(-1, 1), st.floats(0.001, 1))
def test_speed_approaches_no_number_by_becoming_none(speed, dt_s):
    """Which the driver refuses."""
    assert math.isnan(ramped((speed, 0.0), (math.nan, 0.0), LIMITS, dt_s)[0])


def test_robot_stops_when_commands_end(bench):
    """With the first frame of the stream after the timeout: neither earlier nor later."""
    bench.run(0.2, 0.3)
    commanded_s = bench.now_s
    while bench.driver.command is not None:
        last_s = bench.now_s
        bench.run(FRAME_S)
    assert last_s - commanded_s < TIMEOUT_S <= bench.now_s - commanded_s < TIMEOUT_S + FRAME_S
    assert bench.commander.stopped_by == module.TIMEOUT


def test_robot_that_was_told_to_stand_is_not_stopped_by_the_timeout(bench):
    """As a joystick does: one zero, then silence."""
    bench.run(0.5, 0.2)
    bench.run(FRAME_S, 0.0)
    bench.run(2 * TIMEOUT_S)
    assert (bench.driver.command, bench.commander.stopped_by) == (None, module.NONE)


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


def test_robot_that_the_driver_stopped_starts_from_standstill(bench):
    bench.run(1.6, 0.3)
    bench.driver.command = None
    bench.commander.drive(0.3, 0.0)
    assert bench.driver.command[0] == pytest.approx(0.2 * FRAME_S)


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
    bench.now_s += module.SILENT_S
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


def test_disabled_motors_refuse(bench):
    bench.commander.enable(False)
    assert bench.driver.stops == 1
    assert not bench.commander.drive(0.1, 0.0)
    bench.commander.enable(True)
    assert bench.commander.drive(0.1, 0.0)


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
    bench.driver.mismatch = "right wheel: encoder dead"
    assert bench.commander.stopped_by == module.WHEEL
    assert "encoder dead" in bench.commander.refusal()


def test_stop_of_the_driver_is_named(bench):
    bench.driver.stop_reason = "restarted"
    assert bench.commander.stopped_by == "restarted"
    assert bench.commander.ready


class Wall:
    """Zones that allow so much ahead."""

    def __init__(self, allowed):
        self.allowed = allowed

    def limit(self, linear, now):
        return min(linear, self.allowed)


def test_zones_slow_a_robot_between_two_commands(bench):
    bench.commander.zones = wall = Wall(0.3)
    bench.run(1.6, 0.3)
    wall.allowed = 0.1
    bench.commander.tick()
    assert bench.driver.command == (0.1, 0.0)


def test_a_robot_that_the_zones_hold_may_turn_and_says_why_it_stands(bench):
    bench.commander.zones = wall = Wall(0.0)
    bench.run(1.0, 0.3, 0.5)
    assert bench.driver.command == (0.0, 0.5)
    assert bench.commander.stopped_by == module.ZONE and bench.commander.ready
    wall.allowed = 1.0
    bench.run(1.0, 0.3)
    assert bench.driver.command[0] > 0.1 and bench.commander.stopped_by == module.NONE


def test_zones_slow_a_robot_that_goes_sideways_in_its_direction(bench):
    wall = Wall(0.0)
    wall.limited = lambda velocity, now: (velocity[0] / 2, velocity[1] / 2)
    bench.commander.zones = wall
    bench.run(2.0, 0.1, 0.5, -0.2)
    assert bench.driver.command == pytest.approx((0.05, 0.5, -0.1))
    wall.limited = lambda velocity, now: (0.0, 0.0)
    bench.commander.tick()
    assert bench.driver.command == (0.0, 0.5, 0.0) and bench.commander.stopped_by == module.ZONE


def test_limits_are_lowered_never_raised():
    assert lowered(LIMITS, 0.1, 5.0, 0.0, 0.5) == Limits(0.1, 1.0, 0.2, 0.5)


@given(st.tuples(SPEEDS, SPEEDS), st.tuples(SPEEDS, SPEEDS), st.floats(0, 0.5))
def test_step_never_overshoots_and_never_delays_a_stop(before, wanted, dt_s):
    rises = (dt_s * LIMITS.linear_acceleration_m_s2, dt_s * LIMITS.angular_acceleration_rad_s2)
    for after, speed, target, rise in zip(ramped(before, wanted, LIMITS, dt_s), before, wanted, rises):
        assert abs(after) <= abs(target) + 1e-12 and after * target >= 0
        assert abs(after) <= max(0.0, math.copysign(speed, speed * target)) + rise + 1e-12 or after == target
        assert abs(target) > abs(speed) or speed * target <= 0 or after == target


@given(SPEEDS, SPEEDS)
def test_robot_at_rest_speeds_up_on_the_commanded_arc(linear, angular):
    bench = Bench()
    bench.commander.drive(linear, angular)
    for _ in range(100):
        forward, turn = bench.driver.command
        assert forward * angular == pytest.approx(turn * linear, abs=1e-9)
        bench.now_s += FRAME_S
        bench.commander.drive(linear, angular)


def test_slower_of_way_and_turn_decides_how_long_speeding_up_takes(bench):
    """0.3 m/s at 0.2 m/s2 take 1.5 s, and so does 0.5 rad/s, for which 0.5 s would do."""
    bench.run(0.75, 0.3, 0.5)
    assert bench.driver.command == (pytest.approx(0.15, abs=0.01), pytest.approx(0.25, abs=0.02))
    bench.run(0.77, 0.3, 0.5)
    assert bench.driver.command == (0.3, 0.5)


def test_curve_does_not_slow_a_robot_that_drives_straight(bench):
    bench.run(1.6, 0.3)
    bench.run(FRAME_S, 0.3, 0.5)
    assert bench.driver.command == (0.3, pytest.approx(FRAME_S))


def test_slowing_down_into_a_curve_is_not_delayed(bench):
    bench.run(1.6, 0.3)
    bench.run(FRAME_S, 0.1, 0.5)
    assert bench.driver.command == (0.1, pytest.approx(FRAME_S))


# ---- robots that move sideways


@given(SPEEDS, SPEEDS, SPEEDS)
def test_a_slide_keeps_direction_and_arc_within_the_limits(linear, angular, lateral):
    bench = Bench()
    for _ in range(200):
        bench.now_s += FRAME_S
        bench.commander.drive(linear, angular, lateral)
    forward, turn, left = bench.driver.command
    assert math.hypot(forward, left) <= 0.3 + 1e-12 and abs(turn) <= 1.0
    assert forward * lateral == pytest.approx(left * linear, abs=1e-9)
    assert forward * angular == pytest.approx(turn * linear, abs=1e-9)


def test_sideways_has_a_limit_of_its_own(bench):
    bench.commander.limits = LIMITS._replace(lateral_m_s=0.1)
    for _ in range(200):
        bench.now_s += FRAME_S
        bench.commander.drive(0.2, 0.4, 0.2)
    assert bench.driver.command == pytest.approx((0.1, 0.2, 0.1))


def test_a_slide_may_follow_a_command_without_one(bench):
    """As when cmd_vel takes over from a pose that is sought; and the other way round."""
    bench.commander.drive(0.1, 0.0)
    bench.now_s += FRAME_S
    bench.commander.drive(0.1, 0.0, 0.1)
    forward, _, left = bench.driver.command
    assert 0 < forward == left
    bench.now_s += FRAME_S
    bench.commander.drive(0.1, 0.0)
    assert len(bench.driver.command) == 2


def test_a_slide_speeds_up_as_the_limit_says_and_turns_its_direction_at_once(bench):
    bench.commander.drive(0.0, 0.0, 0.3)
    assert bench.driver.command == (0.0, 0.0, pytest.approx(0.2 * FRAME_S))
    for _ in range(50):
        bench.now_s += FRAME_S
        bench.commander.tick() if bench.now_s < 100.3 else bench.commander.drive(0.3, 0.0, 0.3)
    forward, _, left = bench.driver.command
    assert forward == left == pytest.approx(0.2 / math.sqrt(2), rel=0.1)
    assert bench.commander.moving
    bench.commander.drive(0.0, 0.0, -0.3)
    assert abs(bench.driver.command[2]) <= 0.2 * FRAME_S + 1e-12  # the other way it begins anew
