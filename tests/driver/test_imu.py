"""The IMU: its stream, its times, its checks, and the heading."""

import math
from types import SimpleNamespace

import pytest

from mrl_driver.apps.review import drive_data
from mrl_driver.cli.commands.info import describe
from mrl_driver.driver import Driver, Options
from mrl_driver.driver.options import DEFAULTS
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.driver.recording_summary import summarise
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import wrap_angle
from mrl_driver.protocol.table import TICK_S
from mrl_driver.robot.imu import (
    ABSENT,
    FROZEN,
    IN_USE,
    OFF,
    OUT_OF_SCALE,
    RECOVERY_S,
    SILENT,
    SILENT_S,
    START_S,
    TILTED,
    Imu,
)
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.board_clock import BoardClock
from mrl_driver.session.events import ACCEL_M_S2, ImuChanged, ImuReading
from mrl_driver.session.handshake import DEFAULT_PLAN
from mrl_driver.transport.baud_rates import (
    SLOWEST_IMU_MS,
    command_gap_s,
    least_imu_period_ms,
    least_period_ms,
)
from mrl_driver.view.shown_state import line, snapshot, state_of
from sim_arduino.serve import factory
from tests.fake_board import UPWARD, FakeBoard
from tests.models import model as load

from .robot import STEP_S, Robot
from .talk import Talk

TICKS_PER_S = 1 / TICK_S
STEPS_S = 0.05  # A state of the IMU is seen with the next frames after its time
TURN_RAD_S = 1.0
BIAS_S = 2.0  # The bias is learned within this time of standing still
TURN_ERROR_RAD = 0.02
JUMP_RAD = 1.2 * TURN_RAD_S * 0.02  # Farthest turn between two frames


def with_imu(**kwargs):
    board = FakeBoard(**kwargs)
    board.capabilities.add("imu")
    return board


def talk(board=None, **kwargs):
    return Talk(board or with_imu(), **kwargs).until_ready()


def int16(ticks):
    return (ticks + 0x8000) % 0x10000 - 0x8000


def codes(talk):
    return [frame.code for frame in talk.board.heard]


# -- board time


def test_readings_keep_the_count_of_wraps_while_the_counters_are_silent():
    """The numbers are without a gap, so the host's clock is not asked; 5 s are more than a wrap."""
    clock = BoardClock()
    clock.update(0, 10.0)
    for n in range(1, 251):
        clock.beside(int16(int(0.02 * n * TICKS_PER_S)), 10.0 + 0.02 * n, True)
    clock.update(int16(int(5.02 * TICKS_PER_S)), 15.02, True)
    assert clock.board_s == pytest.approx(5.02, abs=2 * TICK_S)


# -- the stream


@pytest.mark.parametrize(
    "make, plan, sent",
    [
        (with_imu, {}, {47}),
        (with_imu, {"imu_period_ms": 0}, {48}),
        (with_imu, {"check": False}, {48}),
        (FakeBoard, {}, set()),
    ],
    ids=["wanted", "not wanted: another program may have left it on", "without board time", "absent"],
)
def test_the_stream_is_started_if_the_board_has_an_imu(make, plan, sent):
    found = codes(talk(make(), plan=DEFAULT_PLAN._replace(**plan)).run(0.5))
    assert {code: found.count(code) for code in (47, 48) if code in found} == dict.fromkeys(sent, 1)


def test_a_reading_is_in_si_units_with_the_time_of_the_counters():
    found = talk().run(1.0)
    reading, counts = found.seen(ImuReading)[-1], found.counts[-1]
    assert len(found.seen(ImuReading)) == pytest.approx(50, abs=2) and found.session.counters.lost == 0
    assert reading.accel_m_s2[2] == pytest.approx(UPWARD * ACCEL_M_S2, abs=ACCEL_M_S2)
    assert abs(reading.time_s - counts.time_s) <= 0.02
    assert abs(reading.stamp_s - counts.stamp_s) <= 0.02


def test_the_end_of_the_session_ends_it():
    found = talk().run(0.5)
    found.session.end()
    found.step()
    assert found.board.imu_s == math.inf


@pytest.mark.parametrize("period_ms", [9, SLOWEST_IMU_MS + 1, -1, 20.0])
def test_a_period_out_of_range_is_refused(period_ms):
    with pytest.raises(ConfigError, match="imu_period_ms is"):
        Driver("/dev/null", options=DEFAULTS._replace(imu_period_ms=period_ms))


@pytest.mark.parametrize(
    "baud, stream_ms, least_ms",
    [(115200, 20, 10), (57600, 25, 30), (38400, 43, 40), (38400, 42, 0), (9600, 75, 0)],
)
def test_a_slow_line_has_room_for_fewer_readings(baud, stream_ms, least_ms):
    assert least_imu_period_ms(baud, stream_ms) == least_ms
    assert command_gap_s(baud) == pytest.approx(480 / baud)  # 24 bytes of 10 bits on half of the line


@pytest.mark.parametrize("baud, least_ms", [(9600, 75), (38400, 19), (115200, 0), (1000000, 0)])
def test_only_a_slow_line_limits_the_period_of_the_stream(baud, least_ms):
    assert least_period_ms(baud) == least_ms


# -- checks


@pytest.fixture
def robot():
    robot = Robot(load("traxbot"), board=with_imu())
    robot.run(BIAS_S)
    return robot


def state(robot):
    return robot.core.state.imu_state


def always(values):
    """A chip that measures so, with some noise in the last value."""
    return lambda robot: lambda now: (*values[:5], values[5] + robot.board.noise)


def frozen(robot):
    values = robot.board.imu(robot.now)
    return lambda now: values


def silent(robot):
    return lambda now: None


PROBLEMS = {
    "silent": (silent, SILENT, SILENT_S),
    "frozen": (frozen, FROZEN, 0.06),
    "saturated": (always((0, 0, 32767, 0, 0, UPWARD)), OUT_OF_SCALE, 0.02),
    "dead": (always((0,) * 6), OUT_OF_SCALE, 1.0),
    "on_its_side": (always((0, 0, 0, UPWARD, 0, 0)), TILTED, 2.0),
}


@pytest.mark.parametrize("problem, expected, seconds", PROBLEMS.values(), ids=PROBLEMS)
def test_readings_that_are_not_to_be_believed_are_not_used(robot, problem, expected, seconds):
    """The change is told once, with what to do."""
    assert state(robot) == IN_USE
    robot.events.clear()
    robot.board.imu = problem(robot)
    robot.run(seconds + STEPS_S)
    assert state(robot) == expected and not robot.core.state.telemetry.gyro
    robot.run(1.0)
    (told,) = robot.seen(ImuChanged)
    assert (told.in_use, told.state) == (False, expected)
    assert "wheels alone" in str(told) and ": " in str(told) and "\n" not in str(told)


@pytest.mark.parametrize(
    "problem, expected",
    [(silent, SILENT), (always((0, 0, 0, 0, 0, -UPWARD)), TILTED)],
    ids=["silent", "upside down"],
)
def test_an_imu_that_is_mounted_upside_down_is_never_used(problem, expected):
    """It would turn the heading the wrong way.  Nor is one used that never answers."""
    board = with_imu()
    board.imu = problem(SimpleNamespace(board=board))
    robot = Robot(load("traxbot"), board=board)
    robot.run(max(1.0, START_S + STEPS_S))
    assert [(change.in_use, change.state) for change in robot.seen(ImuChanged)] == [(False, expected)]
    assert {telemetry.gyro for telemetry in robot.seen(Telemetry)} == {False}


def test_good_readings_are_used_again_after_half_a_second(robot):
    robot.board.imu, good = frozen(robot), robot.board.imu
    robot.run(0.5)
    robot.board.imu = good
    robot.run(RECOVERY_S - STEPS_S)
    assert state(robot) == FROZEN
    robot.run(2 * STEPS_S)
    assert state(robot) == IN_USE


def test_a_board_that_comes_back_without_its_imu_is_told(robot):
    robot.board.capabilities.remove("imu")
    robot.board.reset(robot.now)
    robot.events.clear()
    robot.run(3.0)
    assert [change.state for change in robot.seen(ImuChanged)] == [ABSENT]


# -- the heading


def turn(robot, seconds):
    """Turns on the spot."""
    end_s = robot.now + seconds
    while robot.now < end_s:
        robot.drive(0.0, TURN_RAD_S)
        robot.run(0.1)
    robot.core.stop(robot.now, "user")
    robot.run(0.1)


def yaw_rad(robot):
    return robot.core.state.telemetry.pose.yaw_rad


def test_the_pose_does_not_jump_when_the_gyro_is_lost_and_found(robot):
    robot.board.slip, good = 0.5, robot.board.imu
    robot.events.clear()
    turn(robot, 0.5)
    robot.board.imu = silent(robot)
    turn(robot, 0.5)
    robot.board.imu = good
    turn(robot, 1.0)
    yaws = [event.pose.yaw_rad for event in robot.seen(Telemetry)]
    assert {event.gyro for event in robot.seen(Telemetry)} == {True, False}
    assert max(abs(b - a) for a, b in zip(yaws, yaws[1:])) < JUMP_RAD


def test_a_listener_gets_each_reading_in_the_axes_of_the_robot():
    """The chip's x points left: its y is the robot's backward."""
    model = load("traxbot")
    robot = Robot(model._replace(imu=model.imu._replace(yaw_deg=90.0)), board=with_imu())
    robot.board.imu = lambda now: (1000, 0, 0, 0, 0, UPWARD + robot.board.noise)
    robot.run(0.5)
    found = robot.seen(Imu)[-1]
    x, y, z = found.angular_velocity_rad_s
    assert (x, y, z) == pytest.approx((0.0, 0.266462, 0.0), abs=1e-9)
    assert found.reading.gyro_rad_s[0] == pytest.approx(0.266462)


@pytest.mark.parametrize("fault, expected", [("imu_power", SILENT), ("imu_frozen", FROZEN)])
def test_an_emulated_chip_that_fails_and_recovers_leaves_the_heading_right(fault, expected):
    emulated = factory.make(factory.Options(imu=True))
    with SteppedDriver(emulated.board, options=Options(command_timeout_s=None)) as driver:
        driver.wait(BIAS_S)
        states = [driver.imu_state]
        driver.drive(0.1, TURN_RAD_S)
        driver.wait(1.0)
        emulated.board.inject(f"{fault}:lasts=1")
        driver.wait(0.5)
        states.append(driver.imu_state)
        driver.wait(2.5)
        states.append(driver.imu_state)
        assert states == [IN_USE, expected, IN_USE]
        driver.stop()
        driver.wait(0.5)
        error_rad = wrap_angle(driver.pose.yaw_rad - emulated.plant.true_pose.yaw_rad)
        assert abs(error_rad) < TURN_ERROR_RAD
    emulated.close()


# -- what users see


class InSteps:
    """A fake board for `SteppedDriver`."""

    def __init__(self, board):
        self.board, self.now = board, 0.0

    @property
    def next_event_s(self):
        return self.now + STEP_S

    def receive(self, data):
        self.board.receive(data, self.now)

    def advance(self, to_s):
        self.now = to_s
        return self.board.advance(to_s)


def test_users_see_readings_and_state():
    with SteppedDriver(InSteps(with_imu()), "traxbot") as driver:
        heard = []
        driver.on(Imu, heard.append)
        driver.wait(BIAS_S)
        assert heard[-1] is driver.imu and len(heard) == pytest.approx(50 * BIAS_S, abs=2)
        assert describe(driver, "/dev/x")["imu"] == IN_USE and f"imu {IN_USE}" in line(driver)
        (row,) = [row for row in state_of(driver).board if row.name == "imu"]
        assert row.value.startswith(IN_USE)
        found = snapshot(driver)["imu"]
        assert found["state"] == IN_USE
        assert found["linear_acceleration_m_s2"][2] == pytest.approx(9.81, abs=0.01)


@pytest.mark.parametrize(
    "make, options, expected", [(FakeBoard, {}, ABSENT), (with_imu, {"imu_period_ms": 0}, OFF)]
)
def test_a_robot_without_one_shows_none(make, options, expected):
    with SteppedDriver(InSteps(make()), "traxbot", DEFAULTS._replace(**options)) as driver:
        driver.wait(0.5)
        assert (driver.imu, driver.imu_state) == (None, expected)
        assert expected == OFF or "imu" not in line(driver)
        assert expected == OFF or [row for row in state_of(driver).board if row.name == "imu"] == []


# -- recordings


def test_a_recording_has_the_drivers_pose_and_the_gyros_yaw_rate(tmp_path):
    path, board, heard = str(tmp_path / "drive.mrl"), with_imu(), []
    board.slip = 0.1
    with SteppedDriver(
        InSteps(board), "traxbot", DEFAULTS._replace(record=path, command_timeout_s=None)
    ) as driver:
        driver.on(Imu, heard.append)
        driver.wait(BIAS_S)
        driver.drive(0.0, TURN_RAD_S)
        driver.wait(1.0)
        driver.stop()
        driver.wait(0.2)
        yaw_rad = driver.pose.yaw_rad
    found = summarise(RecordedDriver(path))
    assert found["pose"]["yaw_rad"] == pytest.approx(yaw_rad, abs=1e-3)
    assert (found["imu"], found["lost"]) == (IN_USE, 0)
    rates = drive_data.read(RecordedDriver(path)).imu.values[:, 0]
    assert len(rates) == pytest.approx(len(heard), abs=1) and found["frames"]["read_imu"] == len(rates)
    assert max(rates) == pytest.approx(0.9 * TURN_RAD_S, abs=TURN_ERROR_RAD)
