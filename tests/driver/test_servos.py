"""Servos: moves within the range and speed of the robot's file, and where they are."""

import math

import pytest

from mrl_driver.driver.simulated import SteppedDriver
from mrl_driver.errors import BoardTimeout, ConfigError
from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot import wirings
from mrl_driver.robot.models import ServoMount
from sim_arduino.board import PythonBoard
from sim_arduino.hardware.wiring import Plant
from tests.models import model

PAN = ServoMount(1, -0.785, 0.785, 1000.0, 2000.0, speed_rad_s=0.5)
TILT = ServoMount(2, -0.5, 1.0, 2000.0, 800.0, speed_rad_s=2.0, tilts=True, parent="pan")
BOARD = {**wirings.load("pwm_d5_d6_dir_d4_d7").pins, "bridge": BRIDGES.index("cytron"), "i2c": 0}
NEAR_RAD = 0.02  # Steps of the pulses, and their whole microseconds


def made(**pins):
    """A robot, and its plant."""
    base = model("duo")
    board = {**base.board, **BOARD, "pin_servo_1": 9, "pin_servo_2": 10, **pins}
    plant = Plant(base._replace(board=board, sonars={}, servos={"pan": PAN, "tilt": TILT}))
    return SteppedDriver(PythonBoard(plant), plant.model), plant


@pytest.fixture
def robot():
    driver, driver.plant = made()
    with driver:
        yield driver


@pytest.mark.parametrize(
    ("name", "angle_rad", "turns_to_rad", "pulse_us"),
    [
        ("pan", 0.0, 0.0, 1500),
        ("pan", 0.5, 0.5, 1818),
        ("pan", 3.0, 0.785, 2000),
        ("tilt", -0.5, -0.5, 2000),
        ("tilt", -1.0, -0.5, 2000),
        ("tilt", 1.0, 1.0, 800),
    ],
)
def test_a_servo_turns_to_its_angle_within_its_range(robot, name, angle_rad, turns_to_rad, pulse_us):
    assert robot.servos.move(name, angle_rad) == turns_to_rad
    robot.wait(0.1)
    servo = robot.plant.servos[robot.servos.mounts[name].servo]
    assert servo.pulse_us(robot.now_s) == pytest.approx(pulse_us, abs=1)
    assert robot.servos.angles == {name: pytest.approx(turns_to_rad, abs=NEAR_RAD)}


@pytest.mark.parametrize(("speed_rad_s", "used_rad_s"), [(None, 0.5), (0.25, 0.25), (9.0, 0.5)])
def test_a_servo_moves_at_its_speed_at_most(robot, speed_rad_s, used_rad_s):
    robot.servos.move("pan", -0.5)
    robot.servos.move("pan", 0.5, speed_rad_s)
    robot.wait(1.0)
    expected_rad = -0.5 + used_rad_s
    assert robot.servos.angles["pan"] == pytest.approx(expected_rad, abs=NEAR_RAD)
    pulse_us = robot.plant.servos[1].pulse_us(robot.now_s)
    assert PAN.angle_rad(pulse_us) == pytest.approx(expected_rad, abs=NEAR_RAD)


def test_after_a_restart_of_the_board_no_angle_is_known(robot):
    robot.servos.move("pan", 0.3)
    robot._connection.stepped._stepped.reset()
    robot.wait(2.0)
    assert robot.ready and robot.servos.angles == {} and robot.plant.servos[1].pulse_us(robot.now_s) == 0


def test_a_board_whose_pins_lack_a_servo_does_not_answer():
    driver, _ = made(pin_servo_2=-1)
    with driver, pytest.raises(BoardTimeout, match="no answer to request"):
        driver.servos.move("tilt", 0.1)


def test_a_robot_without_servos_has_none():
    driver = SteppedDriver(PythonBoard(Plant(model("traxbot"))), "traxbot")
    with driver, pytest.raises(ConfigError, match="servo is 'pan', expected a robot with servos"):
        driver.servos.move("pan", math.pi)
