"""Faults of motors, encoders, battery, sonars, IMU, radio and inputs: each function switches one in a `Plant`.

The first line of its docstring is the text of the fault in the help.

Times are those of the plant, which a simulated chip lets run up to 1 ms ahead.
"""

from typing import Any, Callable, Dict, Set, Tuple

from mrl_driver.protocol.table import INPUTS, WHEELS
from mrl_driver.robot.models import ECHO_INPUTS
from mrl_driver.robot.sonar import NAMES as SONARS
from mrl_driver.robot.wiring import FRONT
from sim_arduino.hardware import sonars
from sim_arduino.hardware.bridge_plant import MOTORS
from sim_arduino.hardware.echo_ranges import SILENT, STATES
from sim_arduino.hardware.encoders import Bounce, Quadrature
from sim_arduino.hardware.imu import MPU6050, Mpu6050
from sim_arduino.hardware.motor import Motor
from sim_arduino.hardware.wiring import Plant

from .fault_kind import fault
from .key_values import Key

CHANNELS = ("a", "b")
NO_BOUNCE = Bounce(0, 0.0)
_WHEEL = Key("wheel", "left", None, 0.0, ", ".join(WHEELS) + "; the last two of four", choices=WHEELS)
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

_INPUT = Key("input", "bumper_left", None, 0.0, "row of the input table", choices=INPUTS)


def range_inputs(plant: Plant) -> Tuple[str, ...]:
    """Return the inputs with an HC-SR04 or an analog range sensor."""
    return (*plant.ranges.wires, *plant.range_volts)


NEEDS: Dict[str, Tuple[str, str, Callable[[Plant], Any]]] = {
    "motors": ("motors", "another robot", lambda plant: plant.model.drives),
    "omni3md": (
        "an OMNI-3MD",
        "another robot, such as traxbot",
        lambda plant: plant.model.drives and not plant.bridge,
    ),
    "bridge": ("motors on an H-bridge", "another robot, such as duo", lambda plant: plant.bridge),
    "sonars": (
        "MB1300 sonars",
        "a robot with them, without environment sensors; other range sensors have range_failed",
        lambda plant: plant.sonars.names,
    ),
    "ranges": ("range sensors", "another robot, with range_1_echo in its wiring", range_inputs),
    "servos": ("a servo", "a robot whose file has one", lambda plant: plant.servos),
    "imu": ("an IMU", "--imu too", lambda plant: plant.imu),
    "inputs": (
        "inputs that stop it",
        "a robot's file with bumpers, cliff sensors or an emergency stop",
        lambda plant: plant.bridge and plant.bridge.inputs.pins,
    ),
    "radio": ("a radio", "--radio too", lambda plant: plant.xbee),
}
"""What faults need, by `FaultKind.needs`: as text, the robot that is expected, and whether a robot has it."""


def _index(wheel: str) -> int:
    """Index of a wheel's motor in those of the body."""
    return MOTORS[WHEELS.index(wheel)]


def places(plant: Plant, key: str) -> Tuple[str, ...]:
    """Return the values that a key has on this robot; empty for keys that are not a place."""
    if key == _WHEEL.name:
        return WHEELS[: len(plant.bridge.outputs) if plant.bridge else FRONT]
    if key == _SONAR[0].name:
        return plant.sonars.names
    if key == _INPUT.name and plant.bridge:
        return (*range_inputs(plant), *plant.bridge.inputs.pins)
    return ()


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
    """An MB1300 sonar gives no reading, or always the same one."""
    if on:
        plant.sonars.failed[sonar] = state
    else:
        plant.sonars.failed.pop(sonar, None)


@fault(
    Key("input", ECHO_INPUTS[0], None, 0.0, "range_1 to range_3, on a Mega to range_6", choices=ECHO_INPUTS),
    Key("state", SILENT, None, 0.0, "silent: no echo, or 0 V; held: it stays as it is", choices=STATES),
    needs="ranges",
)
def range_failed(plant: Plant, on: bool, input: str, state: str) -> None:  # noqa: A002 - the name of the key
    """An HC-SR04 gives no echo, or holds it high; an analog sensor gives 0 V, or keeps its voltage."""
    if on:
        plant.ranges.failed[input] = state
    else:
        plant.ranges.failed.pop(input, None)


@fault(needs="servos")
def servo_stalled(plant: Plant, on: bool) -> None:
    """Something holds all servos."""
    for servo in plant.servos.values():
        servo.stalled = on


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


def _switch(names: Set[str], name: str, on: bool) -> None:
    (names.add if on else names.discard)(name)


@fault(_INPUT, needs="inputs")
def input_stuck(plant: Plant, on: bool, input: str) -> None:
    """An input stays active, such as a bumper that jams."""
    assert plant.bridge, "FaultyEngine refuses these faults without inputs"
    _switch(plant.bridge.inputs.stuck, input, on)


@fault(_INPUT._replace(default="emergency_stop"), needs="inputs")
def input_open(plant: Plant, on: bool, input: str) -> None:
    """A wire of an input is broken, such as that of the emergency stop."""
    assert plant.bridge, "FaultyEngine refuses these faults without inputs"
    _switch(plant.bridge.inputs.open, input, on)
