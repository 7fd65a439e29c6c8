"""The board's parameters and their EEPROM image, in the layout of the firmware.

The robot id is a 4-byte float at address 0, where the firmware of 2013 keeps it.  Address 16 starts a block: layout
version, all parameters as int16, low byte first, and the CRC-16 of the block.
"""

import struct
from binascii import crc_hqx
from typing import Dict, List, Tuple

from mrl_driver.protocol.table import PARAMETER_BY_NAME, PARAMETERS
from mrl_driver.robot import models as robots

ID_AT, BLOCK_AT, LAYOUT = 0, 16, 5
EEPROM_BYTES = 1024
EEPROM_BYTE_S, EEPROM_LOOK_S = 3.4e-3, 20.2e-3
"""Time to write one byte, and to compare all stored bytes before the reply to a save [s]."""
_BODY = struct.Struct(f"<B{len(PARAMETERS)}h")
_LONGEST_CM = 1250


def defaults(robot_id: int) -> List[int]:
    """The firmware's default parameters for an id, in the table's order; an id without a model gets TraxBot's."""
    models = robots.driven_models()
    model = next((each for each in models if robot_id in each.ids), models[0])
    return _in_order(robot_id, robots.firmware_defaults(model))


def _in_order(robot_id: int, by_name: Dict[str, int]) -> List[int]:
    by_name = {**by_name, "robot_id": robot_id}
    return [by_name[row.name] for row in PARAMETERS]


def first(robot_id: int, model: robots.RobotModel) -> List[int]:
    """Parameters of a new board: those of `model` if it has motors and the id, else the firmware's defaults.

    A model with an H-bridge has wires as in HARDWARE.md, and its board knows that.
    """
    if robot_id not in model.ids or not model.drives:
        return defaults(robot_id)
    wired = {"wiring": 1} if model.board.get("bridge") else {}
    return _in_order(robot_id, {**robots.COMMON_BOARD, **wired, **model.board})


def image(values: List[int]) -> bytes:
    """A fresh EEPROM that holds these parameters."""
    blank = bytearray(b"\xff" * EEPROM_BYTES)
    store(blank, values)
    return bytes(blank)


def store(eeprom: bytearray, values: List[int]) -> int:
    """Writes the parameters; returns the number of changed bytes."""
    before = bytes(eeprom)
    body = _BODY.pack(LAYOUT, *values)
    eeprom[ID_AT : ID_AT + 4] = struct.pack("<f", values[0])
    block = body + struct.pack("<H", crc_hqx(body, 0xFFFF))
    eeprom[BLOCK_AT : BLOCK_AT + len(block)] = block
    return sum(a != b for a, b in zip(before, eeprom))


class Config:
    """Parameters in force, by name; `sound` is False if the EEPROM was damaged and the defaults are in force."""

    def __init__(self, eeprom: bytearray) -> None:
        self._eeprom = eeprom
        self._curve: Dict[int, int] = {}
        self.values, good = self._block()
        if not good:
            self.values[0] = self._float_id()
        self.sound = good and image(self.values)[: ID_AT + 4] == bytes(eeprom[: ID_AT + 4])
        if not self.sound:
            self.set_defaults()

    def __getitem__(self, name: str) -> int:
        return self.values[PARAMETER_BY_NAME[name].number]

    def __setitem__(self, name: str, value: int) -> None:
        self.values[PARAMETER_BY_NAME[name].number] = value
        self._curve.clear()

    def sonar_cm(self, count: int) -> int:
        """The sonar curve at an ADC count [cm]."""
        if count not in self._curve:
            a, b, c = (self[name] / 1e4 for name in ("sonar_a", "sonar_b", "sonar_c"))
            self._curve[count] = max(0, min(_LONGEST_CM, round(a * count**b + c)))
        return self._curve[count]

    def set_defaults(self) -> None:
        """Sets all parameters except the id to the model's defaults."""
        self.values = defaults(self.values[0])
        self._curve.clear()

    def save(self) -> int:
        """Writes the EEPROM; returns the number of changed bytes."""
        return store(self._eeprom, self.values)

    def _block(self) -> Tuple[List[int], bool]:
        """The stored values, and whether they are sound."""
        body = bytes(self._eeprom[BLOCK_AT : BLOCK_AT + _BODY.size])
        (crc,) = struct.unpack_from("<H", self._eeprom, BLOCK_AT + _BODY.size)
        layout, *values = _BODY.unpack(body)
        if layout != LAYOUT or crc != crc_hqx(body, 0xFFFF):
            return defaults(0), False
        return values, all(row.low <= value <= row.high for row, value in zip(PARAMETERS, values))

    def _float_id(self) -> int:
        (number,) = struct.unpack_from("<f", self._eeprom, ID_AT)
        return int(number) if 1.0 <= number <= 32767.0 and number == int(number) else 0
