"""Range sensors in the driver: ranges by the names of the robot's file, which are new, and how old they may be."""

import math

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import BLIND_S, GoalSeeker
from mrl_driver.robot import models, wirings
from mrl_driver.robot.models import SonarMount, kit
from mrl_driver.robot.models.kit import Kit
from mrl_driver.robot.models.range_sensors import TURN_S
from mrl_driver.safety.protective_zones import Zones, ZoneSettings
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.echo_ranges import HELD, SILENT
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import Wall, World

DUO = models.load("duo")
NOT_THERE = dict.fromkeys(("pin_sonar_front", "pin_sonar_left", "pin_battery", "pin_sonar_trigger"), -1)
PINS = {**NOT_THERE, "pin_range_1_trigger": 12, "pin_range_1_echo": 14, "pin_range_3_trigger": 15}
NAMES = {"nose": SonarMount(0.0, 0.0, 0.0, "range_1"), "tail": SonarMount(0.0, 0.0, 180.0, "range_3")}
ROBOT = DUO._replace(board={**DUO.board, **PINS, "pin_range_3_echo": 17}, sonars=NAMES)
WALL = World([Wall(1.0, -9, 1.0, 9)])
SETTLED_S, ROUND_S = 1.0, 2 * TURN_S


@pytest.fixture
def robot():
    plant = Plant(ROBOT, WALL, (0.0, 0.0, 0.0))
    with SteppedDriver(PythonBoard(plant), ROBOT) as driver:
        driver.plant = plant
        driver.wait(SETTLED_S)
        yield driver


def test_ranges_have_the_names_of_the_robots_file(robot):
    assert robot.ranges == {"nose": pytest.approx(1.0, abs=0.007), "tail": math.inf}


@pytest.mark.parametrize("state", [SILENT, HELD])
def test_a_sensor_that_fails_has_no_range(robot, state):
    robot.plant.ranges.failed["range_1"] = state
    robot.wait(SETTLED_S)
    assert math.isnan(robot.ranges["nose"]) and robot.ranges["tail"] == math.inf


def test_each_reading_is_new_once(robot):
    fresh = []
    robot.on_telemetry(lambda telemetry: fresh.extend(telemetry.fresh))
    robot.wait(10 * ROUND_S)
    assert (fresh.count("nose"), fresh.count("tail")) == (pytest.approx(10, abs=2), pytest.approx(10, abs=2))


def test_a_sensor_without_a_name_makes_the_round_longer():
    """A value that does not change counts as new once a round, and the board's wiring says how many take turns."""
    others = {"pin_sonar_right": -1, "pin_sonar_power": -1, "pin_range_2_trigger": 16, "pin_range_2_echo": 13}
    model, fresh = ROBOT._replace(board={**ROBOT.board, **others}), []
    with SteppedDriver(PythonBoard(Plant(model, WALL, (0.0, 0.0, 0.0))), model) as driver:
        driver.wait(SETTLED_S)
        driver.on_telemetry(lambda telemetry: fresh.extend(telemetry.fresh))
        driver.wait(10 * 3 * TURN_S)
    assert fresh.count("tail") == pytest.approx(10, abs=2)


@pytest.mark.parametrize(("sensors", "drives"), [(1, False), (6, True)])
def test_more_sensors_may_be_silent_for_longer(sensors, drives):
    """Three rounds of six take more than a second."""
    mounts = {f"range_{i}": SonarMount(0.0, 0.0, 0.0, f"range_{i}") for i in range(1, sensors + 1)}
    zones = Zones(ZoneSettings(), DUO.body, mounts)
    seeker = GoalSeeker((3.0, 0.0, 0.0), DUO.limits, 0.0, mounts)
    for name in mounts:
        zones.on_range(name, math.inf, 0.0)
    seeker.command((0.0, 0.0, 0.0), {"range_1": 2.0}, 0.0)
    later_s = BLIND_S + 0.05
    assert (zones.limit(0.1, later_s) > 0) == drives
    assert (seeker.command((0.1, 0.0, 0.0), {"range_1": math.nan}, later_s)[0] > 0) == drives


ON_A2 = {"pin_sonar_right": -1, "pin_range_2_trigger": -1, "pin_range_2_echo": 16}
STEP_M = 0.01  # of a count at the far end of the curve


def sharp(kind, wall_m):
    """A robot with a Sharp on A2 that looks to its left, at a wall."""
    sonars = {"beam": SonarMount(0.0, 0.0, 90.0, "range_2", kind)}
    plant = Plant(
        DUO._replace(board={**DUO.board, **ON_A2}, sonars=sonars),
        World([Wall(-9, wall_m, 9, wall_m)]),
        (0.0,) * 3,
    )
    return plant, SteppedDriver(PythonBoard(plant), plant.model)


@pytest.mark.parametrize(
    ("kind", "wall_m", "range_m"),
    [
        ("GP2Y0A21", 0.11, 0.11),
        ("GP2Y0A21", 0.37, 0.37),
        ("GP2Y0A21", 0.79, 0.79),
        ("GP2Y0A21", 0.82, math.inf),
        ("GP2Y0A21", 0.09, -math.inf),
        ("GP2Y0A21", 0.03, 0.166),  # closer than the peak of its voltage
        ("GP2Y0A02", 0.21, 0.21),
        ("GP2Y0A02", 1.1, 1.1),
        ("GP2Y0A02", 1.6, math.inf),
        ("GP2Y0A02", 0.18, -math.inf),
        ("GP2Y0A02", 0.07, 0.487),
    ],
)
def test_a_sharp_measures_by_its_curve(kind, wall_m, range_m):
    _, robot = sharp(kind, wall_m)
    with robot:
        robot.wait(SETTLED_S)
        assert robot.ranges == {"beam": pytest.approx(range_m, abs=STEP_M)}


def test_a_sharp_that_fails_has_no_range_or_always_the_same():
    plant, robot = sharp("GP2Y0A21", 0.3)
    with robot:
        robot.wait(SETTLED_S)
        plant.ranges.failed["range_2"] = HELD
        plant.world.place("other", Pose(0.0, 0.25, 0.0), plant.footprint)  # as near as 0.17 m
        robot.wait(SETTLED_S)
        assert robot.ranges["beam"] == pytest.approx(0.3, abs=STEP_M)
        plant.ranges.failed["range_2"] = SILENT
        robot.wait(SETTLED_S)
        assert math.isnan(robot.ranges["beam"])


def test_a_new_robot_drives_and_shows_its_ranges(tmp_path):
    pins = {
        **wirings.load("mrl_duo").pins,
        **NOT_THERE,
        **ON_A2,
        "pin_range_1_trigger": 12,
        "pin_range_1_echo": 14,
    }
    sonars = {"front": ("range_1", "HC-SR04"), "left": ("range_2", "GP2Y0A21")}
    made = kit.model_of(Kit("rover", 11, 65.0, 150.0, 1496.0, "tb6612", pins, sonars=sonars))
    plant = Plant(made, World([Wall(1.0, -9, 1.0, 9), Wall(-9, 0.4, 9, 0.4)]), (0.0, 0.0, 0.0))
    with SteppedDriver(PythonBoard(plant), made) as robot:
        robot.wait(SETTLED_S)
        before = robot.ranges
        for _ in range(40):
            robot.drive(0.1, 0.0)
            robot.wait(0.05)
        driven_m = robot.pose[0]
        assert driven_m > 0.1 and before["front"] - robot.ranges["front"] == pytest.approx(driven_m, abs=0.02)
        assert robot.ranges["left"] == pytest.approx(before["left"], abs=STEP_M)
