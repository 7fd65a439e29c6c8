"""What the driver's core refuses and stops, and by which reason, on a fake board in simulated time."""

import math

import pytest

from mrl_driver.driver.options import DEFAULTS
from mrl_driver.driver.robot_core import Core
from mrl_driver.errors import FrameError, MrlError
from mrl_driver.protocol import encode_reply
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot.hold import READ_RADIO, Hold
from mrl_driver.robot.radio import text_request
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.safety.speed_limiter import reduced
from mrl_driver.safety.wheel_monitor import DEAD, POWERLESS, REVERSED, Mismatch
from mrl_driver.session.events import Ready, Reply, SensorRead, Stale
from mrl_driver.session.handshake import Board
from mrl_driver.session.session import STALE_S
from tests.fake_board import SEPARATION_M
from tests.models import model as load
from tests.radio_board import PEER, RadioBoard

from .robot import Robot

MOVE_MOTORS = BY_NAME["move_motors"].code
HELD = Hold("held", 1, 0, 0, 0x0013A20040000002)
STATUS_S = 1.2  # The driver asks for the board's status once in this time
FRAME_S = 0.02  # Period of the fake board's stream
OMNI_STREAM, SENSOR_STREAM = BY_NAME["start_omni_stream"].code, BY_NAME["start_sensor_ldr_stream"].code


@pytest.fixture
def robot():
    """Its commands hold until they are stopped."""
    return Robot(load("traxbot"), options=DEFAULTS._replace(command_timeout_s=None))


def joined(name, stream, limits=None):
    """A core that goes on with a board of this model, which was greeted at 0 s and is not simulated."""
    made = load(name)
    core = Core(made if limits is None else made._replace(limits=limits), DEFAULTS)
    core.begin(0.0)
    core.join(Board(made.ids[0], 2, 1.72, 12.0, 25.0, 2, frozenset()), stream, False, 0.0)
    return core


def stands(robot, reason):
    return robot.motion.target is None and robot.motion.stop_reason == reason


@pytest.mark.parametrize(
    "speeds", [(math.nan, 0.1, 0.0), (math.inf, -math.inf, 0.0), (0.1, 0.1, math.inf), (True, False, True)]
)
def test_a_speed_that_is_not_finite_is_refused_and_stops_the_robot(robot, speeds):
    robot.drive(0.2)
    with pytest.raises(FrameError, match="_s is .*, expected a finite number; the robot was stopped$"):
        robot.core.drive(speeds[0], speeds[1], robot.now, speeds[2])
    assert stands(robot, "not_a_number")


def test_a_speed_to_the_side_stops_a_robot_that_cannot_move_so(robot):
    robot.drive(0.2)
    with pytest.raises(FrameError, match="cannot move sideways .*; the robot was stopped$"):
        robot.core.drive(0.1, 0.0, robot.now, 0.05)
    assert stands(robot, "user")


def test_speeds_are_sent_in_millimetres_and_milliradians_a_second(robot):
    assert robot.core.drive(0.1234, -0.9994, robot.now)
    assert robot.motion.target == (123, -999)


def test_speeds_after_limiting_keep_the_arc(robot):
    twist = robot.core.limited(99.0, 99.0)
    most = load("traxbot").limits
    assert twist[0] == twist[1] == min(most.linear_m_s, most.angular_rad_s)
    assert len(twist) == 2


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


def test_a_command_goes_on_when_the_radio_says_that_nothing_holds_the_robot(robot):
    robot.drive(0.2)
    robot.core.turn(encode_reply(READ_RADIO, 1, 0, 0, 0, 0, 0, 0, 0, checked=True), robot.now)
    assert robot.core.hold == Hold("free", 0, 0, 0, 0) and robot.motion.target == (200, 0)


def test_a_request_that_turns_motors_is_refused_to_a_held_robot(robot):
    robot.core.hold, robot.core.held = HELD, True
    with pytest.raises(MrlError, match="move_motors is refused, nothing was sent: .*holds the robot"):
        robot.core.require_may_turn(MOVE_MOTORS, robot.now)


def test_a_request_that_turns_motors_is_refused_with_all_reasons(robot):
    robot.core.require_may_turn(MOVE_MOTORS, robot.now)
    robot.core.inhibited.update({"second", "first"})
    with pytest.raises(MrlError, match=r"move_motors is refused .* \(first, second\), nothing was sent"):
        robot.core.require_may_turn(MOVE_MOTORS, robot.now)
    robot.core.leaving = True
    with pytest.raises(MrlError, match=r"\(the driver is being closed\)"):
        robot.core.require_may_turn(MOVE_MOTORS, robot.now)


def test_a_wheel_that_does_not_follow_stops_the_robot_and_is_reported_once(robot):
    robot.board.dead = {"left"}
    robot.drive(0.2)
    robot.until(lambda: robot.core.mismatch is not None, 3.0)
    found = robot.core.mismatch
    assert (found.wheel, found.cause) == ("left", DEAD)
    assert stands(robot, "wheel_mismatch") and robot.seen(Mismatch) == [found]


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


@pytest.mark.parametrize(("share", "stops"), [(0.9995, False), (1.0001, True)])
def test_the_gentle_stop_ends_to_the_millisecond(robot, share, stops):
    robot.until_empty(0.3)
    end_s = robot.now + 0.3 / load("traxbot").limits.linear_acceleration_m_s2 * share
    robot.run(end_s - robot.now - 0.02)
    robot.core.turn(b"", end_s)
    assert (robot.motion.target is None) == stops


def test_a_slide_to_the_side_ends_gently_as_well():
    """At 20 mm/s and 10 mm/s2 it takes 2 s; the wheels are too slow to be judged."""
    core = joined("omni", OMNI_STREAM, load("omni").limits._replace(linear_acceleration_m_s2=0.01))
    core.session.motion.timeout_s = None
    core.drive(0.0, 0.0, 0.0, 0.02)
    frames = encode_reply(OMNI_STREAM, 0, 0, 0, 120, 45, 645) + encode_reply(5, 2500, 172, 840, 2, 21)
    now, empty_s = 0.0, None
    while core.session.motion.target is not None:
        now += 0.05
        assert now < 20.0
        core.turn(frames, now)
        empty_s = now if core.state.powerless and empty_s is None else empty_s
    assert now - empty_s == pytest.approx(2.0, abs=0.06)


def test_an_empty_battery_leaves_a_robot_that_stands_alone(robot):
    robot.core.stop(robot.now, "user")
    robot.board.battery = 840
    robot.until(lambda: robot.core.state.powerless)
    assert stands(robot, "user") and not robot.drive(0.2)


def test_the_gentle_stop_takes_three_seconds_at_most():
    traxbot = load("traxbot")
    slow = traxbot._replace(limits=traxbot.limits._replace(linear_acceleration_m_s2=0.01))
    assert gentle_stop_s(Robot(slow), 0.2) == pytest.approx(3.0, abs=0.15)


def test_a_command_of_zero_ends_the_gentle_stop_at_once(robot):
    robot.until_empty(0.2)
    assert not robot.drive(0.0)
    assert stands(robot, "battery")


@pytest.mark.parametrize(
    ("period_ms", "board_ms"), [(20, 20), (50, 50), (51, 26), (100, 50), (101, 34), (200, 50)]
)
def test_listeners_get_the_telemetry_at_the_period_that_they_want(period_ms, board_ms):
    """Of a period above 50 ms they get every n-th frame, and the board streams so fast that silence is noticed."""
    robot = Robot(load("traxbot"), options=DEFAULTS._replace(period_ms=period_ms))
    robot.run(0.5)
    robot.events.clear()
    robot.run(2.0)
    assert len(robot.seen(type(robot.core.state.telemetry))) == pytest.approx(2000 / period_ms, rel=0.1)
    assert robot.board.period_s == pytest.approx(board_ms / 1000)


def test_an_answer_to_another_index_does_not_count(robot):
    code = BY_NAME["read_config"].code
    robot.core.replies[code] = (3, 77)
    assert robot.core.answer(code, (3,)) == (3, 77)
    assert robot.core.answer(code, (4,)) is None
    assert robot.core.answer(MOVE_MOTORS, ()) is None


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


def test_a_stop_of_a_tall_robot_is_sent_at_once_and_a_command_of_zero_is_not(robot):
    robot.core.limiter.limits = load("traxbot").limits._replace(braking_m_s2=0.5)
    robot.drive(0.3)
    robot.run(2.0)
    robot.drive(0.0)
    assert 250 <= robot.motion.target[0] < 300
    robot.core.stop(robot.now, "user")
    robot.run(FRAME_S)
    assert robot.board.speeds == (0, 0)


def test_accelerations_of_a_model_that_limits_braking_are_in_force_from_the_start():
    tall = load("traxbot").limits._replace(braking_m_s2=0.5)
    assert joined("traxbot", BY_NAME["start_stream"].code, tall).limiter.limits == tall


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


def test_a_new_range_in_a_frame_that_is_left_out_comes_with_the_next_one():
    robot = Robot(load("traxbot"), options=DEFAULTS._replace(period_ms=200))
    robot.events.clear()
    robot.run(1.0)
    fresh = [name for each in robot.seen(Telemetry) for name in each.fresh]
    assert all(fresh.count(name) >= 3 for name in ("front", "left", "right"))


def repeat_s(robot):
    """Time at which the command in force is to be sent again, in a frame or less; nothing else is due before."""
    robot.drive(0.2)
    robot.until(lambda: robot.motion.due_s == robot.core.due_s < robot.now + FRAME_S + 1e-3)
    return robot.core.due_s


@pytest.mark.parametrize(("early_s", "sent"), [(0.0, True), (0.001, False)])
def test_a_command_is_repeated_at_its_time_and_not_before(robot, early_s, sent):
    due_s = repeat_s(robot)
    robot.core.turn(b"", due_s - early_s)
    assert (robot.core.session.take() != b"") == sent


@pytest.mark.parametrize(("early_s", "sent"), [(0.019, True), (0.021, False)])
def test_a_command_is_repeated_with_the_last_frame_before_its_time(robot, early_s, sent):
    due_s = repeat_s(robot)
    robot.core.turn(b"\n", due_s - early_s)
    assert (robot.core.session.take() != b"") == sent


def test_a_command_that_waited_during_a_pause_is_refused_even_if_its_first_speed_is_zero():
    robot = Robot(load("traxbot"), options=DEFAULTS._replace(queued_s=0.1))
    robot.core.limiter.limits = load("traxbot").limits._replace(linear_acceleration_m_s2=0.001)
    robot.now += 0.255
    assert not robot.drive(0.2)


def test_each_of_two_replies_in_one_piece_gives_its_event():
    core = joined("pioneer", SENSOR_STREAM)
    events = core.turn(
        encode_reply(BY_NAME["read_alcohol"].code, 100) + encode_reply(BY_NAME["read_dust"].code, 7), 0.1
    )
    assert [event.name for event in events if isinstance(event, SensorRead)] == ["alcohol", "dust"]


def test_a_reply_that_comes_when_the_telemetry_has_ended_is_seen_before_its_end():
    core = joined("pioneer", SENSOR_STREAM)
    events = core.turn(encode_reply(BY_NAME["read_alcohol"].code, 100), STALE_S)
    assert [type(event) for event in events if not isinstance(event, Reply)] == [SensorRead, Stale]


def test_a_core_that_joins_is_ready_and_due_at_once(robot):
    core = Core(load("traxbot"), DEFAULTS)
    core.begin(0.0)
    core.turn(b"", 0.0)
    assert core.due_s > 0.0
    session = robot.core.session
    events = core.join(session.board, session.stream_code, True, 1.0)
    assert [type(event) for event in events] == [Ready]
    assert core.due_s == -math.inf and core.state.telemetry is None
    assert core.drive(0.2, 0.0, 1.0)


def test_limits_that_were_changed_hold_after_a_restart_of_the_board(robot):
    slower = load("traxbot").limits._replace(linear_m_s=0.1)
    robot.core.limiter.change(slower)
    robot.events.clear()
    robot.board.reset(robot.now)
    robot.until(lambda: robot.seen(Ready))
    assert robot.core.limiter.limits == slower


def radio_robot():
    return Robot(load("traxbot"), board=RadioBoard())


def test_a_text_that_waits_for_the_radio_is_due_when_its_line_is_free():
    robot = radio_robot()
    for _ in range(2):
        robot.core.send_by_radio(text_request(PEER, "x" * 16), robot.now)
    assert robot.core.session.hurried
    robot.core.turn(b"", robot.now)
    assert robot.core.due_s <= robot.core.radio_queue.due_s == pytest.approx(robot.now + 340 / 9600)


def test_a_joystick_in_manual_mode_slides_the_same_way_as_in_automatic_mode():
    """At most at the speed of manual mode, on a base that is slower to the side."""
    core, limits = joined("omni", OMNI_STREAM), load("omni").limits._replace(lateral_m_s=0.1)
    core.limiter.change(limits)
    automatic = [core.limited(0.3, 1.5, 0.1), core.limited(0.0, 0.0, 0.3)]
    core.limiter.change(reduced(limits, 0.15))
    manual = [core.limited(0.3, 1.5, 0.1), core.limited(0.0, 0.0, 0.3)]
    assert manual == [pytest.approx([speed / 2 for speed in twist]) for twist in automatic]


def run_out(robot):
    """A command whose time ends."""
    robot.motion.timeout_s = 0.1
    robot.drive(0.2)
    robot.until(lambda: robot.motion.target is None)


def test_the_limiter_has_no_target_while_the_robot_stands(robot):
    run_out(robot)
    robot.run(FRAME_S)
    assert robot.core.limiter.target is None
    robot.drive(0.2)
    robot.core.stop(robot.now, "user")
    assert robot.core.limiter.target is None


def test_wheels_that_stand_are_found_after_a_restart_of_the_board(robot):
    """Its time starts at zero again; the command comes before its first frame."""
    robot.drive(0.2)
    robot.run(3.0)
    robot.events.clear()
    robot.board.reset(robot.now)
    robot.until(lambda: robot.seen(Ready))
    robot.board.dead = {"left"}
    robot.drive(0.2)
    robot.until(lambda: robot.core.mismatch is not None, 1.5)
    assert stands(robot, "wheel_mismatch")


def test_a_command_is_judged_by_itself_after_one_that_has_run_out(robot):
    """A wheel that stands is found after half a second; two commands of 0.35 s are each too short."""
    robot.board.dead = {"left"}
    robot.motion.timeout_s = 0.05
    for _ in range(2):
        for _ in range(35):
            assert robot.drive(0.3)
            robot.step()
        robot.until(lambda: robot.motion.target is None)
        robot.run(FRAME_S)
    assert robot.seen(Mismatch) == []


class Delay:
    """Bytes arrive this much later [s], and never before older ones; the board's clock shows it."""

    def __init__(self, robot):
        self.robot, self.delay_s, self.waiting = robot, 0.0, []

    def __call__(self, data):
        self.waiting.append((self.robot.now + self.delay_s, data))
        due = [number for number, (due_s, _) in enumerate(self.waiting, 1) if due_s <= self.robot.now + 1e-6]
        ready, self.waiting = self.waiting[: max(due, default=0)], self.waiting[max(due, default=0) :]
        return b"".join(data for _, data in ready)


@pytest.mark.parametrize(("delay_s", "judged"), [(0.08, True), (0.12, False)])
def test_wheels_are_judged_by_frames_that_are_less_than_100_ms_old(robot, delay_s, judged):
    """Later ones were made while commands were late too, or held back."""
    robot.to_host = delay = Delay(robot)
    robot.run(1.0)
    robot.drive(0.3)
    robot.board.dead = {"left"}
    delay.delay_s = delay_s
    robot.run(1.0)
    assert (robot.core.mismatch is not None) == judged


@pytest.mark.parametrize(("hold_up_s", "judged"), [(0.08, True), (0.12, False)])
def test_a_late_frame_starts_the_judgement_of_wheels_again(robot, hold_up_s, judged):
    robot.to_host = delay = Delay(robot)
    robot.run(1.0)
    robot.board.dead = {"left"}
    robot.drive(0.3)
    robot.run(0.3)
    delay.delay_s = hold_up_s
    robot.run(hold_up_s)
    delay.delay_s = 0.0
    robot.run(0.3)
    assert (robot.core.mismatch is not None) == judged


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_a_command_that_the_next_one_replaces_at_once_is_judged_too(robot, frames):
    """For 0.8 s a wheel may still follow the first, whenever it came between two comparisons."""
    robot.drive(0.3)
    robot.run(1.0)
    robot.drive(0.0)
    robot.run(0.5 + frames * FRAME_S)
    robot.drive(-0.03)
    robot.run(FRAME_S)
    receive = robot.board.receive
    robot.board.watches = False
    robot.board.receive = lambda data, now: b"@11," in data or receive(data, now)  # the wheels run on
    robot.drive(0.3)
    robot.run(0.8)
    assert robot.seen(Mismatch) == []


def expected_m(linear_m_s, angular_rad_s):
    """The least distance of a wheel that stands, when it is found."""
    robot = Robot(load("traxbot"), options=DEFAULTS._replace(command_timeout_s=None))
    robot.board.dead = {"left"}
    robot.drive(linear_m_s, angular_rad_s)
    robot.until(lambda: robot.core.mismatch is not None, 3.0)
    return robot.core.mismatch.expected_m


def test_a_wheel_is_judged_by_its_speed_whether_the_robot_drives_or_turns():
    speed_m_s = 0.027
    driven_m, turned_m = expected_m(speed_m_s, 0.0), expected_m(0.0, speed_m_s * 2 / SEPARATION_M)
    assert driven_m == pytest.approx(turned_m, rel=1e-4)


@pytest.fixture
def timed():
    return Robot(load("traxbot"))


def test_a_command_of_zero_is_a_command_while_the_battery_is_good(timed):
    timed.drive(0.2)
    assert timed.drive(0.0) and timed.motion.target == (0, 0)
    assert timed.motion.stop_reason == "none"


@pytest.mark.parametrize("goes_on, reason", [(True, "battery"), (False, "command_timeout")])
def test_the_gentle_stop_of_an_empty_battery_lasts_while_commands_come(timed, goes_on, reason):
    """The commands are refused, but show that their source is alive."""
    timed.until_empty(0.3)
    timed.until(lambda: (goes_on and timed.drive(0.3)) or timed.motion.target is None)
    assert timed.motion.stop_reason == reason


def test_a_restriction_holds_in_the_gentle_stop_of_an_empty_battery(timed):
    """As of a protective zone with an obstacle in it."""
    timed.until_empty(0.3)
    timed.core.limiter.restrict = lambda speeds, now: (0.0, 0.0)
    before = len(timed.board.moves)
    timed.until(lambda: len(timed.board.moves) > before)
    assert timed.board.moves[-1] == (0, 0)


def test_a_command_of_zero_with_an_empty_battery_leaves_the_reason_of_a_stop(timed):
    timed.until_empty(0.2)
    timed.core.stop(timed.now, "user")
    timed.drive(0.0)
    assert timed.motion.stop_reason == "user"


def test_a_board_that_was_taken_for_one_with_three_wheels_gets_the_commands_of_two():
    """Its plain answers were damaged; what it says under the checksum counts."""
    omni = b"@5,2500,172,1200,2,%de" % load("omni").ids[0]
    robot = Robot(None, lambda data: data.replace(b"@5,2500,172,1200,2,1e", omni))
    assert robot.drive(0.2)
    robot.until(lambda: robot.board.moves)
    assert robot.board.moves == [(200, 0)] and robot.core.state.model.name == "traxbot"
