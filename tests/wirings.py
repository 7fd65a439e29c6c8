"""The wirings of docs/wirings.md, and random ones."""

import random
import re
from pathlib import Path
from typing import Dict, List, NamedTuple, Tuple

from mrl_driver.protocol.table import BRIDGES, NOT_CONNECTED
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip

PAGE = Path(__file__).parent.parent / "docs" / "wirings.md"
BOARDS = {"Uno": ATMEGA328P, "Mega": ATMEGA2560}


class Row(NamedTuple):
    """A row of the page; `chip` is that of an Uno where there is no image for the board."""

    name: str
    source: str
    board: str
    bridge: str
    places: Tuple[str, ...]
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
        numbers = [NOT_CONNECTED if each == "-" else self.chip.number(each) for each in self.places]
        assert None not in numbers
        return {**wiring.EMPTY, **dict(zip(wiring.NAMES, numbers)), wiring.I2C: int(self.i2c)}


def rows() -> List[Row]:
    """The rows of the page."""
    found = []
    for line in re.findall(r"^\| (.*) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)[1:]:
        name, source, board, bridge, *pins, i2c, verdict, remark = (cell.strip() for cell in line.split("|"))
        found.append(
            Row(name, source, board, bridge, tuple(" ".join(pins).split()), i2c == "yes", verdict, remark)
        )
    return found


def random_wiring(chance: random.Random, chip: Chip) -> Tuple[Dict[str, int], str]:
    """A wiring, sound or not, and a bridge."""
    able = {
        "pwm": [number for number, pin in enumerate(chip.pins) if pin.timer >= 0],
        "encoder_a": [number for number, pin in enumerate(chip.pins) if pin.interrupts and number > 1],
        "sonar_": [number for number, pin in enumerate(chip.pins) if pin.channel >= 0],
        "": list(range(2, len(chip.pins))),
    }
    pins, used = dict(wiring.EMPTY), {NOT_CONNECTED}
    for name in wiring.NAMES[:-1]:
        kind = next(kind for kind in able if kind in name)
        free = [pin for pin in able[kind] if pin not in used]
        if free and chance.random() < (
            0.97 if "pwm" in name or "logic" in name or kind == "encoder_a" else 0.3
        ):
            pins[name] = chance.choice(free)
            used.add(pins[name])
    if chance.random() < 0.3:
        pins[chance.choice(wiring.NAMES[:-1])] = chance.randrange(-1, 70)
    pins[wiring.I2C] = chance.randrange(2)
    return pins, chance.choice(BRIDGES)
