"""The board's parameters and their EEPROM image, in the layout of the firmware.

The robot id is a 4-byte float at address 0, where the firmware of 2013 keeps it.  Address 16 starts a block: layout
version, the settings as int16, low byte first, and the CRC-16 of the block.  Boards with an H-bridge have a second one
at address 96: layout version, the wiring with a signed byte for each parameter, and a CRC-16 of the first block's and
these: a wiring does not fit to settings of another time.
"""

import struct
from binascii import crc_hqx
from typing import Dict, List, Optional, Sequence

from mrl_driver.protocol.table import PARAMETER_BY_NAME, SETTINGS, Parameter
from mrl_driver.robot import models as robots
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import CHIPS

ID_AT, BLOCK_AT, LAYOUT = 0, 16, 5
PINS_AT, PINS_LAYOUT = 96, 1
EEPROM_BYTES = 1024
EEPROM_BYTE_S, EEPROM_LOOK_S = 3.4e-3, 20.2e-3
"""Time to write one byte, and to compare all stored bytes before the reply to a save [s]."""
_BODY = struct.Struct(f"<B{len(SETTINGS)}h")
_LONGEST_CM = 1250


def defaults(robot_id: int) -> List[int]:
    """The firmware's default parameters for an id, in the table's order; an id without a model gets TraxBot's."""
    models = robots.driven_models()
    model = next((each for each in models if robot_id in each.ids), models[0])
    return _in_order(robot_id, robots.firmware_defaults(model))


def _in_order(robot_id: int, by_name: Dict[str, int]) -> List[int]:
    by_name = {**by_name, "robot_id": robot_id}
    return [by_name[row.name] for row in SETTINGS]


def first(robot_id: int, model: robots.RobotModel) -> List[int]:
    """Parameters of a new board: those of `model` if it has motors and the id, else the firmware's defaults.

    A board with an H-bridge knows its wiring.
    """
    if robot_id not in model.ids or not model.drives:
        return defaults(robot_id)
    if not model.board.get("bridge"):
        return _in_order(robot_id, {**robots.COMMON_BOARD, **model.board})
    settings = _in_order(robot_id, {**robots.COMMON_BOARD, "wiring": 1, **model.board})
    pins = wiring.of_board(model.board)
    return settings + [pins[row.name] for row in wiring.rows(CHIPS[model.chip])]


def image(values: List[int]) -> bytes:
    """A fresh EEPROM that holds these parameters: the settings, or those and the wiring."""
    blank = bytearray(b"\xff" * EEPROM_BYTES)
    store(blank, values)
    return bytes(blank)


def store(eeprom: bytearray, values: List[int]) -> int:
    """Writes the parameters; returns the number of changed bytes."""
    before = bytes(eeprom)
    settings, pins = values[: len(SETTINGS)], values[len(SETTINGS) :]
    eeprom[ID_AT : ID_AT + 4] = struct.pack("<f", values[0])
    _put(eeprom, BLOCK_AT, _BODY.pack(LAYOUT, *settings))
    if pins:
        _put(eeprom, PINS_AT, _pins_body(len(pins)).pack(PINS_LAYOUT, *pins), _chain(eeprom))
    return sum(a != b for a, b in zip(before, eeprom))


def _pins_body(count: int) -> struct.Struct:
    return struct.Struct(f"<B{count}b")


def _chain(eeprom: bytearray) -> bytes:
    """The checksum of the settings, which that of the wiring covers."""
    end = BLOCK_AT + _BODY.size
    return bytes(eeprom[end : end + 2])


def _put(eeprom: bytearray, at: int, body: bytes, chain: bytes = b"") -> None:
    block = body + struct.pack("<H", crc_hqx(chain + body, 0xFFFF))
    eeprom[at : at + len(block)] = block


def _stored(
    eeprom: bytearray, at: int, body: struct.Struct, layout: int, chain: bytes = b""
) -> Optional[List[int]]:
    """The values of a block, or None if it has another layout or is damaged."""
    data = bytes(eeprom[at : at + body.size])
    found, *values = body.unpack(data)
    check = struct.pack("<H", crc_hqx(chain + data, 0xFFFF))
    good = found == layout and eeprom[at + body.size :][:2] == check
    return values if good else None


def _in_range(rows: Sequence[Parameter], values: Sequence[int]) -> bool:
    return all(row.low <= value <= row.high for row, value in zip(rows, values))


class Config:
    """Parameters in force, by name; `sound` is False if the EEPROM was damaged and the defaults are in force.

    A board with an H-bridge has `pins`, its rows of the wiring: `values` has them behind the settings.
    """

    def __init__(self, eeprom: bytearray, pins: Sequence[Parameter] = ()) -> None:
        self._eeprom, self._rows = eeprom, pins
        self._curve: Dict[int, int] = {}
        settings = _stored(eeprom, BLOCK_AT, _BODY, LAYOUT)
        good = settings is not None and _in_range(SETTINGS, settings)
        self.values = (settings or defaults(0)) + (self._pins() if pins else [])
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

    @property
    def pins(self) -> Dict[str, int]:
        """The wiring; what its chip does not have is not connected.  Empty without an H-bridge."""
        found = {row.name: value for row, value in zip(self._rows, self.values[len(SETTINGS) :])}
        return wiring.of_board(found) if found else {}

    def sonar_cm(self, count: int) -> int:
        """The sonar curve at an ADC count [cm]."""
        if count not in self._curve:
            a, b, c = (self[name] / 1e4 for name in ("sonar_a", "sonar_b", "sonar_c"))
            self._curve[count] = max(0, min(_LONGEST_CM, round(a * count**b + c)))
        return self._curve[count]

    def set_defaults(self) -> None:
        """Sets all settings except the id to the model's defaults; the wiring stays."""
        self.values[: len(SETTINGS)] = defaults(self.values[0])
        self._curve.clear()

    def save(self) -> int:
        """Writes the EEPROM; returns the number of changed bytes."""
        return store(self._eeprom, self.values)

    def _pins(self) -> List[int]:
        pins = _stored(self._eeprom, PINS_AT, _pins_body(len(self._rows)), PINS_LAYOUT, _chain(self._eeprom))
        if pins is not None and _in_range(self._rows, pins):
            return pins
        return [wiring.EMPTY[row.name] for row in self._rows]

    def _float_id(self) -> int:
        (number,) = struct.unpack_from("<f", self._eeprom, ID_AT)
        return int(number) if 1.0 <= number <= 32767.0 and number == int(number) else 0
