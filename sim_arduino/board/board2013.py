"""The boards of 2013 with their faults, which a driver for boards in the field must tolerate.

The times were measured with the 2013 firmware on a simulated ATmega328P, without the bootloader's second.  The faults
are those of its released source.
"""

import math
import re
import struct
from typing import List, Optional, Set, Tuple

from sim_arduino.hardware.omni3md import Geometry
from sim_arduino.hardware.wiring import SONAR_POWER, SONAR_TRIGGER, Plant

from . import parameter_store
from .board2013_handlers import NO_MOTORS_FROM_ID, Hung, Row, Rows
from .parameter_store import Config
from .uart import IN_BYTE_S, OUT_BYTE_S, Outgoing, Ring

STOP_S = 0.011
"""From a reset to the stop of the motor board [s]; the real board sets it up within 70 ms, this one at once."""
AUGUST_S, JANUARY_S = 3.35, 0.10
"""From a reset to the first request that is read [s]; the August firmware waits 3 s for its environment sensors."""
PASS_S = 60e-6
"""Duration of one pass of the loop with nothing to do [s]."""
PRINT_S = 18e-6
"""Time to print a byte into the output buffer [s]: gives 325 stream frames of 27 bytes per second."""
INPUT_BYTES, OUTPUT_BYTES, FRAME_BYTES, DIGITS = 63, 64, 32, 7
MISSING = -1
"""The 2013 parser's value for a missing argument; it therefore refuses a real -1."""


class Board2013:
    """A board with the firmware of August 2013 (its stream repeats reply 8), or of January 2013 (reply 6).

    One pass of its loop reads one byte and, while a stream runs, sends one whole frame.
    """

    def __init__(self, plant: Plant, january: bool = False, robot_id: Optional[int] = None) -> None:
        self.plant = plant
        self.january = january
        first_id = plant.model.ids[0] if robot_id is None else robot_id
        self.eeprom = bytearray(parameter_store.image(parameter_store.defaults(first_id)))
        self.now_s = self._busy_s = 0.0
        self._line: List[Tuple[float, int]] = []
        self._line_s = 0.0
        self._input = Ring(INPUT_BYTES)
        self._rows = Rows(self)
        self._start()

    # ---- the Engine interface

    def receive(self, data: bytes) -> None:
        """Bytes from the host; the first byte starts on the line now."""
        start = max(self.now_s, self._line_s)
        self._line += [(start + (i + 1) * IN_BYTE_S, byte) for i, byte in enumerate(data)]
        self._line_s = start + len(data) * IN_BYTE_S

    def advance(self, to_s: float) -> bytes:
        """Runs the loop to `to_s` [s]; returns the bytes that left the board until then."""
        while True:
            pass_s = self._next_pass_s()
            if pass_s > to_s:
                break
            self.now_s = max(self.now_s, pass_s)
            if self._set_up_s <= self.now_s:
                self._set_up()
            else:
                self._loop()
        self.now_s = max(self.now_s, to_s)
        self._hear(self.now_s)
        self.plant.advance(self.now_s)
        return self._out.take(self.now_s)

    @property
    def next_event_s(self) -> float:
        """Time of the next event, or when the next bytes have left, if no bytes come [s]."""
        return min(self._out.next_s, self._next_pass_s())

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The loop stood still until `to_s`; the bytes that fit into the input buffer are handled afterwards."""
        self.plant.advance(to_s)
        self.now_s = to_s
        self._busy_s = max(to_s, self._busy_s)
        self._hear(to_s)
        self._input.put(waiting)

    def reset(self) -> None:
        """Pull the reset line; the motors keep turning until the set-up stops them."""
        self._start()

    def close(self) -> None:
        """Does nothing: there is nothing to free."""

    def has_motors(self) -> bool:
        """Whether the board's id has a motor board, and the motor board answers."""
        return self.motors_there and self.plant.motor_board.present

    # ---- the loop

    def _start(self) -> None:
        for pin in (SONAR_TRIGGER, SONAR_POWER):
            self.plant.pin_changed(pin, 0, self.now_s)
        self._set_up_s = self.now_s + STOP_S
        self._busy_s = self.now_s + (JANUARY_S if self.january else AUGUST_S)
        self._line.clear()
        self._line_s = self.now_s
        self._input = Ring(INPUT_BYTES)
        self._out = Outgoing()
        self._out.free_s = self.now_s
        self._frame: Optional[bytes] = None
        self.debug = 0
        self.streams: Set[int] = set()

    def _set_up(self) -> None:
        self._set_up_s = math.inf
        (number,) = struct.unpack_from("<f", self.eeprom, parameter_store.ID_AT)
        self.robot_id = int(number)
        self.motors_there = self.robot_id < NO_MOTORS_FROM_ID
        self.plant.pin_changed(SONAR_POWER, 1, self.now_s)
        if self.has_motors():
            config, motor, now = Config(self.eeprom), self.plant.motor_board, self.now_s
            motor.fed = True
            motor.stop(now)
            motor.set_timeout(now, 0)
            for encoder in (1, 3):
                motor.preset_encoder(now, encoder, 0)
            for encoder in (1, 3):
                motor.set_prescaler(now, encoder, 0)
            motor.set_gains(now, config["kp"], config["ki"], config["kd"])
            motor.set_ramp(now, config["ramp_time"], config["ramp_gain"])
            motor.set_geometry(now, Geometry(*(config[name] for name in Geometry._fields)))

    def _next_pass_s(self) -> float:
        """Time of the next pass that has something to do [s]."""
        due = self._line[0][0] if self._line else math.inf
        if self.streams or self._input:
            due = self._busy_s
        return min(self._set_up_s, max(due, self._busy_s))

    def _loop(self) -> None:
        self._hear(self.now_s)
        self._busy_s = self.now_s + PASS_S
        byte = self._input.take()
        acted = byte is not None and self._parse(byte)
        if self.streams and not acted:
            self._run(next(row for row in self._rows.streams if row.code in self.streams))
        self._busy_s = max(self._busy_s, self._out.free_s - OUTPUT_BYTES * OUT_BYTE_S)

    def _hear(self, to_s: float) -> None:
        """Moves the bytes that have arrived into the input buffer."""
        arrived = 0
        while arrived < len(self._line) and self._line[arrived][0] <= to_s:
            arrived += 1
        self._input.put(bytes(byte for _, byte in self._line[:arrived]))
        del self._line[:arrived]

    # ---- the parser and its faults

    def _parse(self, byte: int) -> bool:
        """Parses one byte; returns whether it completed a request that was carried out.

        A '@' inside a frame discards that frame and the new one.
        """
        if byte == ord("@"):
            if self._frame is not None:
                self._note(b"[ERROR] Got start byte in the middle of a message!")
            self._frame = b"" if self._frame is None else None
        elif self._frame is not None:
            frame, self._frame = self._frame, None
            if len(frame) >= (FRAME_BYTES - 2 if byte == ord("e") else FRAME_BYTES - 1):
                self._note(b"[ERROR] Buffer size exceeded!")
            elif byte == ord("e"):
                return self._execute(frame)
            else:
                self._frame = frame + bytes([byte])
        return False

    def _execute(self, frame: bytes) -> bool:
        values = [_number(token) for token in frame.split(b",")]
        row = self._rows.requests.get(values[0])
        self._note(b"[INFO] Got message: @" + frame + b"e")
        if values[0] == MISSING:
            self._note(b"[ERROR] Could not find an action in the message!")
        if row is None:
            self._note(b"[ERROR] Unknown action: %d" % values[0])
            return False
        args = (values[1:] + [MISSING] * row.arguments)[: row.arguments]
        if MISSING in args:
            self._note(b"[ERROR] Insufficient number of parameters for this action!")
            return False
        self._run(row, *args)
        return True

    def _run(self, row: Row, *args: int) -> None:
        """Carries out a request; its reply is sent when its duration is over."""
        ready_s = self.now_s + row.duration_s
        try:
            fields = row.action(*args)
        except Hung:
            self._busy_s = math.inf
            return
        self._busy_s = ready_s
        if fields is not None:
            answer = b"@" + b",".join(b"%d" % value for value in (row.reply, *fields)) + b"e\r\n"
            self._out.put(answer, ready_s)
            self._busy_s += len(answer) * PRINT_S

    def _note(self, text: bytes) -> None:
        """Sends a line of text in debug mode."""
        if self.debug:
            self.say(text)

    def say(self, text: bytes) -> None:
        """Sends a line of text."""
        self._out.put(text + b"\r\n", self.now_s)


def _number(token: bytes) -> int:
    """A number as C's atoi reads it (spaces, a sign, digits up to the first other byte, else 0), cut to 16 bits.

    An empty token is `MISSING`.  So is one of more than 7 characters; on the real board it overruns a buffer, and the
    board hangs or restarts.
    """
    if not token or len(token) > DIGITS:
        return MISSING
    found = re.match(rb"[ \t-\r]*([+-]?[0-9]+)", token)
    return (int(found.group(1)) + 0x8000 & 0xFFFF) - 0x8000 if found else 0


class Board2013August(Board2013):
    """The board of August 2013; its stream repeats reply 8."""

    def __init__(self, plant: Plant, robot_id: Optional[int] = None) -> None:
        super().__init__(plant, False, robot_id)


class Board2013January(Board2013):
    """The board of January 2013; its stream repeats reply 6."""

    def __init__(self, plant: Plant, robot_id: Optional[int] = None) -> None:
        super().__init__(plant, True, robot_id)
