"""The motor board: registers on I2C, three wheels across, and how robots differ from their models."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.errors import ConfigError
from mrl_driver.robot import models
from sim_arduino.faults.key_values import robot_errors
from sim_arduino.hardware.motor import Mode
from sim_arduino.hardware.omni3md import Omni3MD
from sim_arduino.hardware.robot_physics import RobotPhysics, params_for, shares_for, twist_of

TRAXBOT = models.load("traxbot")


def fresh(model=TRAXBOT):
    board = Omni3MD(RobotPhysics(params_for(model)), model)
    gains = model.board
    board.set_gains(0.0, gains["kp"], gains["ki"], gains["kd"])
    board.set_ramp(0.0, gains["ramp_time"], 0)
    return board


def read(board, register, count, time_s=0.0):
    """`count` bytes from a register, as an I2C master reads them."""
    board.write(bytes([register]), time_s)
    return board.read(count, time_s)


def modes(board):
    return [motor.mode for motor in board.robot.motors]


@pytest.mark.parametrize(
    "data", [struct.pack(">BBh2B", 0xEF, 1, 77, 0, 0), b"\xf1\x03\xaa\x04\x55"], ids=["preset", "time-out"]
)
def test_settings_need_their_key(data):
    board = fresh()
    board.write(data, 0.0)
    assert (board.encoder(1, 0.0), board.timeout_s) == (0, 0.0)


@pytest.mark.parametrize(
    "told, speeds, motor, m_s",
    [({"wheel_radius": 5400}, (500, 0), 0, 0.25), ({"axis_radius": 17400}, (0, 500), 2, 0.09)],
)
def test_a_larger_wheel_told_turns_slower_and_on_a_larger_axis_faster(told, speeds, motor, m_s):
    board = fresh()
    board.set_geometry(0.0, board.geometry._replace(**told))
    board.move_differential(0.0, *speeds)
    assert board.robot.motors[motor].target == pytest.approx(m_s / TRAXBOT.drive.metres_per_count)


@pytest.mark.parametrize("data", [b"\xfc\xaa\x54", b"\xfc\x55\xaa", b"\xfc", b"\xfc\xaa\x55\x00"])
def test_stop_needs_its_key(data):
    board = fresh()
    board.move_differential(0.0, 300, 0)
    board.write(data, 1.0)
    assert Mode.SPEED in modes(board)


def test_three_encoders_battery_and_temperature_in_one_transfer():
    board = fresh()
    for encoder, count in ((1, 100), (2, -200), (3, 300)):
        board.preset_encoder(0.0, encoder, count)
    assert struct.unpack(">5h", read(board, 0xD8, 10)) == (100, -200, 300, 136, 250)


@pytest.mark.parametrize("register, value", [(0xFE, b"\x01"), (0xFD, b"\x48\xff\xff"), (0xD3, b"\x14")])
def test_one_byte_registers_are_followed_by_ones(register, value):
    assert read(fresh(), register, len(value)) == value


def test_i2c_timeout_stops_the_motors_when_the_master_is_silent():
    """300 ms after the last traffic, to the moment."""
    board = fresh()
    board.write(b"\xf1\x03\xaa\x03\x55", 0.0)
    board.move_differential(1.0, 300, 0)
    board.advance(1.2999)
    assert Mode.SPEED in modes(board)
    board.advance(1.3001)
    assert modes(board) == [Mode.BRAKE] * 3


@pytest.mark.parametrize(("key", "turns"), [(b"\xaa\x55", True), (b"\x55\xaa", False)])
def test_calibration_turns_the_wheels_for_a_second_with_the_key(key, turns):
    board = fresh()
    board.write(b"\xfb\x01\x01\x01" + key, 0.0)
    board.advance(0.9)
    assert modes(board) == [Mode.DUTY if turns else Mode.BRAKE] * 3
    board.advance(1.5)
    assert modes(board) == [Mode.BRAKE] * 3


def test_writes_during_its_eeprom_time_are_noticed():
    board = fresh()
    board.write(struct.pack(">B4H", 0xEA, 8700, 2700, 437, 640), 1.0)
    board.write(b"\xfc\xaa\x55", 1.019)
    assert board.too_early == 1


def test_a_busy_board_can_refuse():
    board = fresh()
    board.busy_nack = True
    board.set_geometry(1.0, board.geometry)
    assert board.write(b"\xd8", 1.019) is False
    assert board.write(b"\xd8", 1.021) is True


def test_prescaler_keeps_the_count():
    board = fresh()
    board.robot.motors[0].travel = 500.0
    board.set_prescaler(0.0, 1, 2)
    assert board.encoder(1, 0.0) == 500


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


def test_wheel_ratio_keeps_the_mean():
    errors = robot_errors("wheel_ratio=1.02")
    assert errors.right_scale / errors.left_scale == pytest.approx(1.02)
    assert errors.right_scale + errors.left_scale == pytest.approx(2.0)


def test_all_keys_of_a_robot():
    errors = robot_errors(
        "wheel_size=1.1,axle=0.98,slip=0.1,load=1.5,control=40,noise=2e-5,turn_noise=1e-4,phase=0.2"
    )
    assert errors == pytest.approx((1.1, 1.1, 0.98, 0.1, 1.5, 40.0, 2e-5, 1e-4, 0.2, 1.1, 1.1))


@pytest.mark.parametrize(
    "text, message",
    [
        ("axel=1", "--error 'axel=1': key 'axel' is unknown, expected wheel_ratio, wheel_size, axle, slip"),
        ("axle=3", "axle is '3', expected 0.5 to 2"),
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
