"""Faults of motors, encoders, battery, sonars, IMU and radio: each function switches one on or off in a `Plant`.

Times are those of the plant, which a simulated chip lets run up to 1 ms ahead.
"""

from sim_arduino.hardware.bridge_plant import BridgePlant
from sim_arduino.hardware.encoders import Bounce
from sim_arduino.hardware.imu import MPU6050, Mpu6050
from sim_arduino.hardware.motor import Motor
from sim_arduino.hardware.wiring import Plant

WHEELS = ("left", "right")
CHANNELS = ("a", "b")
NO_BOUNCE = Bounce(0, 0.0)


def _bridge(plant: Plant) -> BridgePlant:
    assert plant.bridge, "the fault table refuses these faults without a bridge"
    return plant.bridge


def _index(wheel: str) -> int:
    """Index of a wheel's motor in those of the body: left, rear, right."""
    return 2 * WHEELS.index(wheel)


def _motor(plant: Plant, wheel: str) -> Motor:
    """A motor of an OMNI-3MD."""
    motor = plant.robot.motors[_index(wheel)]
    assert isinstance(motor, Motor)
    return motor


def encoder_open(plant: Plant, on: bool, wheel: str, channel: str) -> None:
    """A wire is broken: an H-bridge board sees its pull-up, and an OMNI-3MD counts nothing."""
    if not plant.bridge:
        _motor(plant, wheel).sensed = 0.0 if on else 1.0
        return
    _bridge(plant).encoder(WHEELS.index(wheel)).open(CHANNELS.index(channel), on)


def encoder_oscillation(plant: Plant, on: bool, wheel: str, channel: str, rate: float) -> None:
    """A wire is broken and picks up the motor's pulses."""
    _bridge(plant).encoder(WHEELS.index(wheel)).open(CHANNELS.index(channel), on, rate)


def encoder_swapped(plant: Plant, on: bool, wheel: str) -> None:
    """The wires of channels A and B are exchanged."""
    if not plant.bridge:
        _motor(plant, wheel).sensed = -1.0 if on else 1.0
        return
    _bridge(plant).encoder(WHEELS.index(wheel)).swapped = on


def encoder_bounce(plant: Plant, on: bool, wheel: str, pulses: float, spacing: float) -> None:
    """Short pulses follow each edge."""
    _bridge(plant).encoder(WHEELS.index(wheel)).bounce = Bounce(int(pulses), spacing) if on else NO_BOUNCE


def wheel_blocked(plant: Plant, on: bool, wheel: str) -> None:
    """Something holds a wheel."""
    plant.robot.motors[_index(wheel)].blocked = on


def wheel_slips(plant: Plant, on: bool, wheel: str, grip: float) -> None:
    """A wheel turns further than it moves the body."""
    plant.robot.grip[_index(wheel)] = grip if on else 1.0


def motor_reversed(plant: Plant, on: bool, wheel: str) -> None:
    """The two wires of a motor are exchanged."""
    _motor(plant, wheel).polarity = -1.0 if on else 1.0


def motor_board_absent(plant: Plant, on: bool) -> None:
    """The motor board does not answer on the bus."""
    plant.motor_board.present = not on


def sonar_failed(plant: Plant, on: bool, sonar: str, state: str) -> None:
    """A sonar gives no reading, or always the same one."""
    if on:
        plant.sonars.failed[sonar] = state
    else:
        plant.sonars.failed.pop(sonar, None)


def battery_sag(plant: Plant, on: bool, volts: float) -> None:
    """The battery's voltage drops."""
    plant.robot.sag(volts if on else 0.0)


def _imu(plant: Plant) -> Mpu6050:
    assert plant.imu, "FaultyEngine refuses these faults without an IMU"
    return plant.imu


def imu_absent(plant: Plant, on: bool) -> None:
    """A wire of the bus is broken; the IMU keeps its power and settings."""
    _imu(plant).present = not on


def imu_power(plant: Plant, on: bool) -> None:
    """The IMU has no power; when it is back, its registers have their first values."""
    _imu(plant).power_cycle()
    _imu(plant).present = not on


def imu_frozen(plant: Plant, on: bool) -> None:
    """The data registers keep their values."""
    _imu(plant).frozen = on


def imu_other(plant: Plant, on: bool, identity: float) -> None:
    """Another chip answers: WHO_AM_I differs."""
    _imu(plant).who_am_i = int(identity) if on else MPU6050


def radio_cut(plant: Plant, on: bool) -> None:
    """The radio's antenna is off."""
    assert plant.xbee, "FaultyEngine refuses this fault without a radio"
    plant.xbee.set(cut=on)
