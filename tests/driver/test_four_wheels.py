"""Robots with four wheels, from the command to the pose, in simulated time: skid steering and mecanum wheels."""

import math
from statistics import mean

import pytest

from mrl_driver.driver.options import Options
from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import WrongRobot
from mrl_driver.geometry import Pose
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.odometry import FourWheels
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.robot_physics import Errors
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World
from tests.conformance.bench import ready_eeprom
from tests.models import four_wheels

POSE_M, YAW_RAD = 0.002, 0.005
"""Odometry against the truth after some metres: counts round to 0.14 mm, chords of a frame to less."""
SPEED = 0.04
FORWARD, ASIDE, ARC, BACK = (0.2, 0.0, 0.0), (0.0, 0.0, 0.2), (0.1, 0.6, 0.1), (-0.15, 0.0, -0.15)
WAYS = {"skid": [FORWARD, (0.0, 0.8, 0.0), (0.1, -0.6, 0.0)], "mecanum": [FORWARD, ASIDE, ARC, BACK]}


@pytest.fixture
def make():
    """Makes drivers on an emulated robot: `make(kind, **options of the plant)`, with `driver.plant`."""
    made = []

    def build(kind, stored=None, **plant):
        robot = Plant(four_wheels(kind), World(), **plant)
        board = PythonBoard(robot, eeprom=bytearray(ready_eeprom(four_wheels(kind), stored or {})))
        driver = SteppedDriver(board, four_wheels(kind), Options(command_timeout_s=None))
        driver.plant = robot
        made.append(driver)
        driver.connect()
        return driver

    yield build
    for driver in made:
        driver.close()


def off(driver, start):
    """Distance [m] and angle [rad] between where the driver believes the robot and where it is."""
    true = driver.plant.true_pose.relative_to(start)
    return math.dist(true[:2], driver.pose[:2]), abs(math.remainder(driver.pose[2] - true[2], math.tau))


def speeds(driver):
    """Mean of ten readings: one has the noise of whole counts."""
    seen = []
    for _ in range(10):
        driver.wait(0.02)
        seen.append((driver.twist.linear_m_s, driver.twist.angular_rad_s, driver.twist.lateral_m_s))
    return [mean(part) for part in zip(*seen)]


@pytest.mark.parametrize("kind", WAYS)
def test_it_goes_where_odometry_says(make, kind):
    driver = make(kind)
    start = Pose(*driver.plant.true_pose)
    for way in WAYS[kind]:
        assert driver.drive(*way)
        driver.wait(1.5)
        assert speeds(driver) == pytest.approx(way, abs=SPEED)
    driver.stop()
    driver.wait(1.0)
    away_m, away_rad = off(driver, start)
    assert away_m < POSE_M and away_rad < YAW_RAD
    assert driver.stopped and driver.mismatch is None and driver.link.statistics.refused_counts == 0
    assert isinstance(driver.telemetry.counts, FourWheels)


def test_a_gyro_knows_how_much_skid_steering_slips(make):
    """The model believes in another share of slip than the floor has."""
    turned = {}
    for imu in (False, True):
        driver = make("skid", imu=imu, errors=Errors(turn_slip=0.2))
        driver.wait(3.0)
        driver.drive(0.0, 0.8)
        driver.wait(4.0)
        driver.stop()
        driver.wait(1.0)
        turned[imu] = off(driver, Pose(0.0, 0.0, 0.0))[1]
        spread = math.sqrt(driver.telemetry.spread[5])
        assert turned[imu] < 3.5 * spread
    assert turned[True] < 0.05 < 0.3 < turned[False]


@pytest.mark.parametrize("kind", WAYS)
def test_a_blocked_rear_wheel_stops_it(make, kind):
    driver = make(kind)
    driver.drive(0.2, 0.0)
    driver.wait(2.0)
    assert driver.mismatch is None
    driver.plant.bridge.motor(3).blocked = True
    driver.wait(2.0)
    assert driver.stop_reason == StopReason.WHEEL_BLOCKED and not driver.drive(0.2, 0.0)


@pytest.mark.parametrize("kind", WAYS)
def test_a_board_with_two_motors_is_refused(make, kind):
    """Its frames would say that the rear wheels stand still."""
    rear = {name: -1 for name in four_wheels(kind).board if name.startswith("pin_rear")}
    with pytest.raises(WrongRobot, match="wiring of the board has 2 motors, expected the 4"):
        make(kind, stored=rear)
