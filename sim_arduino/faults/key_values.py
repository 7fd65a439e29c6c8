"""Reads errors of a robot and its sonars from a command line or a YAML file: `wheel_ratio=1.01,axle=0.98`."""

import math
from typing import Any, Dict, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

from mrl_driver.errors import ConfigError
from mrl_driver.yaml_file import Reader, read_expected, short
from sim_arduino.hardware.robot_physics import Errors
from sim_arduino.hardware.sonars import SonarErrors


class Key(NamedTuple):
    """A key with its default and its range: a number, or text if `low` is None, perhaps one of `choices`."""

    name: str
    default: Union[float, str]
    low: Optional[float]
    high: float
    text: str
    unit: str = ""
    choices: Tuple[str, ...] = ()

    @property
    def line(self) -> str:
        """The key with its default and its range, for the help."""
        if self.low is None:
            return f"{self.name}={self.default}  {self.text}"
        return (
            f"{self.name}={self.default:g}  {self.text}, {self.low:g} to {self.high:g} {self.unit}".rstrip()
        )


ROBOT_KEYS = (
    Key("wheel_ratio", 1.0, 0.5, 2.0, "radius of the right wheel, divided by the left one"),
    Key("wheel_size", 1.0, 0.5, 2.0, "radius of all wheels, divided by the model's"),
    Key("axle", 1.0, 0.5, 2.0, "wheel separation, divided by the model's"),
    Key("slip", 0.0, 0.0, 0.9, "share of the yaw lost in turns"),
    Key("load", 1.0, 0.1, 5.0, "mass, divided by the model's"),
    Key("control", 20.0, 10.0, 40.0, "rate of the motor board's control loop [Hz]"),
    Key("noise", 0.0, 0.0, 0.01, "variance of a wheel's distance per distance [m2/m]"),
    Key("turn_noise", 0.0, 0.0, 0.1, "variance of the yaw per angle turned [rad2/rad]"),
    Key(
        "phase", 0.0, -0.45, 0.45, "delay of channel B of an H-bridge board's encoders, as a share of a count"
    ),
    Key("rear_left", 1.0, 0.5, 2.0, "radius of the rear left wheel of four, divided by the one in front"),
    Key("rear_right", 1.0, 0.5, 2.0, "the same on the right"),
)
SONAR_KEYS = (
    Key("noise", 0.0, 0.0, 1.0, "standard deviation [m]"),
    Key("missed", 0.0, 0.0, 1.0, "share of readings without an echo"),
    Key("crosstalk", 0.0, 0.0, 1.0, "share of pings of other sonars that are taken for an echo"),
    Key("gain", 1.0, 0.5, 2.0, "factor of the sensor's curve, divided by the thesis's"),
    Key("exponent", 1.0, 0.8, 1.2, "exponent of the sensor's curve, divided by the thesis's"),
    Key("offset", 0.0, -0.1, 0.1, "constant of the sensor's curve, minus the thesis's [m]"),
)


def robot_errors(text: str) -> Errors:
    """A robot's errors in `key=value,...`, or in YAML; ConfigError if a key is unknown or a value out of range."""
    values = _values("--error", text, ROBOT_KEYS)
    ratio, size = values["wheel_ratio"], values["wheel_size"]
    left = 2.0 / (1.0 + ratio) * size
    others = ("axle", "slip", "load", "control", "noise", "turn_noise", "phase")
    rear = [left * values["rear_left"], left * ratio * values["rear_right"]]
    return Errors(left, left * ratio, *(values[key] for key in others), *rear)


def sonar_errors(text: str) -> SonarErrors:
    """The sonars' errors in `key=value,...`, or in YAML; ConfigError if a key is unknown or a value out of range."""
    return SonarErrors(**_values("--sonar", text, SONAR_KEYS))


def _values(what: str, text: str, keys: Tuple[Key, ...]) -> Dict[str, Any]:
    if not text.endswith((".yaml", ".yml")):
        return values_of(f"{what} {short(text)}", pairs(text), keys)
    source = f"{what} {text!r}"
    given = Reader(source).mapping("", read_expected(text, "a YAML file"), "keys and numbers")
    return values_of(source, {str(name): value for name, value in given.items()}, keys)


def pairs(text: str) -> Dict[str, str]:
    """The values in `key=value,...`, by key."""
    parts = (part.partition("=") for part in text.split(",") if part)
    return {name.strip(): value for name, _, value in parts}


def values_of(source: str, given: Mapping[str, Any], keys: Sequence[Key]) -> Dict[str, Any]:
    """All keys' values, given in text or YAML, or defaults; ConfigError if a key is unknown or a value out of range."""
    known = {key.name: key for key in keys}
    for name in given:
        if name not in known:
            raise ConfigError(f"{source}: key {short(name)} is unknown, expected {', '.join(known)}")
    return {
        key.name: _checked(source, key, given[key.name]) if key.name in given else key.default for key in keys
    }


def _checked(source: str, key: Key, value: Any) -> Union[float, str]:
    """The value of a key: one of its choices, or a number in its range; whole if the default is."""
    if key.choices and value not in key.choices:
        expected = f"{', '.join(key.choices[:-1])} or {key.choices[-1]}"
        raise ConfigError(f"{source}: {key.name} is {short(value)}, expected {expected}")
    if key.low is None:
        return str(value)
    try:
        number = math.nan if isinstance(value, bool) else float(value)
    except (TypeError, ValueError):
        number = math.nan
    whole = isinstance(key.default, int)
    if not key.low <= number <= key.high or (whole and number % 1.0):
        raise ConfigError(
            f"{source}: {key.name} is {short(value)}, expected {'a whole number, ' if whole else ''}"
            f"{key.low:g} to {key.high:g} {key.unit}".rstrip()
        )
    return number
