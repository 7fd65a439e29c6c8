"""Faults of motors, encoders, battery, IMU and radio: each function switches one on or off in a `Plant`.

Times are those of the plant, which a simulated chip lets run up to 1 ms ahead.
"""

from sim_arduino.hardware.bridge_plant import BridgePlant
from sim_arduino.hardware.encoders import Bounce
from sim_arduino.hardware.imu import MPU6050, Mpu6050
from sim_arduino.hardware.wiring import Plant

WHEELS = ("left", "right")
CHANNELS = ("a", "b")
NO_BOUNCE = Bounce(0, 0.0)


def _bridge(plant: Plant) -> BridgePlant:
    assert plant.bridge, "the fault table refuses these faults without a bridge"
    return plant.bridge


def encoder_open(plant: Plant, on: bool, wheel: str, channel: str) -> None:
    """A wire is broken: the board sees its pull-up."""
    _bridge(plant).encoder(WHEELS.index(wheel)).open(CHANNELS.index(channel), on)


def encoder_oscillation(plant: Plant, on: bool, wheel: str, channel: str, rate: float) -> None:
    """A wire is broken and picks up the motor's pulses."""
    _bridge(plant).encoder(WHEELS.index(wheel)).open(CHANNELS.index(channel), on, rate)


def encoder_swapped(plant: Plant, on: bool, wheel: str) -> None:
    """The wires of channels A and B are exchanged."""
    _bridge(plant).encoder(WHEELS.index(wheel)).swapped = on


def encoder_bounce(plant: Plant, on: bool, wheel: str, pulses: float, spacing: float) -> None:
    """Short pulses follow each edge."""
    _bridge(plant).encoder(WHEELS.index(wheel)).bounce = Bounce(int(pulses), spacing) if on else NO_BOUNCE


def wheel_blocked(plant: Plant, on: bool, wheel: str) -> None:
    """Something holds a wheel."""
    _bridge(plant).motor(WHEELS.index(wheel)).blocked = on


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
