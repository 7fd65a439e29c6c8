"""Numbers of a robot over time."""

import contextlib
import math
from types import SimpleNamespace

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.geometry import ORIGIN
from mrl_driver.robot.odometry import Twist
from mrl_driver.view.series import Series
from mrl_driver.view.shown_state import SILENT_S
from sim_arduino.serve import factory


@contextlib.contextmanager
def driven():
    """A robot with an IMU, in simulated time, that has stood still and drives straight ahead: robot, driver."""
    emulated = factory.make(factory.Options(imu=True))
    with contextlib.closing(emulated), SteppedDriver(emulated.board) as driver:
        driver.wait(1.0)
        for _ in range(15):
            driver.drive(0.2, 0.0)
            driver.wait(0.1)
        yield emulated, driver


@pytest.fixture(scope="module")
def values():
    """The values of a robot with sonars and an IMU that drives straight ahead, by name."""
    with driven() as (_, driver):
        series = Series(driver)
        series.values()
        driver.wait(0.1)
        found = series.values()
        assert len(found) == len(series.names) and series.names[:3] == [
            ("x", "m"),
            ("y", "m"),
            ("yaw", "rad"),
        ]
        yield dict(zip((name for name, _ in series.names), found))


def near(value):
    return pytest.approx(value, abs=0.02)


def test_motion_has_pose_speeds_and_command(values):
    seen = [values[name] for name in ("yaw", "speed", "turn rate", "asked speed", "asked turn rate")]
    assert values["x"] > 0.15 and seen == [near(each) for each in (0.0, 0.2, 0.0, 0.2, 0.0)]


def test_the_imu_has_rates_acceleration_and_bias(values):
    assert values["imu acceleration z"] == pytest.approx(9.8, abs=0.2)
    assert (values["imu yaw rate"], values["imu bias"]) == (near(0.0), near(0.0))


def test_board_and_link_have_numbers(values):
    assert 9 < values["battery"] < 14 and 0 < values["sonar front"] < 5
    assert 0 <= values["link age"] < 0.1 and (values["frames lost"], values["frames damaged"]) == (0, 0)


@pytest.mark.parametrize(
    "fault, unknown",
    [
        ("freeze", {"speed", "turn rate", "right wheel", "left wheel", "sonar front", "imu yaw rate"}),
        ("imu_power", {"imu yaw rate", "imu acceleration z", "imu bias"}),
    ],
)
def test_what_is_not_measured_any_more_is_not_known(fault, unknown):
    with driven() as (emulated, driver):
        series, seen = Series(driver), []
        for _ in range(2):
            seen.append(dict(zip((name for name, _ in series.names), series.values())))
            emulated.board.inject(f"{fault}:at=0,lasts=1")
            driver.wait(0.4)
    before, after = ({name for name in unknown if math.isnan(values[name])} for values in seen)
    assert (before - {"right wheel", "left wheel"}, after) == (set(), unknown)


def behind_topics(**values):
    """A robot with some of a driver's properties."""
    usual = {"model": None, "pose": ORIGIN, "twist": Twist(0.0, 0.0), "command": None, "ranges": {}}
    link = SimpleNamespace(age_s=values.pop("age_s", 0.0), delay_s=math.nan)
    return SimpleNamespace(**{**usual, "battery_v": 12.0, "link": link, **values})


@pytest.mark.parametrize("silence", [{"age_s": SILENT_S + 0.01}, {"ready": False}], ids=["old", "not ready"])
def test_a_silent_robot_has_no_speed_and_no_ranges(silence):
    series = Series(behind_topics(ranges={"front": 1.0}, **silence))
    found = dict(zip((name for name, _ in series.names), series.values()))
    assert all(math.isnan(found[name]) for name in ("speed", "turn rate", "sonar front"))


def test_a_board_without_motors_has_its_sensors():
    emulated = factory.make(factory.Options(robot="pioneer"))
    with contextlib.closing(emulated), SteppedDriver(emulated.engine) as driver:
        series = Series(driver)
        before = dict(zip(series.names, series.values()))
        driver.wait(1.0)
        after = dict(zip(series.names, series.values()))
    assert math.isnan(before["thermopile pixel 1", "degC"]) and after["thermopile pixel 1", "degC"] == 22.0
    assert after["light", "count"] == 500.0 and ("x", "m") not in after and not series.outdated()
