"""The wirings of docs/wirings.md, and random ones."""

import functools
import random
import re
from pathlib import Path
from typing import Dict, List, NamedTuple, Tuple

from mrl_driver.protocol.table import BRIDGES, NOT_CONNECTED
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip

PAGE = Path(__file__).parent.parent / "docs" / "wirings.md"
BOARDS = {"Uno": ATMEGA328P, "Mega": ATMEGA2560}


_COLUMNS = [*([*names, enable] for names, enable in zip(wiring.OUTPUTS, wiring.ENABLES)), *wiring.ENCODERS]


class Row(NamedTuple):
    """A row of the page; `chip` is that of an Uno where there is no image for the board."""

    name: str
    source: str
    board: str
    bridge: str
    places: Tuple[Tuple[str, ...], ...]
    i2c: bool
    verdict: str
    remark: str

    @property
    def chip(self) -> Chip:
        return BOARDS.get(self.board, ATMEGA328P)

    @property
    def has_table(self) -> bool:
        """Whether a board of today can be told this wiring, sound or not."""
        return self.board in BOARDS and self.bridge in BRIDGES

    @property
    def pins(self) -> Dict[str, int]:
        found = {
            name: NOT_CONNECTED if place == "-" else self.chip.number(place)
            for names, places in zip(_COLUMNS, self.places)
            for name, place in zip(names, places)
        }
        assert None not in found.values()
        no_encoders = int(not any(map(self.chip.number, self.places[2])))
        return wiring.of_board({**found, wiring.I2C: int(self.i2c), wiring.NO_ENCODERS: no_encoders})


def rows() -> List[Row]:
    """The rows of the page."""
    found = []
    for line in re.findall(r"^\| (.*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)[1:]:
        name, source, board, bridge, *pins, i2c, verdict, remark = (cell.strip() for cell in line.split("|"))
        places = tuple(tuple(each.split()) for each in pins)
        found.append(Row(name, source, board, bridge, places, i2c == "yes", verdict, remark))
    return found


@functools.lru_cache(maxsize=None)
def _able(chip: Chip) -> Dict[str, List[int]]:
    """The pins that can do what a name's part says."""
    return {
        "pwm": [number for number, pin in enumerate(chip.pins) if pin.timer >= 0],
        "encoder_a": [number for number, pin in enumerate(chip.pins) if pin.interrupts and number > 1],
        "sonar_": [number for number, pin in enumerate(chip.pins) if pin.channel >= 0],
        "servo": list(wiring.servo_pins(chip)),
        "": list(range(2, len(chip.pins))),
    }


def random_wiring(chance: random.Random, chip: Chip) -> Tuple[Dict[str, int], str]:
    """A wiring, sound or not, and a bridge."""
    able = _able(chip)
    pins, used = dict(wiring.EMPTY), {NOT_CONNECTED}
    names = [row.name for row in wiring.rows(chip) if row.name in wiring.PIN_NAMES]
    if chance.random() < 0.5:
        names = [name for name in names if "rear" not in name]
    for name in names:
        kind = next(kind for kind in able if kind in name)
        free = [pin for pin in able[kind] if pin not in used]
        if free and chance.random() < (
            0.97 if "pwm" in name or "logic" in name or kind == "encoder_a" else 0.3
        ):
            pins[name] = chance.choice(free)
            used.add(pins[name])
    if chance.random() < 0.3:
        pins[chance.choice(names)] = chance.randrange(-1, 70)
    pins.update((name, chance.randrange(2)) for name in wiring.FLAGS)
    pins[wiring.NO_ENCODERS] = int(chance.random() < 0.1)
    return pins, chance.choice(BRIDGES)
