"""The motor board: registers on I2C and what they do."""

import struct

import pytest

from mrl_driver.robot import models
from sim_arduino.hardware.motor import Mode
from sim_arduino.hardware.omni3md import Omni3MD
from sim_arduino.hardware.omni3md_registers import Omni3MDRegisters
from sim_arduino.hardware.robot_physics import RobotPhysics, params_for

TRAXBOT = models.load("traxbot")
SPEED = 0.01
"""Share of the asked speed within which the robot drives."""


@pytest.fixture(params=["traxbot", "stingbot"])
def model(request):
    return models.load(request.param)


def fresh(model=TRAXBOT):
    board = Omni3MD(RobotPhysics(params_for(model)), model)
    gains = model.board
    board.set_gains(0.0, gains["kp"], gains["ki"], gains["kd"])
    board.set_ramp(0.0, gains["ramp_time"], 0)
    return board


def read(board, register, count, time_s=0.0):
    """`count` bytes from a register, as an I2C master reads them."""
    registers = Omni3MDRegisters(board)
    registers.write(bytes([register]), time_s)
    return registers.read(count, time_s)


def read_word(board, register, time_s):
    return struct.unpack(">h", read(board, register, 2, time_s))[0]


def modes(board):
    return [motor.mode for motor in board.robot.motors]


@pytest.mark.parametrize(
    ("linear", "angular", "field", "change"), [(500, 0, "x_m", 0.5), (0, 800, "yaw_rad", 0.8)]
)
def test_differential_command_gives_si_speeds(model, linear, angular, field, change):
    """@11,500,0e runs at 0.5 m/s: the fitted radii make it come out right; without a time-out for ever."""
    board = fresh(model)
    board.move_differential(0.0, linear, angular)
    board.advance(5.0)
    before = getattr(board.robot.state, field)
    board.advance(6.0)
    assert getattr(board.robot.state, field) - before == pytest.approx(change, rel=SPEED)


@pytest.mark.parametrize(
    "data", [struct.pack(">BBh2B", 0xEF, 1, 77, 0, 0), b"\xf1\x03\xaa\x04\x55"], ids=["preset", "time-out"]
)
def test_settings_need_their_key(data):
    """The time-out's is its value twice."""
    board = fresh()
    Omni3MDRegisters(board).write(data, 0.0)
    assert (board.encoder(1, 0.0), board.timeout_s) == (0, 0.0)


def test_a_larger_wheel_radius_told_turns_the_wheels_slower():
    board = fresh()
    board.set_geometry(0.0, board.geometry._replace(wheel_radius=5400))
    board.move_differential(0.0, 500, 0)
    assert board.robot.motors[0].target == pytest.approx(0.25 / TRAXBOT.drive.metres_per_count)


def test_a_larger_axis_radius_told_turns_the_robot_faster():
    board = fresh()
    board.set_geometry(0.0, board.geometry._replace(axis_radius=17400))
    board.move_differential(0.0, 0, 500)
    assert board.robot.motors[2].target == pytest.approx(0.09 / TRAXBOT.drive.metres_per_count)


def test_percent_moves_left_and_right():
    board = fresh()
    Omni3MDRegisters(board).write(struct.pack(">B3h", 0xF8, 40, 0, -20), 0.0)
    assert [motor.target for motor in board.robot.motors] == pytest.approx(
        [0.4 * 7457.9, 0.0, -0.2 * 7457.9], abs=1.0
    )


def test_percent_moves_without_pid_set_the_duty():
    board = fresh()
    Omni3MDRegisters(board).write(struct.pack(">B3h", 0xF7, 40, 0, -20), 0.0)
    assert [motor.duty for motor in board.robot.motors] == [0.4, 0.0, -0.2]


def test_stop_brakes_at_once():
    board = fresh()
    board.move_differential(0.0, 300, 0)
    Omni3MDRegisters(board).write(b"\xfc\xaa\x55", 3.0)
    board.advance(3.5)
    assert [motor.speed for motor in board.robot.motors] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("data", [b"\xfc\xaa\x54", b"\xfc\x55\xaa", b"\xfc", b"\xfc\xaa\x55\x00"])
def test_stop_needs_its_key(data):
    board = fresh()
    board.move_differential(0.0, 300, 0)
    Omni3MDRegisters(board).write(data, 1.0)
    assert Mode.SPEED in modes(board)


def test_encoders_wrap():
    board = fresh()
    board.preset_encoder(0.0, 1, 32767)
    board.robot.motors[0].travel = 1.0
    assert board.encoder(1, 0.0) == -32768


def test_prescaler_counts_tens():
    board = fresh()
    Omni3MDRegisters(board).write(b"\xf0\x01\x01\xaa\x55", 0.0)
    board.robot.motors[0].travel = 1239.0
    assert board.encoder(1, 0.0) == 123


def test_three_encoders_battery_and_temperature_in_one_transfer():
    board = fresh()
    for encoder, count in ((1, 100), (2, -200), (3, 300)):
        board.preset_encoder(0.0, encoder, count)
    assert struct.unpack(">5h", read(board, 0xD8, 10)) == (100, -200, 300, 136, 250)


@pytest.mark.parametrize("register, value", [(0xFE, b"\x01"), (0xFD, b"\x48\xff\xff"), (0xD3, b"\x14")])
def test_one_byte_registers_are_followed_by_ones(register, value):
    assert read(fresh(), register, len(value)) == value


def test_position_move_ends_at_the_count():
    board = fresh()
    board.preset_encoder(0.0, 1, 1000)
    Omni3MDRegisters(board).write(struct.pack(">BBhhB", 0xEE, 1, 30, -500, 1), 0.0)
    board.advance(8.0)
    assert board.encoder(1, 8.0) == -500


def test_i2c_timeout_stops_the_motors_when_the_master_is_silent():
    """300 ms after the last traffic, to the moment."""
    board = fresh()
    Omni3MDRegisters(board).write(b"\xf1\x03\xaa\x03\x55", 0.0)
    board.move_differential(1.0, 300, 0)
    board.advance(1.2999)
    assert Mode.SPEED in modes(board)
    board.advance(1.3001)
    assert modes(board) == [Mode.BRAKE] * 3


def test_any_traffic_feeds_the_timeout():
    board = fresh()
    board.set_timeout(0.0, 3)
    board.move_differential(0.0, 300, 0)
    for tenth in range(1, 20):
        board.encoder(1, tenth / 10)
    assert Mode.SPEED in modes(board)


def test_calibration_turns_the_wheels_for_a_second_and_notes_their_speed():
    """Counts per control period of 50 ms at full speed."""
    board = fresh()
    Omni3MDRegisters(board).write(b"\xfb\x01\x01\x01\xaa\x55", 0.0)
    board.advance(1.5)
    assert modes(board) == [Mode.BRAKE] * 3
    assert read_word(board, 0xD2, 1.5) == pytest.approx(12429 / 20 * 13.0 / 12, rel=0.1)


def test_an_absent_board_does_not_acknowledge():
    board = fresh()
    board.present = False
    assert Omni3MDRegisters(board).write(b"\xfc\xaa\x55", 0.0) is False


def test_writes_during_its_eeprom_time_are_noticed():
    board = fresh()
    Omni3MDRegisters(board).write(struct.pack(">B4H", 0xEA, 8700, 2700, 437, 640), 1.0)
    Omni3MDRegisters(board).write(b"\xfc\xaa\x55", 1.019)
    assert board.too_early == 1


def test_a_busy_board_can_refuse():
    board = fresh()
    board.busy_nack = True
    board.set_geometry(1.0, board.geometry)
    assert Omni3MDRegisters(board).write(b"\xd8", 1.019) is False
    assert Omni3MDRegisters(board).write(b"\xd8", 1.021) is True


def test_one_motor_alone():
    board = fresh()
    Omni3MDRegisters(board).write(struct.pack(">BBh", 0xF6, 3, 50), 0.0)
    assert modes(board) == [Mode.BRAKE, Mode.BRAKE, Mode.SPEED]


def test_prescaler_keeps_the_count():
    board = fresh()
    board.robot.motors[0].travel = 500.0
    board.set_prescaler(0.0, 1, 2)
    assert board.encoder(1, 0.0) == 500


@pytest.mark.parametrize("linear", [300, -300])
def test_encoders_count_the_wheels_way(linear):
    board = fresh()
    board.move_differential(0.0, linear, 0)
    board.advance(4.0)
    assert board.encoder(3, 4.0) == pytest.approx(
        board.robot.state.x_m / TRAXBOT.drive.metres_per_count, abs=1
    )
