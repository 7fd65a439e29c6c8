"""Wheels that do not do what they are told, and all the driving in which they do, on the emulated motors.

The limits need no motors: readings are `DT_S` apart there, so that numbers are exact.
"""

import math
from types import SimpleNamespace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.driver.options import DEFAULTS
from mrl_driver.driver.robot_core import Core
from mrl_driver.problems import PROBLEMS
from mrl_driver.robot.kinematics import Planar, kinematics_of
from mrl_driver.robot.models import Drive
from mrl_driver.robot.odometry import WHEELS_BY_COUNT, FourWheels, Wheels
from mrl_driver.safety.wheel_monitor import (
    COAST_M_S2,
    DEAD,
    FAST,
    FAST_SHARE,
    FAST_TICKS,
    POWERLESS,
    REVERSED,
    STILL_TICKS,
    TICK_S,
    Mismatch,
    WheelMonitor,
    monitor_of,
)
from mrl_driver.session.motion_command import QUICK, SLOW
from mrl_driver.view.words import stop_error
from sim_arduino.hardware.omni3md import Omni3MD
from sim_arduino.hardware.robot_physics import RobotPhysics, params_for
from tests.fake_board import FakeBoard
from tests.models import four_wheels
from tests.models import model as load

NOTICED_S = 0.5
FRAME_S, FRAME_2013_S = 0.02, 1 / 325
LOOKED_AT_S, LOOKED_AT_2013_S = 3 * FRAME_S, 17 * FRAME_2013_S
"""The frames that the watch looks at: the first ones after TICK_S."""
MODELS = ("traxbot", "stingbot")


def sound(right, left):
    return right, left


def counting(right_share, left_share):
    """A fault from the next reading on: encoders that count a share of the way, 0 or -1 of it."""

    def begun(drive):
        at = drive.travel()
        return lambda right, left: (
            at.right + right_share * (right - at.right),
            at.left + left_share * (left - at.left),
        )

    return begun


frozen_left, both_frozen = counting(1, 0), counting(0, 0)
FAULTS = [
    (counting(0, 1), "right", DEAD),
    (frozen_left, "left", DEAD),
    (counting(-1, 1), "right", REVERSED),
    (counting(1, -1), "left", REVERSED),
    (both_frozen, "both", POWERLESS),
]


class Motors:
    """A robot's motors and board, its counts as the driver gets them, and the watch."""

    def __init__(self, name="traxbot", control_hz=20, frame_s=FRAME_S, pace=QUICK, volts=12.0):
        model = load(name)
        self.robot = RobotPhysics(params_for(model)._replace(control_hz=control_hz))
        self.robot.set_battery(volts)
        self.motors = Omni3MD(self.robot, model)
        self.motors.set_gains(0, *(model.board[key] for key in ("kp", "ki", "kd")))
        self.motors.set_ramp(0, model.board["ramp_time"], model.board["ramp_gain"])
        self.watch = monitor_of(model, pace)
        self.frame_s, self.now, self.told = frame_s, 0.0, (0.0, 0.0)
        self.fault = sound
        self.found = None

    def travel(self):
        left, _, right = (math.floor(motor.travel) for motor in self.robot.motors)
        return Wheels(*self.fault(right, left))

    def command(self, linear_m_s, angular_rad_s):
        self.told = linear_m_s, angular_rad_s
        self.motors.move_differential(self.now, round(linear_m_s * 1000), round(angular_rad_s * 1000))

    def run(self, seconds, late=None):
        """Until a mismatch; `late` is a command that is in force already, and reaches the motors on the way."""
        end, due = self.now + seconds, math.inf
        if late:
            self.told, due = late[1:], self.now + late[0]
            self.look(self.now)
        while self.now < end and self.found is None:
            self.look(min(self.now + self.frame_s, max(due, self.now), end))
            if self.now >= due:
                self.command(*self.told)
                due = math.inf
        return self.found

    def look(self, now):
        """What the watch says of a frame at that time."""
        self.now = now
        self.motors.advance(now)
        self.found = self.found or self.watch.update(*self.told, self.travel(), now)


SPEEDS = [(0.3, 0.0), (-0.2, 0.0), (0.0, 1.0), (0.2, -0.5), (0.05, 0.0)]


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("speeds", SPEEDS)
@pytest.mark.parametrize(("fault", "wheel", "cause"), FAULTS)
def test_a_wheel_that_fails_on_the_move_is_named_in_time(name, speeds, fault, wheel, cause):
    drive = Motors(name)
    drive.command(*speeds)
    assert drive.run(4.0) is None
    drive.fault, failed_s = fault(drive), drive.now
    found = drive.run(2.0)
    assert (found.wheel, found.cause) == (wheel, cause)
    assert drive.now - failed_s <= NOTICED_S


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("speeds", SPEEDS)
@pytest.mark.parametrize(("shares", "wheel"), [((2, 1), "right"), ((1, 2), "left")])
def test_a_wheel_that_runs_twice_as_fast_as_commanded_is_named(name, speeds, shares, wheel):
    """As with another wheel size or gearbox in the board than in the robot's file."""
    drive = Motors(name)
    drive.command(*speeds)
    assert drive.run(4.0) is None
    drive.fault = counting(*shares)(drive)
    found = drive.run(1.0)
    assert (found.wheel, found.cause) == (wheel, FAST)
    assert f"expected at most {1000 * found.expected_m:.0f} mm" in str(found)


@pytest.mark.parametrize("phase", range(10))
@pytest.mark.parametrize(
    "frame_s, pace, noticed_s",
    [(0.005, QUICK, NOTICED_S), (0.05 - 30e-6, QUICK, NOTICED_S - 0.1), (FRAME_2013_S, SLOW, NOTICED_S)],
    ids=["quick stream", "monitor's own period", "2013 board"],
)
def test_the_moment_of_the_fault_does_not_matter(phase, frame_s, pace, noticed_s):
    """Board times are whole ticks, so that some frames of a stream at the monitor's period come a little early."""
    drive = Motors(frame_s=frame_s, pace=pace)
    drive.command(0.2, 0.0)
    assert drive.run(4.0 + phase * 0.005) is None
    drive.fault, failed_s = frozen_left(drive), drive.now
    assert drive.run(2.0).wheel == "left"
    assert drive.now - failed_s <= noticed_s


@pytest.mark.parametrize(("fault", "wheel", "cause"), FAULTS)
def test_a_robot_that_cannot_start_is_noticed_within_a_second(fault, wheel, cause):
    """The ramp takes 2.5 s to full speed, so there is little to see at first."""
    drive = Motors()
    drive.fault = fault(drive)
    drive.command(0.3, 0.0)
    assert drive.run(1.0) is not None
    assert (drive.found.wheel, drive.found.cause) == (wheel, cause)


COMMANDS = st.lists(
    st.tuples(
        st.one_of(st.sampled_from([-0.3, 0.0, 0.3]), st.floats(-0.3, 0.3), st.floats(-0.03, 0.03)),
        st.one_of(st.sampled_from([-1.0, 0.0, 1.0]), st.floats(-1.0, 1.0), st.floats(-0.1, 0.1)),
        st.sampled_from([0.05, 0.1, 0.3, 1.0, 3.0]),
        st.floats(0.0, 1.0),
    ),
    min_size=1,
    max_size=12,
)


@settings(max_examples=60, deadline=None)
@given(COMMANDS, st.sampled_from(MODELS), st.sampled_from([10, 20, 40]), st.booleans(), st.floats(8.5, 13.8))
def test_no_driving_is_a_mismatch(commands, name, control_hz, old, volts):
    """Ramps, reversals, turns in place, creeping, late commands, at each control rate and state of charge."""
    frame_s, pace, late_s = (LOOKED_AT_2013_S, SLOW, 0.5) if old else (LOOKED_AT_S, QUICK, 0.12)
    drive = Motors(name, control_hz, frame_s, pace, volts)
    for linear, angular, seconds, lateness in commands:
        assert drive.run(seconds, (min(late_s * lateness, seconds), linear, angular)) is None


@pytest.mark.parametrize("name", MODELS)
def test_a_motor_that_breaks_loose_late_is_no_mismatch(name):
    """Friction holds it until the control has built up voltage."""
    drive = Motors(name)
    drive.fault = both_frozen(drive)
    drive.command(0.3, 0.0)
    assert drive.run(0.45) is None
    drive.fault = sound
    assert drive.run(2.0) is None


DT_S = 0.0625
FAST_M_S2, SLOW_M_S2 = 4.0, 0.4
"""Accelerations by the model.  With the first, a wheel is expected to be at SPEED_M_S at the next reading."""
SPEED_M_S = 0.125
STEP_M = SPEED_M_S * DT_S
MICROMETRE = 1e-6
WINDOW_READINGS = 5
LATENCY_TICKS = 3
TWENTIETHS_S = [number / 20 for number in range(6)]


class Watch:
    """A monitor of two wheels, with what it is given."""

    def __init__(self, acceleration_m_s2=FAST_M_S2, latency_s=0.05, metres_per_count=MICROMETRE):
        self.monitor = WheelMonitor(Drive(0.5, metres_per_count), acceleration_m_s2, latency_s)
        self.now_s, self.travel = 0.0, 0

    def read(self, command_m_s, counts=0, dt_s=DT_S):
        """Return what it says of a reading after `dt_s`, in which both wheels made these counts."""
        self.now_s += dt_s
        self.travel += counts
        return self.monitor.update(command_m_s, 0.0, Wheels(self.travel, self.travel), self.now_s)

    def follow(self, command_m_s, readings=20):
        """The wheels run at the commanded speed."""
        for _ in range(readings):
            assert self.read(command_m_s, round(command_m_s * DT_S / MICROMETRE)) is None

    def first(self, command_m_s, counts=0, dt_s=DT_S):
        """Return at which reading a mismatch is found, from 1, and the mismatch."""
        for number in range(1, 100):
            found = self.read(command_m_s, counts, dt_s)
            if found:
                return number, found
        return None, None


def started(*args, **kwargs):
    """A monitor that has had its first reading, of a robot that stands without a command."""
    watch = Watch(*args, **kwargs)
    watch.read(0.0)
    return watch


def ticked(*moves):
    """A monitor with a late model at its own pace, and what it says first: command, speed of both wheels, ticks."""
    watch = Watch(0.2, latency_s=(LATENCY_TICKS - 0.5) * TICK_S)
    watch.tick = lambda command, speed: watch.read(
        command, round(speed * TICK_S / MICROMETRE), 1.001 * TICK_S
    )
    found = [watch.tick(command, speed) for command, speed, ticks in moves for _ in range(ticks)]
    return watch, next(filter(None, found), None)


@pytest.mark.parametrize(("latency_s", "readings"), [(0.0, 0), (0.05, 1), (0.051, 2), (0.1, 2), (0.31, 7)])
def test_a_wheel_that_does_not_start_is_judged_five_readings_after_the_latest_arrival_of_its_command(
    latency_s, readings
):
    assert started(latency_s=latency_s).first(SPEED_M_S)[0] == readings + WINDOW_READINGS


def test_a_turn_on_tracks_is_judged_by_what_the_board_commands_which_knows_no_slip():
    """0.5 rad/s on 0.5 m are 0.125 m/s for each wheel; both stand for five readings."""
    monitor = WheelMonitor(Drive(0.5, MICROMETRE, turn_slip=0.3), FAST_M_S2, 0.0)
    found = [monitor.update(0.0, 0.5, Wheels(0, 0), reading * DT_S) for reading in range(7)]
    assert found[-1].expected_m == pytest.approx(SPEED_M_S * WINDOW_READINGS * DT_S)


def test_the_latency_of_a_model_is_the_repetition_of_its_commands_and_a_twentieth_of_a_second():
    """0.17 s are four readings."""
    monitor, now_s = monitor_of(load("traxbot"), QUICK._replace(repeat_s=0.12)), 0.0
    monitor.update(0.3, 0.0, Wheels(0, 0), now_s)
    for reading in range(1, 4 + WINDOW_READINGS + 1):
        found = monitor.update(0.3, 0.0, Wheels(0, 0), reading * DT_S)
        assert bool(found) == (reading == 4 + WINDOW_READINGS)


@pytest.mark.parametrize(("period_s", "readings"), [(0.0496, 5), (0.0494, 10)])
def test_a_reading_half_a_millisecond_early_is_on_time_and_an_earlier_one_is_left_out(period_s, readings):
    assert started(latency_s=0.0).first(SPEED_M_S, dt_s=period_s)[0] == readings


def test_a_reading_at_the_time_of_the_next_comparison_is_compared():
    watch = started(latency_s=0.0)
    found = [watch.monitor.update(SPEED_M_S, 0.0, Wheels(0, 0), watch.monitor.next_s) for _ in range(5)]
    assert found[4] and not any(found[:4])


@pytest.mark.parametrize(("gap_s", "readings"), [(0.15, 15), (0.1501, 16)])
def test_a_gap_of_150_ms_is_bridged_and_after_a_longer_one_the_monitor_starts_again(gap_s, readings):
    """Either way the command before the gap is remembered: a wheel that still follows it may stand for ten readings."""
    watch = Watch(latency_s=0.0)
    watch.read(-SPEED_M_S, dt_s=0.0)
    assert watch.read(SPEED_M_S, dt_s=gap_s) is None
    assert watch.first(SPEED_M_S)[0] == readings - 1


def test_a_pause_in_the_command_begins_a_new_window():
    watch = started()
    for _ in range(1 + WINDOW_READINGS - 1):
        assert watch.read(SPEED_M_S) is None
    assert watch.read(0.0) is None
    assert watch.first(SPEED_M_S)[0] == 1 + WINDOW_READINGS


def test_a_command_that_reverses_at_once_begins_a_new_window():
    """It begins when the wheel must have turned around, 26 readings later."""
    watch = started(latency_s=0.0)
    for _ in range(WINDOW_READINGS - 1):
        assert watch.read(SPEED_M_S) is None
    assert watch.first(-SPEED_M_S, counts=1000)[0] == 26 + WINDOW_READINGS - 1


@pytest.mark.parametrize(("extra_m", "followed"), [(0.01198, True), (0.01202, False)])
def test_a_wheel_that_makes_half_as_much_again_and_12_mm_more_in_ten_readings_is_not_too_fast(
    extra_m, followed
):
    watch = started(latency_s=0.0)
    watch.read(0.0)
    counts = round((FAST_SHARE * STEP_M + extra_m / FAST_TICKS) / MICROMETRE)
    assert [watch.read(SPEED_M_S, counts) is None for _ in range(FAST_TICKS)] == [True] * 9 + [followed]


def test_a_wheel_that_a_hand_turns_while_it_is_to_stand_is_not_too_fast():
    watch = started(latency_s=0.0)
    assert [watch.read(0.0, round(STEP_M / MICROMETRE)) for _ in range(3 * FAST_TICKS)] == [
        None
    ] * 3 * FAST_TICKS


@pytest.mark.parametrize(
    ("way", "model_m_s2", "slows_m_s2"), [(1, SLOW_M_S2, SLOW_M_S2 / 2), (-1, FAST_M_S2, COAST_M_S2)]
)
def test_a_wheel_that_brakes_half_as_fast_as_in_the_model_or_coasts_is_not_too_fast(
    way, model_m_s2, slows_m_s2
):
    """From 0.8 m/s, and from a first reading at this speed."""
    for begins in (Watch, started):
        watch, speed_m_s = begins(model_m_s2, latency_s=0.0), 0.8
        for _ in range(20 * (begins is started)):
            assert watch.read(way * 0.8, round(way * 0.8 * DT_S / MICROMETRE)) is None
        while speed_m_s > SPEED_M_S:
            assert watch.read(way * SPEED_M_S, round(way * speed_m_s * DT_S / MICROMETRE)) is None
            speed_m_s -= slows_m_s2 * DT_S


@pytest.mark.parametrize(("count_m", "followed"), [(2**-8, True), (0.999 * 2**-8, False)])
def test_a_wheel_that_makes_a_tenth_of_the_distance_follows(count_m, followed):
    """One count in five readings, of 5 x 2^-7 m expected."""
    watch = started(latency_s=0.0, metres_per_count=count_m)
    found = [watch.read(SPEED_M_S, counts) for counts in (0, 0, 0, 0, 1)]
    assert (found[4] is None) == followed


@pytest.mark.parametrize(("speed_m_s", "judged"), [(0.024, True), (0.02399, False)])
def test_a_wheel_is_judged_if_at_least_6_mm_are_expected(speed_m_s, judged):
    """That is a wheel at 24 mm/s, in five readings of 50 ms."""
    monitor = WheelMonitor(Drive(0.5, MICROMETRE), FAST_M_S2, 0.0)
    found = [monitor.update(speed_m_s, 0.0, Wheels(0, 0), now_s) for now_s in TWENTIETHS_S]
    assert bool(found[-1]) == judged


@pytest.mark.parametrize("way", [1, -1])
def test_a_wheel_must_accelerate_half_as_fast_as_in_the_model(way):
    found = started(SLOW_M_S2).first(way * 0.3)[1]
    assert found.expected_m == pytest.approx(0.2 * (1 + 2 + 3 + 4 + 5) * DT_S**2)


@pytest.mark.parametrize(
    ("name", "board", "acceleration_m_s2"),
    [
        ("traxbot", {"linear_ceiling": 800, "ramp_time": 1600}, 0.5),
        ("traxbot", {"linear_ceiling": 800, "ramp_time": 500}, 1.6),
        ("traxbot", {"linear_ceiling": 800, "ramp_time": 0}, 1.6),
        ("omni", {"ramp_time": 1600}, 0.5),
    ],
)
def test_the_acceleration_of_a_model_is_its_full_speed_in_the_time_of_its_ramp(
    name, board, acceleration_m_s2
):
    """A ramp of less than half a second counts as half a second."""
    robot = load(name)
    drive = robot.drive._replace(full_speed_m_s=0.8) if name == "omni" else robot.drive
    monitor = monitor_of(robot._replace(board={**robot.board, **board}, drive=drive), QUICK)
    still = (0,) * (3 if name == "omni" else 2)
    found = [monitor.update(2.0, 0.0, still, number * DT_S) for number in range(20)]
    first = next(each for each in found if each)
    assert first.expected_m == pytest.approx(acceleration_m_s2 / 2 * 15 * DT_S**2)


def test_a_wheel_that_reverses_may_go_on_accelerating_for_800_ms_and_then_slows_down_at_the_slow_rate():
    """From 0.1 m/s back it may reach 0.42 m/s, and 34 readings later it must run forward."""
    watch = started(SLOW_M_S2)
    watch.follow(-0.1)
    number, found = watch.first(0.1, -6250)
    assert number == 1 + 34 + WINDOW_READINGS - 1
    assert found.cause == REVERSED
    assert found.expected_m == pytest.approx((0.005 + 0.0175 + 0.03 + 0.0425 + 0.055) * DT_S)


def test_a_wheel_that_has_reversed_once_has_no_such_time_at_its_next_start():
    watch = started()
    watch.follow(-SPEED_M_S)
    assert [watch.read(SPEED_M_S) for _ in range(12)] == [None] * 12
    watch.follow(SPEED_M_S)
    watch.follow(0.0)
    assert watch.first(SPEED_M_S)[0] == 1 + WINDOW_READINGS


def test_a_wheel_that_is_pushed_back_starts_from_its_speed_when_the_command_was_given():
    """0.104 m/s, and half of it one reading later, when the command has arrived."""
    watch = started(SLOW_M_S2)
    assert watch.read(0.0, -6500) is None
    assert watch.read(0.3, -6500) is None
    assert watch.read(0.3, -3250) is None
    number, found = watch.first(0.3)
    assert number == 8 + WINDOW_READINGS - 1
    assert found.expected_m == pytest.approx((0.0085 + 0.021 + 0.0335 + 0.046 + 0.0585) * DT_S)


def test_a_wheel_that_rolls_back_at_its_very_first_command_starts_from_that_speed():
    watch = Watch(SLOW_M_S2, latency_s=0.0)
    watch.read(0.3)
    found = watch.first(0.3, -6500)
    assert found[0] == 9 + WINDOW_READINGS - 1
    assert found[1].expected_m == pytest.approx((0.0085 + 0.021 + 0.0335 + 0.046 + 0.0585) * DT_S)


@pytest.mark.parametrize(("counts", "readings"), [(0, 15), (1, 15), (2, 31)])
def test_a_wheel_that_makes_less_than_a_fifth_of_a_millimetre_in_ten_readings_each_has_come_to_rest(
    counts, readings
):
    """Counts of 0.1 mm.  It starts from rest then, and not from the speed that it may still have had."""
    watch = started(metres_per_count=1e-4)
    for _ in range(10):
        assert watch.read(-SPEED_M_S, -80) is None
    assert watch.first(SPEED_M_S, counts)[0] == readings


def test_rest_is_counted_from_the_first_comparison():
    watch = Watch()
    watch.read(-SPEED_M_S)
    assert watch.first(SPEED_M_S)[0] == 10 + WINDOW_READINGS


@pytest.mark.parametrize(
    ("moves", "cause"),
    [
        ([(-0.3, -0.3, 40), (0.3, -0.02, 8), (0.0, -0.02, 2), (0.3, -0.02, 15)], None),
        ([(0.3, 0.3, 40), (0.0, 0.3, 1), (0.3, 0.3, 1), (0.3, 0.0, LATENCY_TICKS + 5)], None),
        ([(0.0, 0.0, 40), (0.3, 0.0, 20)], POWERLESS),
    ],
    ids=[
        "turns round, and keeps its time over a pause in the command",
        "was fast before a pause in the command, which reaches the motors late",
        "has stood for long and cannot start",
    ],
)
def test_a_wheel_has_its_time_over_a_pause_in_the_command(moves, cause):
    found = ticked(*moves)[1]
    assert (found and found.cause) == cause


def test_a_wheel_that_rests_for_half_a_second_while_it_turns_round_is_judged_from_then_on():
    """As one that starts then."""
    watches = [ticked((0.0, 0.0, 40))[0], ticked((-0.3, -0.3, 40))[0]]
    ticks = [next(n for n in range(1, 60) if watch.tick(0.3, 0.0)) for watch in watches]
    assert ticks[1] - ticks[0] == STILL_TICKS - LATENCY_TICKS


def test_a_wheel_that_was_sent_back_for_a_moment_may_go_back_first():
    """The command was replaced before the next comparison."""
    watch = ticked((0.0, 0.0, 10))[0]
    watch.read(-0.3, 0, 0.0)
    assert [watch.tick(0.3, -0.05) for _ in range(20)] == [None] * 20


@pytest.mark.parametrize(
    ("newest", "cause"),
    [((8, -10, -10), REVERSED), ((-10, -10, 8), DEAD), ((-40, -9, -10), DEAD), ((0, -9, -11), REVERSED)],
)
def test_the_two_newest_readings_decide_whether_a_wheel_runs_back(newest, cause):
    """Of 32 counts expected in each."""
    watch = started(latency_s=0.0, metres_per_count=STEP_M / 32)
    found = [watch.monitor.update(SPEED_M_S, 0.0, Wheels(0, 0), watch.now_s + DT_S * i) for i in (1, 2)]
    assert found == [None, None]
    right = 0
    for number, counts in enumerate(newest, 3):
        right += counts
        last = watch.monitor.update(
            SPEED_M_S, 0.0, Wheels(right, 32 * (number - 2)), watch.now_s + DT_S * number
        )
    assert (last.wheel, last.cause) == ("right", cause)


@pytest.mark.parametrize(("count_m", "cause"), [(0.3 * STEP_M, POWERLESS), (0.301 * STEP_M, REVERSED)])
def test_a_wheel_that_goes_back_by_three_tenths_of_its_way_does_not_run_in_reverse_yet(count_m, cause):
    watch = started(latency_s=0.0, metres_per_count=count_m)
    assert [watch.read(SPEED_M_S, counts) for counts in (0, 0, 0, -1, -1)][4].cause == cause


@pytest.mark.parametrize("way", [1, -1])
def test_a_mismatch_says_how_far_the_wheel_has_moved_against_its_command(way):
    """Three counts of 0.1 mm in each of five readings."""
    found = started(latency_s=0.0, metres_per_count=1e-4).first(way * SPEED_M_S, -3 * way)[1]
    assert found.moved_m == pytest.approx(-0.0015)


def run_wheels(model, twist, *dead):
    """Return what is said of a base with three or four wheels that drives so."""
    drive, monitor = model.drive, monitor_of(model, QUICK)
    base = kinematics_of(drive)
    kind = WHEELS_BY_COUNT[len(base.wheels)]
    speeds = {**dict(zip(base.wheels, base.wheel_steps(twist))), **dict.fromkeys(dead, 0.0)}
    for number in range(40):
        ways = (speeds[name] * number * DT_S / drive.metres_per_count for name in kind._fields)
        counts = kind(*map(round, ways))
        found = monitor.update(twist.forward, twist.turn, counts, number * DT_S, twist.left)
        if found:
            return found.wheel, found.cause
    return None


FORWARD, LEFT, TURN = Planar(0.2, 0.0, 0.0), Planar(0.0, 0.2, 0.0), Planar(0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("twist", "dead", "found"),
    [
        (FORWARD, "", None),
        (LEFT, "", None),
        *((FORWARD, name, (name, DEAD)) for name in ("right", "left")),
        *((LEFT, name, (name, DEAD)) for name in ("right", "left", "rear")),
        (TURN, "right rear", ("several", DEAD)),
        (TURN, "right left rear", ("several", POWERLESS)),
    ],
)
def test_each_of_three_wheels_has_its_own_command(twist, dead, found):
    assert run_wheels(load("omni"), twist, *dead.split()) == found


@pytest.mark.parametrize("wheel", FourWheels._fields)
@pytest.mark.parametrize(("kind", "twist"), [("skid", FORWARD), ("mecanum", LEFT), ("mecanum", FORWARD)])
def test_each_of_four_wheels_is_named(kind, twist, wheel):
    assert run_wheels(four_wheels(kind), twist) is None
    assert run_wheels(four_wheels(kind), twist, wheel) == (wheel, DEAD)


@pytest.mark.parametrize(
    ("wheel", "cause", "words"),
    [
        ("right", REVERSED, "right wheel moved -20 mm, expected at least 50 mm: encoder or motor wires swapped: it"),
        ("both", POWERLESS, "both wheels moved -20 mm, expected at least 50 mm: motor power off, or the motor board"),
        ("several", DEAD, "several wheels moved -20 mm, expected at least 50 mm: encoder dead or unplugged, or the"),
    ],
)  # fmt: skip
def test_the_words_say_how_many_wheels(wheel, cause, words):
    found = Mismatch(wheel, cause, 0.05, -0.02)
    assert str(found).startswith(words) and found.reason == "wheel_mismatch"


@pytest.mark.parametrize(
    ("reason", "code"),
    [("wheel_blocked", "wheel_blocked"), ("encoder", "encoder_dead"), ("unknown", "wheel_fault")],
)
def test_a_stop_by_the_board_is_told_with_the_problem_and_its_remedy(reason, code):
    row, stop = PROBLEMS[code], Mismatch("", reason)
    assert str(stop) == f"{row.message[0].lower()}{row.message[1:]}: {row.remedy}"
    assert (stop.reason, stop.expected_m, stop.moved_m) == (reason, 0.0, 0.0)
    assert stop_error(SimpleNamespace(mismatch=stop), "stopped early").code == code


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
