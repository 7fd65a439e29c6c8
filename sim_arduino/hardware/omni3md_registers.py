"""The motor board's registers, as an I2C slave at 0x18.

16-bit values have their high byte first.  The key bytes AA 55 protect registers against accidental writes.
"""

import struct
from typing import Callable, Dict, Tuple

from .motor import BoardGeometry
from .omni3md import Omni3MD

VERSION = (1, 72)
KEY = b"\xaa\x55"
_OFFSETS = {
    **{register: 2 * i for i, register in enumerate((0xD8, 0xD7, 0xD6, 0xD5, 0xD4))},
    **{0xD3: 10, 0xD2: 11, 0xD1: 13, 0xD0: 15, 0xFE: 17, 0xFD: 18},
}
"""Offset of each register in the bytes of a read."""


class Omni3MDRegisters:
    """The registers of a motor board, as an I2C slave."""

    def __init__(self, board: Omni3MD) -> None:
        self._board = board
        self._pointer = 0
        self.writers = self._register_writers()  # layout and method of each writable register

    @property
    def present(self) -> bool:
        """Whether the motor board is on the bus."""
        return self._board.present

    def write(self, data: bytes, time_s: float) -> bool:
        """One I2C write: a register, then its data.  False if the board did not acknowledge."""
        board = self._board
        if not data:
            return board.present
        early = board.is_busy(time_s)
        board.too_early += early
        if not board.present or (early and board.busy_nack):
            return False
        board.touch(time_s)
        self._pointer = data[0]
        shape, writer = self.writers.get(data[0], ("", None))
        fields = struct.Struct(">" + shape)
        if writer is not None and len(data) == 1 + fields.size:
            writer(time_s, *fields.unpack(data[1:]))
        return True

    def read(self, count: int, time_s: float) -> bytes:
        """One I2C read, from the register of the last write on; bytes after the last register are 0xFF."""
        self._board.touch(time_s)
        image = self._registers()
        offset = _OFFSETS.get(self._pointer, len(image))
        return image[offset : offset + count].ljust(count, b"\xff")

    def _registers(self) -> bytes:
        """The readable bytes, in the order of a read."""
        board, state = self._board, self._board.robot.state
        words = [*board.counts(), round(state.battery_v * 10.0), round(state.temperature_c * 10.0)]
        return struct.pack(">5hB3H2B", *words, round(board.robot.params.control_hz), *board.maxima, *VERSION)

    def _register_writers(self) -> Dict[int, Tuple[str, Callable[..., None]]]:
        """Layout and method of each writable register."""
        board = self._board
        return {
            0xFC: ("2B", _keyed(board.stop, 0, 1)),
            0xFB: ("5B", _keyed(lambda time_s, *directions: board.calibrate(time_s, directions), 3, 4)),
            0xFA: ("b2h", board.move_omni),
            0xED: ("2B", _keyed(board.save_positions, 0, 1)),
            0xF8: ("3h", lambda time_s, *percents: board.move_percent(time_s, percents, True)),
            0xF7: ("3h", lambda time_s, *percents: board.move_percent(time_s, percents, False)),
            0xF6: ("Bh", lambda time_s, motor, percent: board.move_motor(time_s, motor, percent, True)),
            0xF5: ("Bh", lambda time_s, motor, percent: board.move_motor(time_s, motor, percent, False)),
            0xF4: ("3H", board.set_gains),
            0xF1: ("4B", self._write_timeout),
            0xF0: ("4B", _keyed(board.set_prescaler, 2, 3)),
            0xEF: ("Bh2B", _keyed(board.preset_encoder, 2, 3)),
            0xEE: ("BhhB", lambda time_s, m, s, p, hold: board.move_to_position(time_s, m, s, p, bool(hold))),
            0xEC: ("2H", board.set_ramp),
            0xEB: ("2h", board.move_differential),
            0xEA: ("4H", lambda time_s, *values: board.set_geometry(time_s, BoardGeometry(*values))),
        }

    def _write_timeout(self, time_s: float, first: int, key1: int, again: int, key2: int) -> None:
        if first == again and bytes((key1, key2)) == KEY:
            self._board.set_timeout(time_s, first)


def _keyed(method: Callable[..., None], *positions: int) -> Callable[..., None]:
    """Calls a method with the other values if the key bytes are at these positions."""

    def call(time_s: float, *values: int) -> None:
        if bytes(values[i] for i in positions) == KEY:
            method(time_s, *(value for i, value in enumerate(values) if i not in positions))

    return call
