"""Faults of motors, encoders, battery, sonars, IMU and radio: each function switches one on or off in a `Plant`.

The first line of its docstring is the text of the fault in the help.

Times are those of the plant, which a simulated chip lets run up to 1 ms ahead.
"""

from typing import Any, Callable, Dict, Tuple

from mrl_driver.robot.sonar import NAMES as SONARS
from sim_arduino.hardware import sonars
from sim_arduino.hardware.encoders import Bounce, Quadrature
from sim_arduino.hardware.imu import MPU6050, Mpu6050
from sim_arduino.hardware.motor import Motor
from sim_arduino.hardware.wiring import Plant

from .fault_kind import fault
from .key_values import Key

WHEELS, CHANNELS = ("left", "right"), ("a", "b")
NO_BOUNCE = Bounce(0, 0.0)
_WHEEL = Key("wheel", "left", None, 0.0, "left or right", choices=WHEELS)
_CHANNEL = Key("channel", "a", None, 0.0, "channel of the encoder, a or b", choices=CHANNELS)
_OSCILLATION = Key("rate", 62500.0, 1.0, 1e6, "edges per second: two for each pulse", "1/s")
_BOUNCE = (
    Key("pulses", 1, 1, 100, "number of pulses"),
    Key("spacing", 20e-6, 1e-6, 0.01, "time between their edges", "s"),
)
_SONAR_STATES = "dead: no reading; stuck: always the same one; deaf: nothing in range"
_SONAR = (
    Key("sonar", "front", None, 0.0, "front, left or right", choices=SONARS),
    Key("state", sonars.DEAD, None, 0.0, _SONAR_STATES, choices=sonars.STATES),
)

NEEDS: Dict[str, Tuple[str, str, Callable[[Plant], Any]]] = {
    "motors": ("motors", "another robot", lambda plant: plant.model.drives),
    "omni3md": (
        "an OMNI-3MD",
        "another robot, such as traxbot",
        lambda plant: plant.model.drives and not plant.bridge,
    ),
    "bridge": ("motors on an H-bridge", "another robot, such as duo", lambda plant: plant.bridge),
    "sonars": ("sonars", "a board without environment sensors", lambda plant: plant.sonars_fitted),
    "imu": ("an IMU", "--imu too", lambda plant: plant.imu),
    "radio": ("a radio", "--radio too", lambda plant: plant.xbee),
}
"""What faults need, by `FaultKind.needs`: as text, the robot that is expected, and whether a robot has it."""


def _index(wheel: str) -> int:
    """Index of a wheel's motor in those of the body: left, rear, right."""
    return 2 * WHEELS.index(wheel)


def _motor(plant: Plant, wheel: str) -> Motor:
    """A motor of an OMNI-3MD."""
    motor = plant.robot.motors[_index(wheel)]
    assert isinstance(motor, Motor)
    return motor


def _encoder(plant: Plant, wheel: str) -> Quadrature:
    """An encoder of an H-bridge board."""
    assert plant.bridge, "FaultyEngine refuses these faults without a bridge"
    return plant.bridge.encoder(WHEELS.index(wheel))


@fault(Key("volts", 3.0, 0.0, 15.0, "voltage lost", "V"))
def battery_sag(plant: Plant, on: bool, volts: float) -> None:
    """The battery's voltage drops."""
    plant.robot.sag(volts if on else 0.0)


@fault(_WHEEL, _CHANNEL, needs="motors")
def encoder_open(plant: Plant, on: bool, wheel: str, channel: str) -> None:
    """A wire of an encoder is broken.

    An H-bridge board sees its pull-up, and an OMNI-3MD counts nothing.
    """
    if plant.bridge:
        _encoder(plant, wheel).open(CHANNELS.index(channel), on)
    else:
        _motor(plant, wheel).sensed = 0.0 if on else 1.0


@fault(_WHEEL, _CHANNEL, _OSCILLATION, needs="bridge")
def encoder_oscillation(plant: Plant, on: bool, wheel: str, channel: str, rate: float) -> None:
    """A broken wire of an encoder picks up the pulses of the motor."""
    _encoder(plant, wheel).open(CHANNELS.index(channel), on, rate)


@fault(_WHEEL, needs="motors")
def encoder_swapped(plant: Plant, on: bool, wheel: str) -> None:
    """Channels A and B of an encoder are exchanged."""
    if plant.bridge:
        _encoder(plant, wheel).swapped = on
    else:
        _motor(plant, wheel).sensed = -1.0 if on else 1.0


@fault(_WHEEL, *_BOUNCE, needs="bridge")
def encoder_bounce(plant: Plant, on: bool, wheel: str, pulses: float, spacing: float) -> None:
    """Short pulses follow each edge of an encoder."""
    _encoder(plant, wheel).bounce = Bounce(int(pulses), spacing) if on else NO_BOUNCE


@fault(_WHEEL, needs="motors")
def wheel_blocked(plant: Plant, on: bool, wheel: str) -> None:
    """Something holds a wheel."""
    plant.robot.motors[_index(wheel)].blocked = on


@fault(_WHEEL, Key("grip", 0.5, 0.0, 1.0, "share of its distance that moves the robot"), needs="motors")
def wheel_slips(plant: Plant, on: bool, wheel: str, grip: float) -> None:
    """A wheel turns further than it moves the robot."""
    plant.robot.grip[_index(wheel)] = grip if on else 1.0


@fault(_WHEEL, needs="omni3md")
def motor_reversed(plant: Plant, on: bool, wheel: str) -> None:
    """The wires of a motor are exchanged."""
    _motor(plant, wheel).polarity = -1.0 if on else 1.0


@fault(needs="omni3md")
def motor_board_absent(plant: Plant, on: bool) -> None:
    """The motor board does not answer."""
    plant.motor_board.present = not on


@fault(*_SONAR, needs="sonars")
def sonar_failed(plant: Plant, on: bool, sonar: str, state: str) -> None:
    """A sonar gives no reading, or always the same one."""
    if on:
        plant.sonars.failed[sonar] = state
    else:
        plant.sonars.failed.pop(sonar, None)


def _imu(plant: Plant) -> Mpu6050:
    assert plant.imu, "FaultyEngine refuses these faults without an IMU"
    return plant.imu


@fault(needs="imu")
def imu_absent(plant: Plant, on: bool) -> None:
    """The IMU does not answer.

    A wire of the bus is broken; the IMU keeps its power and settings.
    """
    _imu(plant).present = not on


@fault(needs="imu")
def imu_power(plant: Plant, on: bool) -> None:
    """The IMU has no power, and comes back asleep.

    Its registers then have their first values.
    """
    _imu(plant).power_cycle()
    _imu(plant).present = not on


@fault(needs="imu")
def imu_frozen(plant: Plant, on: bool) -> None:
    """The IMU's readings do not change."""
    _imu(plant).frozen = on


@fault(Key("identity", 0x12, 0, 255, "its WHO_AM_I"), needs="imu")
def imu_other(plant: Plant, on: bool, identity: float) -> None:
    """Another chip is at the IMU's address."""
    _imu(plant).who_am_i = int(identity) if on else MPU6050


@fault(needs="radio")
def radio_cut(plant: Plant, on: bool) -> None:
    """The radio neither sends nor receives."""
    assert plant.xbee, "FaultyEngine refuses this fault without a radio"
    plant.xbee.set(cut=on)
