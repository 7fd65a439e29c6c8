"""The IMU: its registers, and what it measures of the robot's true motion."""

import math
import statistics
import struct

import pytest

from mrl_driver.robot.models import ImuMount
from sim_arduino.hardware import imu as chip
from sim_arduino.hardware.imu import ImuErrors, InertialSensor, Mpu6050
from sim_arduino.hardware.wiring import Plant
from sim_arduino.serve import factory
from sim_arduino.world.shapes import Wall
from sim_arduino.world.world import World
from tests.models import model

PERIOD_S, DELAY_S = 0.005, 4.8e-3
SETTINGS = ((chip.PWR_MGMT_1, 0x01), (chip.SMPLRT_DIV, 4), (chip.CONFIG, 3), (chip.GYRO_CONFIG, 8))
"""As the board sets the chip up: awake, 200 Hz, 42 Hz, 500 deg/s; 2 g is the chip's own."""
RAD_S_PER_COUNT, M_S2_PER_COUNT = math.radians(1 / 65.5), chip.G_M_S2 / 16384
SILENT = ImuErrors(accel_noise=0.0)
EXACT = 1e-9
COUNT = 1.0  # Rounding [count]
SETTLED_S = 0.5


def registers(imu, first, count=1, time_s=0.0):
    assert imu.write(bytes([first]), time_s)
    return imu.read(count, time_s)


def set_up(imu, time_s=0.0):
    for register, value in SETTINGS:
        imu.write(bytes([register, value]), time_s)


def measured(imu, time_s=0.0):
    values = struct.unpack(">7h", registers(imu, chip.ACCEL_XOUT_H, 14, time_s))
    return [n * M_S2_PER_COUNT for n in values[:3]], [n * RAD_S_PER_COUNT for n in values[4:]]


def alone(errors=SILENT, mount=None):
    """A chip on a body that the test moves, awake."""
    imu = Mpu6050(InertialSensor(mount or ImuMount(), errors), lambda time_s: None)
    set_up(imu)
    return imu


def robot(errors=SILENT, world=None, **options):
    """A TraxBot with the chip awake, on an endless floor."""
    plant = Plant(model("traxbot"), world or World(), imu=True, imu_errors=errors, **options)
    set_up(plant.imu)
    plant.motor_board.fed = True
    return plant


def turned(plant, drive_s):
    """Integral of the chip's rate about the vertical while the robot drives, stops and stands [rad]."""
    total, period, stopped = 0.0, plant.imu.sensor.period_s, False
    for step in range(round((drive_s + SETTLED_S) / period)):
        time_s = (step + 0.5) * period
        plant.advance(time_s)
        total += plant.imu.sensor.gyro_rad_s[2] * period
        if time_s > drive_s and not stopped:
            plant.motor_board.stop(time_s)
            stopped = True
    return total


@pytest.mark.parametrize("who_am_i, power", [(chip.MPU6050, chip.SLEEP), (chip.MPU9250, 0x01)])
def test_only_an_mpu_6050_sleeps_after_power_up(who_am_i, power):
    imu = Mpu6050(InertialSensor(ImuMount()), lambda time_s: None, who_am_i)
    assert registers(imu, chip.WHO_AM_I) == bytes([who_am_i])
    assert registers(imu, chip.PWR_MGMT_1) == bytes([power])
    assert imu.asleep == (who_am_i == chip.MPU6050)


def test_data_are_zero_for_30_ms_after_sleep():
    imu = alone()
    imu.moved(chip.START_S - PERIOD_S, 0.0, 0.0, 0.0)
    assert measured(imu) == ([0, 0, 0], [0, 0, 0])
    imu.moved(1.5 * PERIOD_S, 0.0, 0.0, 0.0)
    assert measured(imu)[0][2] == pytest.approx(chip.G_M_S2, abs=COUNT * M_S2_PER_COUNT)


@pytest.mark.parametrize("setting, per_deg_s", list(enumerate(chip.GYRO_COUNTS)))
def test_full_scale_of_the_gyro(setting, per_deg_s):
    imu = alone()
    imu.write(bytes([chip.GYRO_CONFIG, setting << 3]), 0.0)
    imu.moved(1.0, 0.0, 0.0, math.radians(100.0))
    (count,) = struct.unpack(">h", registers(imu, chip.GYRO_ZOUT_L - 1, 2))
    assert count == pytest.approx(100.0 * per_deg_s, abs=COUNT)


@pytest.mark.parametrize("pieces", [1, 7, 1000])
def test_samples_come_at_their_rate_however_the_motion_is_cut(pieces):
    sensor = InertialSensor(ImuMount(), SILENT)
    sensor.start(PERIOD_S, DELAY_S)
    for _ in range(pieces):
        sensor.moved(1.0025 / pieces, 0.1 / pieces, 0.0, 1.0 / pieces)
    assert sensor.samples == 200
    assert sensor.gyro_rad_s[2] == pytest.approx(1.0 / 1.0025)


def test_the_filter_delays_by_what_the_data_sheet_says():
    """What the samples of a rate of 1 rad/s lack of the turn is the delay, of which the mean is half a period."""
    sensor = InertialSensor(ImuMount(), SILENT)
    sensor.start(PERIOD_S, DELAY_S)
    sensor.moved(200.5 * PERIOD_S, 0.0, 0.0, 0.0)
    total, samples = 0.0, 40
    for _ in range(samples):
        sensor.moved(PERIOD_S, 0.0, 0.0, PERIOD_S)
        total += sensor.gyro_rad_s[2] * PERIOD_S
    assert (samples - 0.5) * PERIOD_S - total + 0.5 * PERIOD_S == pytest.approx(DELAY_S)


@pytest.mark.parametrize("slip", [False, True])
def test_the_integral_of_the_rate_is_the_true_turn(slip):
    plant = robot(slip=slip)
    plant.motor_board.move_differential(0.0, 200, 700)
    total = turned(plant, 3.0)
    assert plant.robot.state.yaw_rad > 1.0
    assert total == pytest.approx(plant.robot.state.yaw_rad, abs=EXACT)


def test_the_gyro_does_not_see_a_turn_that_a_wall_prevents():
    """The wheels turn by 0.9 rad and slip on the floor."""
    plant = robot(world=World([Wall(0.2, -9, 0.2, 9)]))
    plant.motor_board.move_differential(0.0, 200, 300)
    total = turned(plant, 3.0)
    assert total == pytest.approx(plant.robot.state.yaw_rad, abs=EXACT)
    assert abs(total) < 0.1


def test_on_a_circle_the_acceleration_points_to_its_middle():
    plant = robot()
    plant.motor_board.move_differential(0.0, 200, 500)
    plant.advance(6.0)
    (along, across, up), (_, _, rate) = measured(plant.imu, 6.0)
    left, _, right = plant.robot.motors
    speed = 0.5 * (left.speed + right.speed) * plant.model.drive.metres_per_count
    assert across == pytest.approx(speed * rate, abs=0.005)
    assert (along, up) == pytest.approx((0.0, chip.G_M_S2), abs=0.01)


def test_an_imu_off_the_middle_feels_the_turn():
    imu = alone(mount=ImuMount(x_m=0.1))
    imu.moved(1.0, 0.0, 0.0, 2.0)
    (along, across, _), _ = measured(imu)
    assert (along, across) == pytest.approx((-0.4, 0.0), abs=COUNT * M_S2_PER_COUNT)


def test_the_mount_turns_what_is_measured():
    imu = alone(mount=ImuMount(roll_deg=180.0, yaw_deg=90.0))
    imu.moved(1.0, 0.0, 0.0, 1.0)
    accel, gyro = measured(imu)
    assert gyro[2] == pytest.approx(-1.0, abs=COUNT * RAD_S_PER_COUNT)
    assert accel[2] == pytest.approx(-chip.G_M_S2, abs=COUNT * M_S2_PER_COUNT)


def test_bias_and_scale_are_in_the_readings():
    imu = alone(SILENT._replace(gyro_bias_rad_s=(0.1, 0.2, 0.3), gyro_scale=(1.0, 1.0, 1.03)))
    imu.moved(1.0, 0.0, 0.0, 1.0)
    assert measured(imu)[1] == pytest.approx([0.1, 0.2, 1.33], abs=COUNT * RAD_S_PER_COUNT)


def test_noise_has_the_density_that_is_asked_for():
    """The sum of white noise over a time has the variance of half the density squared times the time."""
    density, sums = math.radians(0.005), []
    for seed in range(100):
        sensor = InertialSensor(ImuMount(), SILENT._replace(gyro_noise=density), seed)
        sensor.start(PERIOD_S, DELAY_S)
        total = [0.0, 0.0, 0.0]
        for _ in range(100):
            sensor.moved(PERIOD_S, 0.0, 0.0, 0.0)
            total = [before + rate * PERIOD_S for before, rate in zip(total, sensor.gyro_rad_s)]
        sums += total
    assert statistics.pstdev(sums) == pytest.approx(density * math.sqrt(0.5 * 0.5), rel=0.15)


def test_drawn_errors_are_repeatable_and_within_the_data_sheet():
    drawn = [ImuErrors.drawn(seed) for seed in range(200)]
    assert drawn[7] == ImuErrors.drawn(7) != drawn[8]
    biases = [bias for errors in drawn for bias in errors.gyro_bias_rad_s]
    scales = [scale for errors in drawn for scale in errors.gyro_scale]
    assert max(map(abs, biases)) <= math.radians(20.0)
    assert statistics.pstdev(biases) == pytest.approx(math.radians(20.0) / 3, rel=0.1)
    assert max(abs(scale - 1.0) for scale in scales) <= 0.03 + EXACT
    assert statistics.pstdev(scales) == pytest.approx(0.01, rel=0.1)


def test_each_robot_of_a_team_has_errors_of_its_own():
    robots = factory.make_team(
        factory.Options(imu=True, imu_seed=3, footprint="none"), ["one", "two"], ["0,0,0", "1,0,0"]
    )
    rates = []
    for robot_ in robots:
        robot_.close()
        set_up(robot_.plant.imu)
        robot_.plant.imu.moved(1.0, 0.0, 0.0, 0.0)
        rates.append(robot_.plant.imu.sensor.gyro_rad_s[2])
    expected = [ImuErrors.drawn(seed).gyro_bias_rad_s[2] for seed in (3, 4)]
    assert rates == pytest.approx(expected, abs=math.radians(0.3))
