"""Three wheels across, and how robots differ from their models."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.robot import models
from sim_arduino.faults.key_values import robot_errors, sonar_errors
from sim_arduino.hardware.omni3md import ADDRESS
from sim_arduino.hardware.omni3md_registers import Omni3MDRegisters
from sim_arduino.hardware.omni_wheels import shares_for, twist_of
from sim_arduino.hardware.sonars import SonarErrors
from sim_arduino.hardware.wiring import Plant
from sim_arduino.world.world import World

TRAXBOT = models.load("traxbot")
share = st.floats(-1, 1)


@given(speed=st.floats(0, 0.5), rotation=st.floats(-0.4, 0.4), direction=st.floats(-7, 7))
def test_wheels_and_twist_are_inverses(speed, rotation, direction):
    """Unless a wheel would have to turn too fast, the robot moves as told."""
    forward, aside, turn = twist_of(shares_for(speed, rotation, direction), 0.1)
    told = (speed * math.cos(direction), speed * math.sin(direction), rotation / 0.1)
    assert (forward, aside, turn) == pytest.approx(told, abs=1e-12)


@given(speed=share, rotation=share, direction=st.floats(-7, 7))
def test_too_fast_keeps_the_direction(speed, rotation, direction):
    shares = shares_for(speed, rotation, direction)
    forward, aside, _ = twist_of(shares, 0.1)
    assert max(map(abs, shares)) <= 1.0
    assert forward * speed * math.sin(direction) == pytest.approx(
        aside * speed * math.cos(direction), abs=1e-9
    )


@pytest.mark.parametrize("direction", [0, 60, 90, 180, 225, 300])
def test_a_robot_with_three_wheels_moves_in_any_direction(direction):
    """Without friction, which holds slow wheels back a little longer than fast ones."""
    plant = Plant(TRAXBOT, World(), omni=True)
    for motor in plant.robot.motors:
        motor.params = motor.params._replace(friction_counts_s=0.0)
    plant.motor_board.set_ramp(0.0, 0, 0)
    assert plant.i2c[ADDRESS].write(struct.pack(">Bbhh", 0xFA, 20, 0, direction), 0.0)
    plant.advance(2.0)
    pose = plant.true_pose
    assert math.hypot(pose.x_m, pose.y_m) > 0.05
    assert math.remainder(
        math.atan2(pose.y_m, pose.x_m) - math.radians(direction), math.tau
    ) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("key", "count"), [(b"\xaa\x55", 1234), (b"\x55\xaa", 0)])
def test_counts_are_saved_for_the_next_start_with_the_key(key, count):
    board = Plant(TRAXBOT, World()).motor_board
    board.preset_encoder(0.0, 1, 1234)
    Omni3MDRegisters(board).write(b"\xed" + key, 0.1)
    board.preset_encoder(0.2, 1, 0)
    board.power_cycle(0.3)
    assert board.encoder(1, 0.4) == count


# ---- how robots and sonars differ from their models


def test_wheel_ratio_keeps_the_mean():
    errors = robot_errors("wheel_ratio=1.02")
    assert errors.right_scale / errors.left_scale == pytest.approx(1.02)
    assert errors.right_scale + errors.left_scale == pytest.approx(2.0)


def test_all_keys_of_a_robot():
    errors = robot_errors(
        "wheel_size=1.1,axle=0.98,slip=0.1,load=1.5,control=40,noise=2e-5,turn_noise=1e-4,phase=0.2"
    )
    assert errors == pytest.approx((1.1, 1.1, 0.98, 0.1, 1.5, 40.0, 2e-5, 1e-4, 0.2))


def test_errors_out_of_a_file(tmp_path):
    path = tmp_path / "robot7.yaml"
    path.write_text("axle: 1.03\nslip: 0.05\n")
    assert robot_errors(str(path)) == pytest.approx((1.0, 1.0, 1.03, 0.05, 1.0, 20.0, 0.0, 0.0, 0.0))


def test_errors_of_sonars():
    assert sonar_errors("noise=0.01,crosstalk=0.5") == SonarErrors(0.01, 0.0, 0.5)


@pytest.mark.parametrize(
    "text, message",
    [
        ("axel=1", "--error 'axel=1': key 'axel' is unknown, expected wheel_ratio, wheel_size, axle, slip"),
        ("axle=3", "axle is '3', expected 0.5 to 2"),
        ("axle", "axle is '', expected 0.5 to 2"),
        ("axle=nan", "axle is 'nan'"),
        ("slip=1", "slip is '1', expected 0 to 0.9"),
        ("slip=-0.1", "slip is '-0.1', expected 0 to 0.9"),
        ("nowhere.yaml", "No such file"),
    ],
)
def test_bad_errors_name_key_value_and_range(text, message):
    with pytest.raises(ConfigError, match=message):
        robot_errors(text)


@pytest.mark.parametrize("text", ["axle: true", "- 1", "axle: [", "axle: wide"])
def test_bad_files_of_errors(tmp_path, text):
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match="robot.yaml") as caught:
        robot_errors(str(path))
    assert "\n" not in str(caught.value)
