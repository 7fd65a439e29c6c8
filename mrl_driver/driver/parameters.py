"""Reads, sets and saves the parameters of a board, as `Driver.parameters`."""

import contextlib
import math
from typing import Dict, Iterable, Mapping, Optional, Tuple

from mrl_driver.errors import BoardError, BoardRefused, ConfigError, MrlError
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME, PINS, SETTINGS, Parameter
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip
from mrl_driver.robot.models import COMMON_BOARD, CURVE_KEYS, OF_CONTROL, RobotModel, beyond_control
from mrl_driver.robot.models.range_sensors import SONARS

from .connection import Connection

_READ, _WRITE, _SAVE, _DEFAULTS, _WIRING, _BOARD = (
    BY_NAME[name].code
    for name in ("read_config", "write_config", "save_config", "default_config", "read_wiring", "read_board")
)

CABLES = ("bridge", "wiring", *(row.name for row in PINS))
"""Parameters that describe the cables of one robot."""
_TURNING = (
    "bridge",
    wiring.NO_ENCODERS,
    *(name for names in (*wiring.OUTPUTS, *wiring.ENCODERS) for name in names),
)
"""Parameters for which the wiring was measured."""
MOTORS = ("a motor board", "an H-bridge")
"""What a board drives its motors with, without and with the capability `bridge`."""


SMALL = 0.02
"""A speed, a turn or a range that is wrong by more than this share is worth a warning.  Assumed."""


def default_of(model: Optional[RobotModel], row: Parameter) -> Optional[int]:
    """Return a robot model's value of a parameter; the wiring belongs to the robot, unless its own file has it."""
    own = model.board if model is not None else {}
    if row.name == "wiring":
        return own.get(row.name)
    return own.get(row.name, COMMON_BOARD.get(row.name))


def differing(values: Mapping[str, int], model: RobotModel) -> Dict[str, int]:
    """Return the model's values of the parameters, by name, that differ from these values of a board."""
    defaults = {name: default_of(model, PARAMETER_BY_NAME[name]) for name in values}
    return {name: value for name, value in defaults.items() if value is not None and value != values[name]}


def curve_share(values: Mapping[str, int], model: RobotModel) -> float:
    """Return by which share a board with these values gives longer ranges than with the model's curve, at 1 m.

    The curve is that of `sonar_curve.Curve`, without numpy, which a node does not need otherwise.
    """
    expected = {name: default_of(model, PARAMETER_BY_NAME[name]) or 0 for name in CURVE_KEYS}
    (a, b, c), (model_a, model_b, model_c) = (
        [each[name] / 1e4 for name in CURVE_KEYS] for each in (values, expected)
    )
    try:
        return float(a * max(0.0, (100 - model_c) / model_a) ** (b / model_b) + c) / 100 - 1
    except (OverflowError, ZeroDivisionError):
        return math.inf


def curve_texts(share: float, model: RobotModel) -> Tuple[str, str]:
    """Return in words how the ranges of a board differ from the model's curve by this share, and what to do."""
    words = " ".join(f"{name} {default_of(model, PARAMETER_BY_NAME[name])}" for name in CURVE_KEYS)
    wrong = f"{abs(share) * 100:.3g} % {'short' if share < 0 else 'long'}"
    return (
        f"the sonars' curve is not that of the model {model.name}: at 1 m ranges are {wrong}",
        f"if the model is right: mrl config set {words} --port PORT; if not: mrl calibrate sonar --port PORT",
    )


class Parameters:
    """The parameters of a board: those in force, and those in its EEPROM.

    Raises:
        BoardRefused: the board does not have a parameter, stores no configuration, refused a value, could not save
            it, or restarted meanwhile.
        BoardTimeout: the board does not reply.
    """

    def __init__(self, connection: Connection) -> None:
        self._connection = connection
        self._found: Optional[Chip] = None

    @property
    def can_save(self) -> bool:
        """Whether the board stores a configuration; boards of 2013 do not."""
        return "config" in self._connection.board.capabilities

    def require_eeprom(self) -> None:
        """Raise BoardRefused unless the board stores a configuration."""
        if not self.can_save:
            raise BoardRefused(
                "board firmware 1 (2013) cannot store parameters or an id; upload the current firmware with: mrl flash"
            )

    @property
    def rows(self) -> Tuple[Parameter, ...]:
        """The parameters that the board uses; earlier firmware refuses the numbers of all others.

        A virtual robot has no cables.
        """
        there, unused = ("", *self._connection.board.capabilities), CABLES if self._virtual else ()
        pins = wiring.rows(self._chip) if "bridge" in there and not self._virtual else ()
        return tuple(row for row in (*SETTINGS, *pins) if row.capability in there and row.name not in unused)

    @property
    def _virtual(self) -> bool:
        return self._connection.board.virtual

    @property
    def _chip(self) -> Chip:
        """Chip of the board, which is asked for it once."""
        if self._found is None and "wiring" in self._connection.board.capabilities:
            number = self._connection.ask(_BOARD)[0]
            self._found = ATMEGA2560 if str(number) in ATMEGA2560.name else ATMEGA328P
        return self._found or ATMEGA328P

    def curve_warning(self, model: RobotModel) -> str:
        """Return in one line how the board's sonar curve differs from the model's; empty if by less than `SMALL`."""
        if not self.can_save or not any(each.input_of(name) in SONARS for name, each in model.sonars.items()):
            return ""
        share = curve_share(self.read(*CURVE_KEYS), model)
        return "; ".join(curve_texts(share, model)) if abs(share) > SMALL else ""

    def wiring_problem(self) -> str:
        """Return in one line what is wrong with the pins or the numbers of an H-bridge board; empty if nothing is."""
        if "bridge" not in self._connection.board.capabilities:
            return ""
        problem, parameter, other = self._connection.ask(_WIRING)
        found = wiring.from_reply(problem, parameter, other)
        if found == wiring.SOUND:
            return beyond_control(self.read(*OF_CONTROL))
        return wiring.in_words(found, self.read(found.parameter) if found.parameter else {}, self._chip)

    def require(self, names: Iterable[str]) -> None:
        """Raise BoardRefused unless the board uses all parameters of these names."""
        used = {row.name for row in self.rows}
        for name in names:
            if name not in used:
                raise BoardRefused(
                    f"the board has no parameter {name}, expected firmware with the capability "
                    f"{PARAMETER_BY_NAME[name].capability}: upload it with: mrl flash"
                )

    def read(self, *names: str) -> Dict[str, int]:
        """Return the parameters in force, in units of the table."""
        self.require(names)
        return {name: self._connection.ask(_READ, PARAMETER_BY_NAME[name].number)[1] for name in names}

    def write(self, values: Mapping[str, int]) -> None:
        """Set parameters until the board restarts, and check them: if it restarts meanwhile, it has some of before.

        A board whose pins change has no bridge meanwhile, so that it never drives with half of a wiring.
        """
        self.require_eeprom()
        self.require(values)
        orders = list(values.items())
        if not set(values).isdisjoint(wiring.NAMES):
            bridge = values["bridge"] if "bridge" in values else self.read("bridge")["bridge"]
            orders = [("bridge", 0), *(each for each in orders if each[0] != "bridge"), ("bridge", bridge)]
        for name, value in orders:
            number = PARAMETER_BY_NAME[name].number
            if self._connection.ask(_WRITE, number, value) != (number, value):
                raise BoardRefused(f"the board refused {name} {value}; nothing was saved")
        self._require_values(values)

    def save(self) -> None:
        """Save the parameters in force to the EEPROM."""
        if self._connection.ask(_SAVE, timeout_s=2.0) != (1,):
            raise BoardRefused("the board could not write its EEPROM; try again")

    def save_model(self, robot_id: int, model: RobotModel) -> bool:
        """Save the id and the model's parameters (the firmware may not know this model), and check them.

        A board with an H-bridge keeps its bridge, pins and wiring, unless the model sets them: they belong to its
        cables.

        Returns:
            Whether the wiring must be found again, see `replace`.

        Raises:
            ConfigError: the model is that of a robot with other motors, where the same numbers mean something else.
        """
        self.require_eeprom()
        there, expected = (
            MOTORS[bool(each)]
            for each in ("bridge" in self._connection.board.capabilities, model.board.get("bridge"))
        )
        if there != expected:
            raise ConfigError(
                f"the robot model {model.name} has {expected}, but this board has {there}: the same numbers mean other "
                "things there; name another model, or upload the firmware of this one with: mrl flash"
            )
        wanted = {
            name: value for name, value in model.board.items() if not (self._virtual and name in CABLES)
        }
        self.require(wanted)
        kept = self.read(*(row.name for row in self.rows if row.name in CABLES and row.name not in wanted))
        unknown = self._unknown_wiring(wanted)
        values = {"robot_id": robot_id, **kept, **wanted, **unknown}
        self.write({"robot_id": robot_id})
        if self._connection.ask(_DEFAULTS) != (1,):
            raise BoardRefused("the board refused to set its defaults; try again")
        self.write(values)  # the id again: a board that has restarted meanwhile has that of before
        self.save()
        self._require_values(values)
        return bool(unknown)

    def replace(self, values: Mapping[str, int], saved: bool = True) -> bool:
        """Set parameters, save them if `saved`, and check them.  A refusal leaves the old ones in force.

        A wiring that was found with another bridge or other pins of a motor or an encoder does not hold any more: it
        becomes 0, unless `values` has one, and the board refuses to move until it is found again.

        Returns:
            Whether the wiring must be found again.
        """
        self.require_eeprom()
        unknown = self._unknown_wiring(values)
        values = {**values, **unknown}
        old = self.read(*values)
        try:
            self.write({name: value for name, value in values.items() if value != old[name]})
            self._require_values(values)  # also those that were in force and not saved
        except BoardError:
            with contextlib.suppress(MrlError):
                self.write(old)
            raise
        if saved:
            self.save()
            self._require_values(values)
        return bool(unknown)

    def _unknown_wiring(self, values: Mapping[str, int]) -> Dict[str, int]:
        names = [name for name in _TURNING if name in values]
        if "wiring" in values or not names:
            return {}
        old = self.read("wiring", *names)
        changed = any(values[name] != old[name] for name in names)
        return {"wiring": 0} if changed and old["wiring"] else {}

    def _require_values(self, values: Mapping[str, int]) -> None:
        for name, found in self.read(*values).items():
            if found != values[name]:
                raise BoardRefused(
                    f"the board has {name} {found}, expected {values[name]}: it restarted meanwhile; try again"
                )
