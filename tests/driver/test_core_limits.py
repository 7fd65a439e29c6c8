"""What the driver's core refuses and stops, and by which reason, on a fake board in simulated time."""

import math

import pytest

from mrl_driver.driver.options import DEFAULTS
from mrl_driver.driver.robot_core import GENTLE_S, Core
from mrl_driver.errors import FrameError, MrlError
from mrl_driver.protocol.table import BY_NAME, STOP_REASONS
from mrl_driver.robot.hold import Hold
from mrl_driver.safety.wheel_monitor import DEAD, POWERLESS, REVERSED, Mismatch
from tests.models import model as load

from .robot import Robot

MOVE_MOTORS = BY_NAME["move_motors"].code
HELD = Hold("held", 1, 0, 0, 0x0013A20040000002)
STATUS_S = 1.2
"""The driver asks for the board's status once in this time."""


@pytest.fixture
def robot():
    """Its commands hold until they are stopped."""
    return Robot(load("traxbot"), options=DEFAULTS._replace(command_timeout_s=None))


def stands(robot, reason):
    return robot.motion.target is None and robot.motion.stop_reason == reason


# -- speeds that are refused


@pytest.mark.parametrize("odd", [math.nan, math.inf, -math.inf, 10**400], ids=str)
@pytest.mark.parametrize("place", range(3))
def test_a_speed_that_is_not_finite_is_refused_and_stops_the_robot(robot, odd, place):
    robot.drive(0.2)
    speeds = [0.1, 0.1, 0.0]
    speeds[place] = odd
    with pytest.raises(FrameError, match="expected finite speeds; the robot was stopped$"):
        robot.core.drive(speeds[0], speeds[1], robot.now, speeds[2])
    assert stands(robot, "not_a_number")


@pytest.mark.parametrize(
    ("lateral", "words"), [(0.0, r"drive\(nan, 0.5\): "), (0.1, r"drive\(nan, 0.5, 0.1\): ")]
)
def test_the_refusal_of_a_speed_names_what_was_given(robot, lateral, words):
    with pytest.raises(FrameError, match=words):
        robot.core.drive(math.nan, 0.5, robot.now, lateral)


def test_a_speed_to_the_side_stops_a_robot_that_cannot_move_so(robot):
    robot.drive(0.2)
    with pytest.raises(FrameError, match="cannot move sideways .*; the robot was stopped$"):
        robot.core.drive(0.1, 0.0, robot.now, 0.05)
    assert stands(robot, "user")


def test_speeds_are_sent_in_millimetres_and_milliradians_a_second(robot):
    assert robot.core.drive(0.1234, -0.4567, robot.now)
    assert robot.motion.target == (123, -457)


def test_speeds_after_limiting_keep_the_arc(robot):
    twist = robot.core.limited(99.0, 99.0)
    most = load("traxbot").limits
    assert twist[0] == twist[1] == min(most.linear_m_s, most.angular_rad_s)
    assert len(twist) == 2


# -- reasons to refuse commands


@pytest.mark.parametrize("reason", ["leaving", "inhibited"])
def test_refused_commands_do_not_keep_the_one_before_in_force(robot, reason):
    robot.motion.timeout_s = 0.5
    robot.drive(0.2)
    if reason == "leaving":
        robot.core.leaving = True
    else:
        robot.core.inhibited.add("a test")
    for _ in range(6):
        robot.run(0.1)
        assert not robot.drive(0.3)
    assert stands(robot, "command_timeout")


def test_a_board_that_is_only_identified_takes_no_command():
    core = Core(load("traxbot"), DEFAULTS._replace(identify=True))
    assert core.inhibited == {"the board is only identified"}
    assert Core(load("traxbot"), DEFAULTS).inhibited == set()


@pytest.mark.parametrize("speed", [0.2, 0.0])
def test_a_held_robot_takes_no_command_even_of_zero(robot, speed):
    robot.core.hold, robot.core.held = HELD, True
    assert not robot.drive(speed)
    assert robot.motion.target is None


def test_a_request_that_turns_motors_is_refused_to_a_held_robot(robot):
    robot.core.hold, robot.core.held = HELD, True
    with pytest.raises(MrlError, match="move_motors is refused, nothing was sent: .*holds the robot"):
        robot.core.require_may_turn(MOVE_MOTORS)


def test_a_request_that_turns_motors_is_refused_with_all_reasons(robot):
    robot.core.require_may_turn(MOVE_MOTORS)
    robot.core.inhibited.update({"second", "first"})
    with pytest.raises(MrlError, match=r"move_motors is refused .* \(first, second\), nothing was sent"):
        robot.core.require_may_turn(MOVE_MOTORS)
    robot.core.leaving = True
    with pytest.raises(MrlError, match=r"\(the driver is being closed\)"):
        robot.core.require_may_turn(MOVE_MOTORS)


# -- wheels


def test_a_wheel_that_does_not_follow_stops_the_robot_and_is_reported_once(robot):
    robot.board.dead = {"left"}
    robot.drive(0.2)
    robot.until(lambda: robot.core.mismatch is not None, 3.0)
    found = robot.core.mismatch
    assert (found.wheel, found.cause) == ("left", DEAD)
    assert stands(robot, "wheel_mismatch") and robot.seen(Mismatch) == [found]


@pytest.mark.parametrize("command", [(0.2, 0.0), (0.0, 1.0), (-0.2, 0.0), (0.1, -0.5)])
def test_wheels_that_follow_are_left_alone(robot, command):
    assert robot.drive(*command)
    robot.run(2.0)
    assert robot.motion.target == (round(1000 * command[0]), round(1000 * command[1]))
    assert robot.seen(Mismatch) == []


def test_after_a_mismatch_moves_are_refused_until_a_command_of_zero(robot):
    robot.core.mismatch = Mismatch("left", DEAD, 0.05, 0.0)
    assert not robot.drive(0.2) and not robot.drive(0.0, 0.2)
    assert robot.core.mismatch is not None and robot.motion.target is None
    assert robot.drive(0.0) and robot.core.mismatch is None
    assert robot.drive(0.2)


def test_after_a_mismatch_a_stop_lets_the_robot_drive_again(robot):
    robot.core.mismatch = Mismatch("left", DEAD, 0.05, 0.0)
    robot.core.stop(robot.now, "user")
    assert robot.drive(0.2)


def stopped_for_a_wheel(robot, cause):
    """Return the mismatch for which the driver has stopped a robot that drove."""
    robot.drive(0.2)
    robot.run(0.5)
    robot.core.stop(robot.now, "wheel_mismatch")
    robot.core.mismatch = Mismatch("both", cause, 0.05, 0.0)
    robot.run(0.5)
    return robot.core.mismatch


@pytest.mark.parametrize(("cause", "kept"), [(DEAD, False), (POWERLESS, False), (REVERSED, True)])
def test_wheels_that_the_boards_watchdog_has_stopped_are_no_mismatch(robot, cause, kept):
    """A wheel that ran in reverse is one."""
    stopped_for_a_wheel(robot, cause)
    robot.board.stop_reason = STOP_REASONS.index("link_watchdog")
    robot.run(STATUS_S)
    assert (robot.core.mismatch is not None) == kept
    assert robot.motion.stop_reason == "link_watchdog"


@pytest.mark.parametrize("reason", ["none", "host", "stall", "wheel_blocked", "encoder"])
def test_a_mismatch_stays_one_whatever_else_the_board_says(robot, reason):
    found = stopped_for_a_wheel(robot, DEAD)
    robot.board.stop_reason = STOP_REASONS.index(reason)
    robot.run(STATUS_S)
    assert robot.core.mismatch == found


@pytest.mark.parametrize("reason", ["wheel_blocked", "encoder"])
def test_a_stop_of_the_board_for_a_wheel_is_a_mismatch(robot, reason):
    robot.drive(0.2)
    robot.run(STATUS_S)
    robot.board.speeds, robot.board.stop_reason = (0, 0), STOP_REASONS.index(reason)
    receive = robot.board.receive
    robot.board.receive = lambda data, now: b"@11," in data or receive(data, now)  # it refuses moves
    robot.core.session.request(BY_NAME["read_status"].code)
    robot.until(lambda: robot.motion.target is None, 0.1)
    assert robot.seen(Mismatch) == [Mismatch("", reason)] == [robot.core.mismatch]
    assert not robot.drive(0.2)


# -- battery


def test_motor_power_that_is_off_stops_the_robot_at_once(robot):
    robot.drive(0.2)
    robot.run(0.1)
    robot.board.battery = 30
    robot.until(lambda: robot.motion.target is None, 3.0)
    assert stands(robot, "battery") and not robot.drive(0.2)


def gentle_stop_s(robot, linear_m_s):
    """Duration of the stop after the battery is found empty [s]; the commands go on."""
    robot.until_empty(linear_m_s)
    begin_s = robot.now
    robot.until(lambda: robot.drive(linear_m_s) or robot.motion.target is None)
    return robot.now - begin_s


@pytest.mark.parametrize("linear_m_s", [0.1, -0.1, 0.2])
def test_an_empty_battery_stops_the_robot_as_gently_as_its_model_accelerates(robot, linear_m_s):
    by_model_s = abs(linear_m_s) / load("traxbot").limits.linear_acceleration_m_s2
    assert gentle_stop_s(robot, linear_m_s) == pytest.approx(by_model_s, abs=0.15)
    assert stands(robot, "battery")


def test_the_gentle_stop_takes_three_seconds_at_most():
    traxbot = load("traxbot")
    slow = traxbot._replace(limits=traxbot.limits._replace(linear_acceleration_m_s2=0.01))
    assert gentle_stop_s(Robot(slow), 0.2) == pytest.approx(GENTLE_S, abs=0.15)


def test_a_command_of_zero_ends_the_gentle_stop_at_once(robot):
    robot.until_empty(0.2)
    assert not robot.drive(0.0)
    assert stands(robot, "battery")


# -- stream


@pytest.mark.parametrize(("period_ms", "rate_hz"), [(20, 50), (50, 20), (100, 10), (200, 5)])
def test_listeners_get_the_telemetry_at_the_period_that_they_want(period_ms, rate_hz):
    """Of a period above 50 ms they get every n-th frame, and the board streams so fast that silence is noticed."""
    robot = Robot(load("traxbot"), options=DEFAULTS._replace(period_ms=period_ms))
    robot.run(0.5)
    robot.events.clear()
    robot.run(2.0)
    assert len(robot.seen(type(robot.core.state.telemetry))) == pytest.approx(2.0 * rate_hz, abs=1)
    assert robot.board.period_s == pytest.approx(min(period_ms, 50) / 1000)


# -- answers


def test_an_answer_to_another_index_does_not_count(robot):
    code = BY_NAME["read_config"].code
    robot.core.replies[code] = (3, 77)
    assert robot.core.answer(code, (3,)) == (3, 77)
    assert robot.core.answer(code, (4,)) is None
    assert robot.core.answer(MOVE_MOTORS, ()) is None


# -- ramps


def test_a_command_accelerates_from_rest_by_the_limits_after_a_stop(robot):
    """And not from the speed before the stop."""
    robot.core.limiter.limits = load("traxbot").limits._replace(linear_acceleration_m_s2=0.5)
    for _ in range(2):
        robot.drive(0.3)
        assert 0 < robot.motion.target[0] < 100
        robot.run(2.0)
        assert robot.motion.target == (300, 0)
        robot.core.stop(robot.now, "user")


def test_a_command_accelerates_from_rest_after_one_that_has_run_out(robot):
    robot.core.limiter.limits = load("traxbot").limits._replace(linear_acceleration_m_s2=0.5)
    robot.drive(0.3)
    robot.run(2.0)
    robot.motion.timeout_s = 0.1
    robot.drive(0.3)
    robot.run(0.5)
    assert stands(robot, "command_timeout")
    robot.drive(0.3)
    assert 0 < robot.motion.target[0] < 100


def test_a_speed_that_is_reached_is_sent_to_the_millimetre(robot):
    robot.core.limiter.limits = load("traxbot").limits._replace(linear_acceleration_m_s2=0.5)
    robot.core.drive(0.2996, 0.0, robot.now)
    robot.run(2.0)
    assert robot.motion.target == (300, 0)
    assert robot.board.speeds == (300, 0)


def test_limits_that_are_asked_for_again_start_no_command(robot):
    robot.core.limit_again(robot.now)
    assert robot.motion.target is None
    robot.drive(0.2)
    robot.core.stop(robot.now, "user")
    robot.core.limit_again(robot.now)
    assert robot.motion.target is None


def test_a_refusal_is_false_and_not_nothing(robot):
    robot.core.held = True
    assert robot.drive(0.1) is False
    robot.core.held = False
    robot.core.leaving = True
    assert robot.drive(0.1) is False


def test_a_new_robot_is_not_held_and_due_at_once():
    core = Core(load("traxbot"), DEFAULTS)
    assert (core.held, core.hold, core.leaving, core.mismatch) == (False, None, False, None)
    assert core.due_s == -math.inf


def test_a_stop_of_the_board_is_reported_once(robot):
    """Although the command that follows is refused."""
    robot.drive(0.2)
    robot.run(STATUS_S)
    robot.board.speeds, robot.board.stop_reason = (0, 0), STOP_REASONS.index("encoder")
    receive = robot.board.receive
    robot.board.receive = lambda data, now: b"@11," in data or receive(data, now)
    robot.core.session.request(BY_NAME["read_status"].code)
    robot.until(lambda: robot.core.mismatch is not None, 0.1)
    robot.drive(0.0)
    robot.run(0.1)
    assert robot.core.mismatch is None and len(robot.seen(Mismatch)) == 1


@pytest.mark.parametrize("wait_s", [0.0, 0.3])
def test_wheels_are_judged_by_the_command_in_force_after_a_stop(robot, wait_s):
    """The stop does not count as motion that is missing."""
    robot.drive(0.3)
    robot.run(1.0)
    robot.core.stop(robot.now, "user")
    robot.run(wait_s)
    robot.drive(-0.3)
    robot.run(1.0)
    assert robot.seen(Mismatch) == [] and robot.motion.target == (-300, 0)
