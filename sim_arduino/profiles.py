"""The boards of 2013, with their faults: what a driver for boards in the field has to live with.

Times are those measured of the 2013 firmware on a simulated ATmega328P; faults those known from its released source.
"""

import math
import struct
from typing import List, Optional, Tuple

from . import config_store
from .config_store import Config
from .omni3md import Geometry
from .plant import SONAR_POWER, SONAR_TRIGGER, Plant
from .profile_rows import NO_MOTORS_FROM_ID, Rows
from .sonars import READING_S, START_S
from .wire import IN_BYTE_S, OUT_BYTE_S, Outgoing, Ring

BOOT_S = 2.5
PASS_S = 60e-6
"""One pass of the loop with nothing to do [s]."""
STREAM_EXTRA_S = 0.49e-3
"""What the loop adds to a reply's time while it streams: 325 frames of 27 bytes a second."""
INPUT_BYTES, OUTPUT_BYTES, FRAME_BYTES, DIGITS = 63, 64, 32, 7
MISSING = -1
"""What the 2013 parser has for an argument that is not there, and so refuses when it is."""


class Board2013:
    """A board with the firmware of August 2013 (its stream repeats 8), or of January (its stream repeats 6).

    One pass of its loop reads one byte and, while it streams, sends one whole frame.
    """

    def __init__(self, plant: Plant, january: bool = False, robot_id: Optional[int] = None) -> None:
        self.plant = plant
        self.january = january
        first_id = plant.model.ids[0] if robot_id is None else robot_id
        self.eeprom = bytearray(config_store.image(config_store.defaults(first_id)))
        self.now_s = 0.0
        self._line: List[Tuple[float, int]] = []
        self._line_s = 0.0
        self._input = Ring(INPUT_BYTES)
        self._rows = Rows(self)
        self._start()

    # ---- the Engine interface

    def receive(self, data: bytes) -> None:
        """Bytes from the host, the first of them on the wire from now on."""
        start = max(self.now_s, self._line_s)
        self._line += [(start + (i + 1) * IN_BYTE_S, byte) for i, byte in enumerate(data)]
        self._line_s = start + len(data) * IN_BYTE_S

    def advance(self, to_s: float) -> bytes:
        """Runs the loop to `to_s` [s]; the bytes that left the board until then."""
        while True:
            pass_s = self._next_pass_s()
            if pass_s > to_s:
                break
            self.now_s = max(self.now_s, pass_s)
            self._loop()
        self.now_s = max(self.now_s, to_s)
        self._hear(self.now_s)
        self.plant.advance(self.now_s)
        return self._out.take(self.now_s)

    @property
    def next_event_s(self) -> float:
        """When something happens, or has left, if no bytes come [s]."""
        return min(self._out.next_s, self._next_pass_s())

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The loop stood still until `to_s`; the input buffer kept what it has room for, and it is carried out."""
        self.plant.advance(to_s)
        self.now_s = self._busy_s = to_s
        self._hear(to_s)
        self._input.put(waiting)

    def reset(self) -> None:
        """The reset line; the motor board keeps going until the set-up stops it."""
        self._start()

    def close(self) -> None:
        """Nothing to free."""

    def has_motors(self) -> bool:
        """Whether its id is one with a motor board, and that answers."""
        return self.motors_there and self.plant.motor_board.present

    # ---- the loop

    def _start(self) -> None:
        self._busy_s = self.now_s + BOOT_S
        self._booted = False
        self._line.clear()
        self._line_s = self.now_s
        self._input = Ring(INPUT_BYTES)
        self._out = Outgoing()
        self._out.free_s = self.now_s
        self._frame: Optional[bytearray] = None
        self.debug = False
        self.stream = 0
        self._trigger_s = math.inf

    def _set_up(self) -> None:
        self._booted = True
        (number,) = struct.unpack_from("<f", self.eeprom, config_store.ID_AT)
        self.robot_id = int(number)
        self.motors_there = self.robot_id < NO_MOTORS_FROM_ID
        self.plant.pin_changed(SONAR_POWER, 1, self.now_s)
        self._trigger_s = self.now_s + START_S
        if self.has_motors():
            config, motor, now = Config(self.eeprom), self.plant.motor_board, self.now_s
            motor.fed = True
            motor.stop(now)
            motor.set_geometry(now, Geometry(*(config[name] for name in Geometry._fields)))
            motor.set_gains(now, config["kp"], config["ki"], config["kd"])
            motor.set_ramp(now, config["ramp_time"], config["ramp_gain"])
            motor.set_timeout(now, 0)

    def _next_pass_s(self) -> float:
        """The next pass that has something to do."""
        due = self._trigger_s
        if not self._booted or self.stream or self._input:
            due = self._busy_s
        elif self._line:
            due = min(due, self._line[0][0])
        return max(due, self._busy_s)

    def _loop(self) -> None:
        if not self._booted:
            self._set_up()
        self._hear(self.now_s)
        if self._trigger_s <= self.now_s:
            self._trigger()
        self._busy_s = self.now_s + PASS_S
        byte = self._input.take()
        if byte is not None:
            self._parse(byte)
        if self.stream:
            self._send_stream()
        self._busy_s = max(self._busy_s, self._out.free_s - OUTPUT_BYTES * OUT_BYTE_S)

    def _hear(self, to_s: float) -> None:
        """Moves what has arrived into the input buffer."""
        arrived = 0
        while arrived < len(self._line) and self._line[arrived][0] <= to_s:
            arrived += 1
        self._input.put(bytes(byte for _, byte in self._line[:arrived]))
        del self._line[:arrived]

    def _trigger(self) -> None:
        self.plant.pin_changed(SONAR_TRIGGER, 1, self.now_s)
        self.plant.pin_changed(SONAR_TRIGGER, 0, self.now_s)
        self._trigger_s = self.now_s + 3.2 * READING_S

    # ---- the parser and its faults

    def _parse(self, byte: int) -> None:
        """One byte.  A '@' inside a frame throws away that frame, and the new one with it."""
        if byte == ord("@"):
            self._frame = bytearray() if self._frame is None else None
        elif self._frame is not None:
            self._frame.append(byte)
            if byte == ord("e"):
                frame, self._frame = bytes(self._frame[:-1]), None
                self._execute(frame)
            elif len(self._frame) >= FRAME_BYTES - 1:
                self._frame = None

    def _execute(self, frame: bytes) -> None:
        values = [_number(token) for token in frame.split(b",")]
        row = self._rows.requests.get(values[0])
        self._say(b"[INFO] received @" + frame + b"e ")
        if row is None:
            self._say(b"[ERROR] unknown command ")
            return
        args = (values[1:] + [MISSING] * row.arguments)[: row.arguments]
        if MISSING in args:
            self._say(b"[ERROR] missing argument ")
            return
        self._busy_s = self.now_s + row.duration_s
        self._send(values[0], row.action(*args), self._busy_s)

    def _send_stream(self) -> None:
        code, action, duration_s = self._rows.streams[self.stream]
        ready_s = self._busy_s + duration_s
        self._send(code, action(), ready_s)
        self._busy_s = ready_s + STREAM_EXTRA_S - PASS_S

    def _send(self, code: int, fields: Optional[Tuple[int, ...]], at_s: float) -> None:
        if fields is not None:
            self._out.put(b"@" + b",".join(b"%d" % value for value in (code, *fields)) + b"e\r\n", at_s)

    def _say(self, text: bytes) -> None:
        """Debug text, which stands on the line of whatever comes next."""
        if self.debug:
            self._out.put(text, self.now_s)


def _number(token: bytes) -> int:
    """A number as the 2013 parser reads it: what is no digit is skipped, 16 bits are kept, nothing at all is -1."""
    digits = bytes(byte for byte in token if byte in b"0123456789")
    if not digits or len(digits) > DIGITS:
        return MISSING
    value = -int(digits) if token[:1] == b"-" else int(digits)
    return (value + 0x8000 & 0xFFFF) - 0x8000


class Board2013August(Board2013):
    """The board whose stream repeats the reply of 8."""

    def __init__(self, plant: Plant, robot_id: Optional[int] = None) -> None:
        super().__init__(plant, False, robot_id)


class Board2013January(Board2013):
    """The board whose stream repeats the reply of 6."""

    def __init__(self, plant: Plant, robot_id: Optional[int] = None) -> None:
        super().__init__(plant, True, robot_id)
