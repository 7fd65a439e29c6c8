"""Robot models, and the EEPROM of boards that carry their ids: read once for all tests of a process."""

from functools import lru_cache
from pathlib import Path
from typing import Mapping

import yaml

from mrl_driver.protocol.table import BRIDGES, INPUTS, NOT_CONNECTED, SETTINGS
from mrl_driver.robot import models, wiring, wirings
from mrl_driver.robot.chips import ATMEGA328P, Chip
from mrl_driver.robot.models import kit
from sim_arduino.board import parameter_store


@lru_cache(maxsize=None)
def model(name: str) -> models.RobotModel:
    """The model of that name; nobody changes it."""
    return models.load(name)


@lru_cache(maxsize=None)
def eeprom(robot_id: int) -> bytes:
    """The image that a board has saved which was told nothing but its id."""
    return parameter_store.image(parameter_store.defaults(robot_id))


def four_wheel_kit(kind: str, **pins: int) -> kit.Kit:
    """What the builder of a robot with four wheels on a Mega knows, `skid` or `mecanum`; `pins` differ."""
    entry = wirings.load("mega_four_wheels")
    numbers = f"{kind}_bot", 40, 65.0, 150.0, 1496.0, entry.bridge, {**entry.pins, **pins}
    return kit.Kit(*numbers, entry.chip, kind, wheelbase_mm=120.0 if kind == "mecanum" else 0.0)


@lru_cache(maxsize=None)
def four_wheels(kind: str) -> models.RobotModel:
    """The robot, as `mrl new` makes it."""
    return kit.model_of(four_wheel_kit(kind))


ENCODER_PINS = wiring.encoder_pins(model("duo").board)
"""Pins of a duo's encoders."""
DUO_PINS = {row.name: model("duo").board[row.name] for row in wiring.rows(ATMEGA328P)}
"""The wiring of a duo, by the names of its parameters."""
MEGA_PINS = {
    **DUO_PINS,
    **dict(zip((name for name in DUO_PINS if "encoder" in name), (18, 19, 2, 10))),
    **{name: pin + 40 for name, pin in DUO_PINS.items() if 14 <= pin < 18},
}
"""The same on a Mega, whose encoders need pins with an interrupt."""


WITH_INPUTS = {
    **{f"pin_sonar_{name}": NOT_CONNECTED for name in ("front", "left", "right", "trigger", "power")},
    **{"pin_battery": NOT_CONNECTED, "i2c": 0},
    **{f"pin_{name}": pin for name, pin in zip(INPUTS, (14, 15, 16, 12, 17, 18))},
}
"""Pins of a duo with all inputs that stop it, in place of sonars, battery and bus."""


def wired_eeprom(
    robot_id: int = 1, pins: Mapping[str, int] = DUO_PINS, chip: Chip = ATMEGA328P, **settings: int
) -> bytes:
    """The image of an H-bridge board that knows its id, its wiring and some settings; other pins are not connected."""
    values = dict(zip((row.name for row in SETTINGS), parameter_store.defaults(robot_id)))
    values.update({**wiring.EMPTY, **pins, **settings})
    return parameter_store.image([values[row.name] for row in (*SETTINGS, *wiring.rows(chip))])


def bridged(bridge: str = "tb6612", **board: int) -> models.RobotModel:
    """A duo with this bridge, a divider of 4 at A3, and these other numbers of its board."""
    base = model("duo")
    return base._replace(
        board={**base.board, "battery_divider": 4000, "bridge": BRIDGES.index(bridge), **board}
    )


def without_encoders(folder: Path) -> str:
    """The file of a duo whose motors have no encoders."""
    file = yaml.safe_load(Path(models.path_of("duo")).read_text(encoding="utf-8"))
    file["wiring"] = {name: pin for name, pin in file["wiring"].items() if "encoder" not in name}
    file["wiring"]["no_encoders"] = True
    path = folder / "no_encoders.yaml"
    path.write_text(yaml.safe_dump(file))
    return str(path)
