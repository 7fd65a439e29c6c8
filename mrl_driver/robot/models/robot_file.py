"""The file of a robot model: what it may hold, checked when it is read, and as a schema for editors."""

import math
import re
from functools import lru_cache
from typing import Any, Callable, Dict, Iterator, Tuple, Type, get_type_hints

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BRIDGES, BY_NAME, INT16_MAX, NOT_CONNECTED, PARAMETERS, PINS
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P, CHIPS
from mrl_driver.yaml_file import Reader
from mrl_driver.yaml_form import (
    Choice,
    Condition,
    Flag,
    Form,
    Keys,
    Number,
    Rule,
    Schema,
    Section,
    Text,
    Whole,
)

from .drives import (
    DIFFERENTIAL,
    EXTRA,
    FOUR_WHEELS,
    KINDS,
    MECANUM,
    NONE,
    SKID,
    TRACKED,
    AnyDrive,
    MecanumDrive,
    NoDrive,
    OmniDrive,
    SkidDrive,
    kind_of,
)
from .range_sensors import ECHO_INPUTS, RANGE_KINDS, SONARS, SonarMount
from .robot_model import (
    BOARD_KEYS,
    BUILDS,
    ENVIRONMENT,
    ON_TRACKS,
    ON_WHEELS,
    OWN_KEYS,
    SONAR,
    Battery,
    Body,
    ImuMount,
    LaserMount,
    Limits,
    Noise,
    RobotModel,
    ServoMount,
    beyond_control,
    require_inputs,
)

_STILL = Limits(0.0, 0.0, 0.0, 0.0)
_NO_BODY = Body(0.0, 0.0, 0.0, 0.0, tracks=False)
_NO_BATTERY = Battery(math.nan, math.nan, math.nan, math.nan, math.nan)
_POSITIVE = (1e-9, 1e6)
_CHOICES = {"type": tuple(RANGE_KINDS), "input": SONARS + ECHO_INPUTS}
_PART_NAME = "[a-z][a-z0-9_]*"
_NAMED: Schema = {"type": "object", "propertyNames": {"pattern": f"^{_PART_NAME}$"}}
_LEAST_US_PER_RAD = 1.0
_LIKE = 1.8
"""Sizes that belong together differ at most by this factor: a diameter in place of a radius is 2; of StingBot's wheel,
whose values are fitted, 1.72."""
_DENSEST_KG_M3 = 20000.0
"""No body is denser than gold; one whose mass is in grams seems so."""
_RANGES = {
    "kp": (1, INT16_MAX),  # without it the wheels do not follow their commands
    "linear_ceiling": (1, 5000),  # running
    "wheel_separation_m": (0.02, 5.0),
    **dict.fromkeys(("radius_m", "half_length_m", "half_width_m"), (0.01, 2.5)),
    "wheel_radius_m": (0.003, 1.0),
    **dict.fromkeys(("low_rad", "high_rad"), (-2 * math.pi, 2 * math.pi)),
    **dict.fromkeys(("low_us", "high_us"), BY_NAME["set_servo"].request[1][1:3]),
    "speed_rad_s": (0.01, 100.0),
    "metres_per_count": (1e-7, 1.0),
    "full_speed_m_s": (1e-3, 32.7),
    **dict.fromkeys(("length_m", "width_m"), (0.02, 5.0)),
    "height_m": (0.01, 5.0),
    "mass_kg": (0.01, 2000.0),
    **dict.fromkeys(("full_v", "low_v", "empty_v"), (0.1, 100.0)),
    "off_v": (0.0, 100.0),
    "capacity_ah": (0.01, 1000.0),
    "linear_acceleration_m_s2": (1e-3, 100.0),
    "angular_acceleration_rad_s2": (1e-3, 1000.0),
    **dict.fromkeys(("linear_m_s", "angular_rad_s"), (1e-3, 32.7)),
    "lateral_m_s": (0.0, 32.7),
    **dict.fromkeys(("braking_m_s2", "curve_m_s2"), (0.0, 1000.0)),
    **dict.fromkeys(("x_m", "y_m", "z_m"), (-10.0, 10.0)),
    **dict.fromkeys(("roll_deg", "pitch_deg", "yaw_deg"), (-180.0, 180.0)),
    "field_of_view_deg": (1.0, 120.0),
    "nearest_m": (0.0, 10.0),
    "farthest_m": (0.05, 100.0),
    "gyro_scale": (0.8, 1.25),
    "gyro_scale_sd": (1e-5, 0.25),
    **dict.fromkeys(("wheel_offset", "rear_offset", "cross_offset"), (-0.2, 0.2)),
    **dict.fromkeys(("turn_slip", "side_slip"), (-0.5, 0.9)),
    **dict.fromkeys(("wheel_m2_per_m", "turn_rad2_per_rad"), (0.0, 1.0)),
    **dict.fromkeys(("distance_scale_sd", "wheel_ratio_sd"), (0.0, 0.5)),
    "turn_scale_sd": (0.0, 0.9),
}


class _Name(Text):
    """A name that can be part of a message and of a file's name; only `read` checks that."""

    def read(self, reader: Reader, key: str, value: Any) -> Any:
        name = super().read(reader, key, value)
        if "/" in name or not name.isprintable():
            raise reader.fail(key, name, "a name of printable characters without /")
        return name


class _Ids(Form):
    """Robot ids, each once."""

    _ID = Whole(1, INT16_MAX)

    def read(self, reader: Reader, key: str, value: Any) -> Tuple[int, ...]:
        if not isinstance(value, list) or not value:
            raise reader.fail(key, value, "a list of robot ids")
        ids = tuple(self._ID.read(reader, key, each) for each in value)
        if len(set(ids)) < len(ids):
            raise reader.fail(key, value, "each id once")
        return ids

    def schema(self) -> Schema:
        return {"type": "array", "items": self._ID.schema(), "minItems": 1, "uniqueItems": True}


class _Angles(Form):
    """Angles of three wheels.  Only `read` checks the motor board's order and spacing, rotated by any angle."""

    _ANGLE = Number(-360.0, 360.0)

    def read(self, reader: Reader, key: str, value: Any) -> Tuple[float, ...]:
        if isinstance(value, list) and len(value) == 3:
            first, second, third = (self._ANGLE.read(reader, key, each) for each in value)
            if all(abs((b - a) % 360.0 - 120.0) < 1e-6 for a, b in ((first, second), (second, third))):
                return first, second, third
        raise reader.fail(
            key, value, "three angles, each 120 deg on from the one before, such as [60, 180, 300]"
        )

    def schema(self) -> Schema:
        return {"type": "array", "items": self._ANGLE.schema(), "minItems": 3, "maxItems": 3}


class _Bridge(Form):
    """The bridge of an H-bridge board, by the name of its chip or its number."""

    def read(self, reader: Reader, key: str, value: Any) -> int:
        chips = BRIDGES[1:]
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= len(chips):
            return value
        if not isinstance(value, str) or value.lower() not in chips:
            raise reader.fail(key, value, ", ".join(chips))
        return BRIDGES.index(value.lower())

    def schema(self) -> Schema:
        chips = BRIDGES[1:]
        any_case = "|".join(
            "".join(f"[{c}{c.upper()}]" if c.isalpha() else c for c in chip) for chip in chips
        )
        by_number = Whole(1, len(chips)).schema()
        return {"anyOf": [{"enum": list(chips)}, {"type": "string", "pattern": f"^({any_case})$"}, by_number]}


class _Pin(Form):
    """A pin as a number or as on the board, such as 5, D5 or A4.  Only `Wiring` knows whether the chip has it."""

    _NUMBER = Whole(0, PINS[0].high)
    DEFINITIONS: Schema = {
        "pin": {"anyOf": [_NUMBER.schema(), {"type": "string", "pattern": "^[ADad]?[0-9]{1,2}$"}]}
    }
    """What its schema refers to; the schema of the whole file has it."""

    def read(self, reader: Reader, key: str, value: Any) -> str:
        if isinstance(value, str):
            return value
        return str(self._NUMBER.read(reader, key, value))

    def schema(self) -> Schema:
        return {"$ref": "#/definitions/pin"}


class Wiring(Keys):
    """The section `wiring`: the pins of the functions that are connected, on a board with this `chip`.

    Only `read` refuses pins that the chip does not have.
    """

    def __init__(self) -> None:
        texts = {
            "chip": "Chip of the board.",
            "i2c": "Devices are on the I2C bus: its two pins are in use.",
            "no_encoders": "The motors have no encoders: they turn by their duty alone, and there is no odometry.",
        }
        forms: Dict[str, Form] = {"chip": Choice(tuple(CHIPS))}
        for row in PINS:
            number = _Pin() if row.name in wiring.PIN_NAMES else Whole(row.low, row.high)
            forms[wiring.short(row.name)] = Flag() if row.name in wiring.FLAGS else number
            texts.setdefault(wiring.short(row.name), row.text)
        super().__init__(forms, forms, texts)

    def read(self, reader: Reader, key: str, value: Any) -> Any:
        """Return the chip, and the parameters of the wiring by name."""
        found = super().read(reader, key, value)
        chip = CHIPS[found.pop("chip", ATMEGA328P.name)]
        pins = wiring.of_board({})
        for row in PINS:
            name = wiring.short(row.name)
            if name in found:
                number = chip.number(found[name]) if isinstance(found[name], str) else int(found[name])
                if number is None:
                    raise reader.fail(f"{key}.{name}", found[name], chip.its_pins)
                pins[row.name] = number
                if row not in wiring.rows(chip):
                    raise reader.fail(
                        f"{key}.{name}", found[name], f"nothing: the {chip.board} does not have it"
                    )
        return chip, pins


class _Base(Form):
    """The section `drive` of a robot with motors; without a `kind` it is a differential drive."""

    def read(self, reader: Reader, key: str, value: Any) -> AnyDrive:
        found = dict(reader.mapping(key, value))
        kind = found.pop("kind", DIFFERENTIAL)
        if not isinstance(kind, str) or kind not in KINDS:
            raise reader.fail(f"{key}.kind", kind, ", ".join(KINDS))
        for name in EXTRA.get(kind, ()):
            if name not in found:
                raise ConfigError(f"{reader.path}: key {key}.{name} is missing, {kind} drives need it")
        try:
            return _section(KINDS[kind]).read(reader, key, found)
        except ConfigError as error:
            raise ConfigError(f"{error} (kind {kind})") from None

    def schema(self) -> Schema:
        *others, found = (self._of_kind(kind) for kind in reversed(KINDS))
        for kind, schema in zip(reversed(KINDS), others):
            found = {"if": Condition(("kind",), (kind,)).schema(), "then": schema, "else": found}
        return {"type": "object", **found}

    def _of_kind(self, kind: str) -> Schema:
        found = _section(KINDS[kind]).schema()
        kinds = {"enum": list(KINDS), "description": f"Kind of the base; {DIFFERENTIAL} if it is left out."}
        found["properties"] = {"kind": kinds, **found["properties"]}
        found["required"] += EXTRA.get(kind, ())
        return found


def _parts(kind: Type[tuple], reader: Reader, key: str, value: Any) -> Iterator[Tuple[str, Any]]:
    """Read parts of one kind by their names, one after the other."""
    for name, part in reader.mapping(key, value).items():
        if not re.fullmatch(_PART_NAME, str(name)):
            raise reader.fail(key, name, "names of lower-case letters, digits and _")
        yield name, _section(kind).read(reader, f"{key}.{name}", part)


class _Sonars(Form):
    """The sonars that are fitted, by name.  Only `read` checks ranges, and that each is on an input of its own."""

    def read(self, reader: Reader, key: str, value: Any) -> Dict[str, SonarMount]:
        found: Dict[str, SonarMount] = {}
        for name, mount in _parts(SonarMount, reader, key, value):
            found[name] = mount._replace(input=mount.input_of(name))
            kind = found[name].kind
            if kind.nearest_m >= kind.farthest_m:
                raise reader.fail(
                    f"{key}.{name}.nearest_m", kind.nearest_m, f"less than farthest_m, {kind.farthest_m:g}"
                )
        return found

    def schema(self) -> Schema:
        return {**_NAMED, "additionalProperties": _section(SonarMount).schema()}


class _Servos(Form):
    """The servos by name.  Only `read` checks that they fit each other and the wiring."""

    def read(self, reader: Reader, key: str, value: Any) -> Dict[str, ServoMount]:
        found: Dict[str, ServoMount] = {}
        for name, servo in _parts(ServoMount, reader, key, value):
            place = f"{key}.{name}"
            if servo.low_rad >= servo.high_rad:
                raise reader.fail(f"{place}.low_rad", servo.low_rad, "less than high_rad")
            if abs(servo.us_per_rad) < _LEAST_US_PER_RAD:
                raise reader.fail(f"{place}.high_us", servo.high_us, "another length than low_us")
            if servo.parent and servo.parent not in found:
                raise reader.fail(f"{place}.parent", servo.parent, "a servo above it in the file")
            user = next((other for other, each in found.items() if each.servo == servo.servo), None)
            if user:
                raise reader.fail(f"{place}.servo", servo.servo, f"another one: servos.{user} has it")
            found[name] = servo
        return found

    def schema(self) -> Schema:
        return {**_NAMED, "additionalProperties": _section(ServoMount).schema()}


class _Noise(Form):
    """The keys of `Noise`, all optional; `read` returns those that are there."""

    def read(self, reader: Reader, key: str, value: Any) -> Dict[str, float]:
        return Keys(_forms(Noise), Noise._fields).read(reader, key, value)

    def schema(self) -> Schema:
        return {**_section(Noise).schema(), "required": []}


_RULES = (
    Rule(
        Condition(("drive", "kind"), (TRACKED,)),
        Condition(("body", "tracks"), (True,)),
        "true for a tracked drive",
    ),
    Rule(
        Condition(("drive", "kind"), (DIFFERENTIAL, TRACKED, SKID), or_absent=True),
        Condition(("limits", "lateral_m_s"), (0,), or_absent=True),
        "0: only a base with omni or mecanum wheels can move sideways",
    ),
    Rule(
        Condition(("board", "bridge")),
        Condition(("drive", "kind"), (DIFFERENTIAL, TRACKED, SKID, MECANUM), or_absent=True),
        "differential, tracked, skid or mecanum for a board.bridge",
    ),
    Rule(
        Condition(("drive", "kind"), FOUR_WHEELS),
        Condition(("wiring",)),
        "the pins of four motors on a Mega",
    ),
    Rule(
        Condition(("board", "bridge")),
        Condition(("build",), (SONAR,), or_absent=True),
        "sonar: other sensors need pins that the board.bridge uses",
    ),
    Rule(Condition(("wiring",)), Condition(("board", "bridge")), "the bridge of the wiring"),
    Rule(
        Condition(("virtual",), (True,)),
        Condition(("board", "bridge")),
        "a bridge, as each virtual robot has one",
    ),
)


class RobotFile(Form):
    """A robot model.

    Only `read` checks that the battery's levels fall from full to off, that no limit exceeds the board's ceiling, that
    an H-bridge board can control its wheels, that its pins can do what the wiring asks of
    them, and that sizes fit each other.
    """

    def read(self, reader: Reader, key: str, value: Any) -> RobotModel:
        """Return the model."""
        if isinstance(value, dict) and value.get("drive") == NONE:
            found = self._without_motors().read(reader, key, value)
            return RobotModel(
                **{**found, "drive": NoDrive()},
                board={},
                limits=_STILL,
                body=_NO_BODY,
                sonars={},
                battery=_NO_BATTERY,
            )
        found = self._with_motors().read(reader, key, value)
        for rule in _RULES:
            rule.check(reader, value)
        self._take_wiring(reader, found)
        slides = found["body"].tracks or isinstance(found["drive"], SkidDrive)
        noise = ON_TRACKS if slides else ON_WHEELS
        found["noise"] = noise._replace(**found.get("noise", {}))
        if found.get("build") == ENVIRONMENT:
            found["sonars"] = {}
        model = RobotModel(**found)
        require_inputs(model, f"{reader.path}: ")
        self._check_battery(reader, model.battery)
        self._check_limits(reader, model)
        self._check_control(reader, model)
        self._check_sizes(reader, model)
        return model

    def schema(self) -> Schema:
        """Return the JSON Schema of a robot's file."""
        with_motors = {**self._with_motors().schema(), "allOf": [rule.schema() for rule in _RULES]}
        return {
            "definitions": _Pin.DEFINITIONS,
            "type": "object",
            "if": Condition(("drive",), (NONE,)).schema(),
            "then": self._without_motors().schema(),
            "else": with_motors,
        }

    def _with_motors(self) -> Keys:
        forms = {
            "name": _Name(),
            "ids": _Ids(),
            "drive": _Base(),
            "board": _board(),
            "wiring": Wiring(),
            "limits": _section(Limits),
            "body": _section(Body),
            "sonars": _Sonars(),
            "battery": _section(Battery),
            "noise": _Noise(),
            "build": Choice(BUILDS),
            "servos": _Servos(),
            "imu": _section(ImuMount),
            "laser": _section(LaserMount),
            "virtual": Flag(),
        }
        return Keys(forms, (*RobotModel._field_defaults, "wiring"), _TEXTS)

    def _without_motors(self) -> Keys:
        """A board with `drive: none` has nothing that belongs to motors."""
        build = Choice((ENVIRONMENT,), f"{ENVIRONMENT} for a board without motors (drive: {NONE})")
        forms = {"name": _Name(), "ids": _Ids(), "drive": Choice((NONE,)), "build": build}
        return Keys(forms, texts=_TEXTS)

    def _take_wiring(self, reader: Reader, found: Dict[str, Any]) -> None:
        """Put the parameters of the wiring to the others of the board; raise ConfigError if the chip cannot do that."""
        for name, servo in found.get("servos", {}).items():
            pin = f"pin_servo_{servo.servo}"
            if found.get("wiring", (None, {}))[1].get(pin, NOT_CONNECTED) == NOT_CONNECTED:
                raise reader.fail(
                    f"servos.{name}.servo", servo.servo, f"one with a pin: wiring.{wiring.short(pin)}"
                )
        if "wiring" not in found:
            return
        chip, pins = found.pop("wiring")
        problem = wiring.check(pins, BRIDGES[found["board"]["bridge"]], chip)
        if problem != wiring.SOUND:
            raise ConfigError(f"{reader.path}: wiring: {wiring.in_words(problem, pins, chip)}")
        motors, kind = wiring.motors(pins), kind_of(found["drive"])
        if (motors > wiring.FRONT) != (kind in FOUR_WHEELS):
            kinds = " or ".join(FOUR_WHEELS) if motors > wiring.FRONT else f"{DIFFERENTIAL} or {TRACKED}"
            raise reader.fail("drive.kind", kind, f"{kinds}: the wiring has {motors} motors")
        self._check_channels(reader, pins)
        found["board"].update((row.name, pins[row.name]) for row in wiring.rows(chip))
        found["chip"] = chip.name

    def _check_channels(self, reader: Reader, pins: wiring.Pins) -> None:
        """Check that all encoders have channel B or none: the board has one number of counts a turn for all wheels."""
        names = [b for _, b in wiring.ENCODERS[: wiring.motors(pins)]]
        there, missing = (
            " and ".join(wiring.short(name) for name in names if (pins[name] != NOT_CONNECTED) == connected)
            for connected in (True, False)
        )
        if there and missing and not pins[wiring.NO_ENCODERS]:
            raise ConfigError(
                f"{reader.path}: wiring has {there}, but not {missing}, expected all or none, because channel A alone "
                f"gives half of the counts: connect {missing}, or leave out {there}"
            )

    def _check_battery(self, reader: Reader, battery: Battery) -> None:
        levels = battery[:4]
        if not levels[0] > levels[1] > levels[2] > levels[3]:
            got = ", ".join(f"{name} {value:g}" for name, value in zip(Battery._fields, levels))
            raise ConfigError(
                f"{reader.path}: battery is {got}, expected full_v above low_v above empty_v above off_v"
            )

    def _check_limits(self, reader: Reader, model: RobotModel) -> None:
        """Check that no limit exceeds the board's ceiling: the board would clamp it, unseen by the driver."""
        for key, ceiling in (("linear_m_s", "linear_ceiling"), ("angular_rad_s", "angular_ceiling")):
            got, most = getattr(model.limits, key), model.board[ceiling] / 1000
            if got > most:
                raise reader.fail(f"limits.{key}", got, f"at most {most:g}, the board.{ceiling}")

    def _check_control(self, reader: Reader, model: RobotModel) -> None:
        why = beyond_control(model.board) if model.board.get("bridge") else ""
        if why:
            raise ConfigError(f"{reader.path}: {why}")

    def _check_sizes(self, reader: Reader, model: RobotModel) -> None:
        """Check sizes against each other: a value in another unit is off by much more than `_LIKE`."""
        drive, board, body = model.drive, model.board, model.body
        if not isinstance(drive, NoDrive):
            separation_m = across_m = drive.wheel_separation_m
            key, half = ("radius_m", 1) if isinstance(drive, OmniDrive) else ("wheel_separation_m", 2)
            if isinstance(drive, MecanumDrive):
                key, half, across_m = "half_length_m and half_width_m", 1, 2 * drive.half_width_m
            turn_m = 2 * math.pi * board["wheel_radius"] * 1e-5
            per_count_m = turn_m / max(1.0, board["gearbox"] * board["encoder_counts"] / 100)
            of_count = "board.wheel_radius [0.01 mm], gearbox [0.1] and encoder_counts [0.1]"
            axis_m, of_axis = half * board["axis_radius"] * 1e-5, "board.axis_radius [0.01 mm]"
            for name, got, like, of in (
                (f"drive.{key}", separation_m * half / 2, axis_m, of_axis),
                ("drive.metres_per_count", drive.metres_per_count, per_count_m, of_count),
                ("body.width_m", body.width_m, across_m, "the wheels"),
            ):
                if not like / _LIKE <= got <= like * _LIKE:
                    raise reader.fail(name, got, f"about {like:.3g}, to fit {of}")
        most_kg = _DENSEST_KG_M3 * body.length_m * body.width_m * body.height_m
        if body.mass_kg > most_kg:
            expected = f"at most {most_kg:.3g} for a body of this size, in kg"
            raise reader.fail("body.mass_kg", body.mass_kg, expected)
        far_m = 2 * max(body.length_m, body.width_m)
        for name, mount in model.sonars.items():
            for key in ("x_m", "y_m"):
                if abs(getattr(mount, key)) > far_m:
                    expected = f"at most {far_m:g}, twice the body"
                    raise reader.fail(f"sonars.{name}.{key}", getattr(mount, key), expected)


_TEXTS = {
    "name": "Name of the model; a file in the user's folder is found by its file name.",
    "ids": "Robot ids of boards that are of this model; 11 and up are free, but for 21 to 25.",
    "drive": "Geometry of the base, by its kind; none for a board without motors.",
    "board": "Parameters of the board; mrl set-id and mrl config defaults store them in its EEPROM.",
    "wiring": "Pins of an H-bridge board; mrl flash and mrl set-id store them in its EEPROM.",
    "sonars": "The sonars that are fitted, by name, and where they are.",
    "servos": "Servos of the wiring by the names of their joints, such as pan and tilt.",
    "build": "Build of the firmware; a board of 2013 does not report its own.",
    "virtual": "No robot: a bare board calculates it. mrl calibrate writes this; a real robot is refused.",
}
"""Descriptions of keys that have no named tuple."""


def _board() -> Keys:
    rows = [row for row in PARAMETERS if row.number in BOARD_KEYS]
    rows += [row for row in PARAMETERS if row.name in OWN_KEYS]
    forms: Dict[str, Form] = {
        row.name: Whole(*map(int, _RANGES.get(row.name, (row.low, row.high)))) for row in rows
    }
    forms["bridge"] = _Bridge()
    texts = {row.name: f"{row.text} [{row.unit}]" if row.unit else row.text for row in rows}
    return Keys(forms, OWN_KEYS, texts)


def _section(kind: Type[tuple]) -> Section:
    return Section(kind, _forms(kind))


@lru_cache(maxsize=None)
def _forms(kind: Type[tuple]) -> Dict[str, Form]:
    """Return the forms of the fields of a named tuple, by their types; `_RANGES` has those of numbers."""
    by_type: Dict[Any, Callable[[str], Form]] = {
        bool: lambda name: Flag(),
        float: lambda name: Number(*_RANGES.get(name, _POSITIVE)),
        int: lambda name: Whole(1, len(wiring.SERVOS)),
        str: lambda name: Choice(_CHOICES[name]) if name in _CHOICES else Text(),
    }
    hints = get_type_hints(kind)
    return {name: by_type.get(hint, lambda name: _Angles())(name) for name, hint in hints.items()}
