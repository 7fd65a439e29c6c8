"""PythonBoard: the firmware's behaviour in Python, on a Plant, in the time of its wire.

What a request does stands in `handlers`; here are the line, the order of events, streams and failsafes.
"""

import math
from collections import deque
from typing import Deque, NamedTuple, Optional

from mrl_driver.protocol.codec import REQUESTS, Frame, FrameDecoder, Stamp, encode_reply
from mrl_driver.protocol.table import BAUDS, BY_CODE, TICK_S
from sim_arduino.hardware.omni3md import Omni3MD
from sim_arduino.hardware.sonars import VOLTS_PER_COUNT
from sim_arduino.hardware.wiring import Plant

from . import handlers, parameter_store
from .board_status import Health
from .motor_control import Motors
from .parameter_store import Config
from .sonar_chain import SonarTask
from .uart import OUT_BYTE_S, Incoming, Outgoing

BOOT_S = 1.2e-3
"""From a reset to the motors' stop and the first request [s]: that of the image, without the bootloader."""
STALL_S = 0.25
CHECK_SILENCE_S = 2.0
BAUD_SILENCE_S = 1.0
BAUD_QUIET_S = 4 * TICK_S
"""What the chip waits after its queue is empty: two bytes are in the transmitter."""
SAME_BAUD = 0.05
"""Speeds that differ by less understand each other."""
RETRY_S = 5e-3
"""Pause of a full-rate stream whose values cannot be had [s]."""
ANSWERS = 8
"""Replies that wait for the wire; one more is dropped and counted as an overrun."""
FETCH_S = {18: 0.34e-3, 44: 0.34e-3, 23: 0.64e-3, 25: 0.65e-3, 27: 0.0}
"""What the values of a frame of a stream take to read, on the simulated ATmega328P [s]: a fast line waits for them."""
LOW_WATER = 9
"""Bytes of the frame before that are still to leave when the reading begins."""
QUEUE_BYTES, SENDING_BYTES = 64, 2
"""What waits for the line at most, and what stands in the transmitter beside that."""
_HEATER, _FAN = 15, 7


class Answer(NamedTuple):
    """A reply that waits: not before [s], code, and what its handler wants to be reminded of."""

    due_s: float
    code: int
    value: int


class Stream(NamedTuple):
    """A running stream: the command that started it, and the time between frames [s], 0 as fast as the wire."""

    code: int
    period_s: float


class PythonBoard:
    """A board with our firmware.

    Args:
        plant: What is wired to it.
        robot_id: Id in its EEPROM; 0 is not set.
        environment: The environment-sensor build instead of the sonar build.
        eeprom: 1024 bytes that survive resets, instead of a sound image of the id's defaults.

    Attributes:
        config: The parameters in force.
        health: Counters and flags since the last reset.
        motors: The motor board as the firmware sees it.
        sonars: The sonars' side of the board; None in the environment-sensor build.
    """

    def __init__(
        self,
        plant: Plant,
        robot_id: Optional[int] = None,
        environment: bool = False,
        eeprom: Optional[bytearray] = None,
    ) -> None:
        self.plant = plant
        self.environment = environment
        first_id = plant.model.ids[0] if robot_id is None else robot_id
        self.eeprom = (
            bytearray(parameter_store.image(parameter_store.first(first_id, plant.model)))
            if eeprom is None
            else eeprom
        )
        self.now_s = 0.0
        self._decoder = FrameDecoder(REQUESTS)
        self._host_baud = float(BAUDS[0])
        self._left = b""
        self._start("power_on")

    # ---- the Engine interface

    def receive(self, data: bytes) -> None:
        """Bytes from the host, the first of them on the wire from now on."""
        self._incoming.put(self._through_line(data), self.now_s)

    def advance(self, to_s: float) -> bytes:
        """Runs to `to_s` [s]; the bytes that left the board until then."""
        if self._booted and self.motors.changed():
            self.motor_there()
        while True:
            event_s = self._next_s(0.0)
            if event_s > to_s:
                break
            self.now_s = max(self.now_s, event_s)
            self._run_events()
        self.now_s = max(self.now_s, to_s)
        self.plant.advance(self.now_s)
        left = self._left + self._through_line(self._outgoing.take(self.now_s))
        self._left = b""
        return left

    def set_host_baud(self, baud: float) -> None:
        """The host's speed, both ways; at another speed than the board's the bytes turn into others."""
        self._host_baud = baud
        self._incoming.byte_s = 10.0 / baud

    def _through_line(self, data: bytes) -> bytes:
        same = abs(self._host_baud / BAUDS[self.baud] - 1.0) < SAME_BAUD
        return data if same else b"\xff" * len(data)

    @property
    def next_event_s(self) -> float:
        """When something will have left, or has to happen, if no bytes come [s].

        A frame of the stream is worth a call when it is complete; what it tells is still that of its start.
        """
        return min(self._outgoing.next_s, self._next_s(self._frame_s))

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The loop stood still until `to_s`: what waited for longer than 250 ms is stale and dropped."""
        if to_s - self.now_s <= STALL_S:
            self.receive(waiting)
            return
        self.motor_board.fed = False
        self.plant.advance(to_s)
        self.motor_board.fed = True
        self.now_s = self._valid_s = self._stream_due_s = to_s
        self._incoming.clear()
        self._decoder = FrameDecoder(REQUESTS, self._decoder.checked)
        self.stop_motors("stall")

    def reset(self) -> None:
        """The reset line: RAM starts anew, EEPROM stays; the motors get their stop when the sketch is up."""
        self.motor_board.fed = False
        self.plant.advance(self.now_s)
        self._start("external")

    def close(self) -> None:
        """Nothing to free."""

    # ---- start

    def _start(self, cause: str) -> None:
        self.started_s = self.now_s
        self.ready_s = self.now_s + BOOT_S
        self.health = Health(cause)
        self.config = Config(self.eeprom)
        self.motors = Motors(self.plant.motor_board, self.config, self.health)
        self.sonars: Optional[SonarTask] = None
        self.debug = False
        self.stream: Optional[Stream] = None
        self.watchdog_ms = 0
        self._valid_s = self._stream_due_s = self.ready_s
        self._silent = False
        self._sequence = 0
        self._frame_s = 0.0
        self._stream_has_turn = False
        self._counts_s = 0.0
        self._booted = False
        self._incoming, self._outgoing = Incoming(), Outgoing()
        self._incoming.byte_s = 10.0 / self._host_baud
        self.baud = self._wanted_baud = 0
        self._left = b""
        self._outgoing.free_s = self.now_s
        self._decoder = FrameDecoder(REQUESTS)
        self._answers: Deque[Answer] = deque()

    def _boot(self) -> None:
        self._booted = True
        self.health.set_fault("eeprom", not self.config.sound)
        self.health.set_fault("id_unset", self.config["robot_id"] == 0)
        if self.environment:
            self.plant.pin_changed(_HEATER, 0, self.now_s)
            self.plant.pin_changed(_FAN, 1, self.now_s)
        else:
            self.sonars = SonarTask(self.plant, self.config, self.adc, self.now_s)
        if self.motor_there():
            self.motor_board.fed = True
            self.motor_board.stop(self.now_s)
            self.motors.set_up(self.now_s)

    # ---- events in time

    def _next_s(self, frame_s: float) -> float:
        """When the next event is due [s], that of a frame on the wire `frame_s` later."""
        if not self._booted:
            return self.ready_s
        trigger_s = self.sonars.next_s if self.sonars else math.inf
        return min(
            self._incoming.next_s,
            trigger_s,
            self._watchdog_due_s(),
            self._check_due_s(),
            self._baud_due_s(),
            self._wire_due_s() + frame_s,
        )

    def _run_events(self) -> None:
        now = self.now_s
        if not self._booted:
            self._boot()
            return
        if self._incoming.next_s <= now:
            self._take(self._incoming.take())
        if self.sonars:
            self.sonars.run(now)
        if self._watchdog_due_s() <= now:
            self._silent = True
            self.stop_motors("link_watchdog")
        if self._check_due_s() <= now:
            self.stop_motors("check_ended")
            self.set_check(False)
        if self._baud_due_s() <= now:
            self._change_baud(self._wanted_baud if self._wanted_baud != self.baud else 0)
        if self._wire_due_s() <= now:
            self._send_next()

    def _baud_due_s(self) -> float:
        """When the line's speed changes: once the answer has left, or back when nothing valid comes."""
        if self._wanted_baud != self.baud:
            return math.inf if self._answers else self._outgoing.free_s + BAUD_QUIET_S
        return self._valid_s + BAUD_SILENCE_S if self.baud else math.inf

    def _change_baud(self, row: int) -> None:
        self._left += self._through_line(self._outgoing.take(self.now_s))
        self.baud = self._wanted_baud = row
        self._outgoing.byte_s = OUT_BYTE_S if row == 0 else 10.0 / BAUDS[row]

    def _watchdog_due_s(self) -> float:
        return (
            self._valid_s + self.watchdog_ms / 1000.0 if self.watchdog_ms and not self._silent else math.inf
        )

    def _check_due_s(self) -> float:
        return self._valid_s + CHECK_SILENCE_S if self._decoder.checked else math.inf

    def _wire_due_s(self) -> float:
        """When the next frame goes onto the wire [s]: the line is free, and an answer or the stream is due."""
        due = self._stream_due_s if self.stream and self._wanted_baud == self.baud else math.inf
        if self._answers:
            due = min(due, min(answer.due_s for answer in self._answers))
        return max(due, self._outgoing.free_s)

    def _take(self, data: bytes) -> None:
        """Carries out the request that ends `data`, if one does."""
        for event in self._decoder.feed(data):
            if isinstance(event, Frame):
                self.carry_out(event)
            else:
                self.refuse(event.reason)

    def carry_out(self, frame: Frame) -> None:
        """Does what a valid request asks for."""
        self._valid_s, self._silent = self.now_s, False
        row = BY_CODE[frame.code]
        handlers.REQUESTS[row.name](self, *frame.args)
        if self.debug and self._answers and self._wire_due_s() <= self.now_s:
            self._send_next()
        self._say("[INFO] " + row.name)

    # ---- the wire

    def ask(self, code: int, value: int = 0, after_s: float = 0.0) -> None:
        """Queues the reply `code`."""
        if len(self._answers) >= ANSWERS:
            self.refuse("overrun")
        else:
            self._answers.append(Answer(self.now_s + after_s, code, value))

    def _send_next(self) -> None:
        """An answer or a frame of the stream; if both are due, by turns."""
        stream_due = (
            self.stream is not None and self._stream_due_s <= self.now_s and self._wanted_baud == self.baud
        )
        answer = next((each for each in self._answers if each.due_s <= self.now_s), None)
        self._stream_has_turn = stream_due and (answer is None or not self._stream_has_turn)
        if self._stream_has_turn:
            self._send_stream()
        elif answer:
            self._answers.remove(answer)
            if BY_CODE[answer.code].stamped:
                self._counts_s = self.now_s + FETCH_S[18]
            if not self._send(answer.code, answer.value):
                self.refuse("unavailable")

    def _send_stream(self) -> None:
        assert self.stream
        period = self.stream.period_s
        sent = self._send(BY_CODE[self.stream.code].repeats)
        self._stream_due_s += period
        if self._stream_due_s <= self.now_s:
            self._stream_due_s = self.now_s + (period if period or sent else RETRY_S)
        if sent and not period:
            wait_s = max(0.0, FETCH_S[self.stream.code] - LOW_WATER * self._outgoing.byte_s)
            self._stream_due_s = self._outgoing.free_s + wait_s

    def _send(self, code: int, value: int = 0) -> bool:
        """Builds a reply of what holds now; False if there is nothing valid to send."""
        args = handlers.REPLIES[code](self, value)
        if args is None:
            return False
        stamp = None
        if self._decoder.checked and BY_CODE[code].stamped:
            stamp = Stamp(_int16(self._sequence), _int16(int((self.now_s - self.started_s) / TICK_S)))
            self._sequence += 1
        self._outgoing.put(encode_reply(code, *args, stamp=stamp, checked=self._decoder.checked), self.now_s)
        self._frame_s = self._outgoing.free_s - self.now_s
        return True

    def _say(self, text: str) -> None:
        """Free text for people, if it is asked for and fits behind what is to leave; lost while an answer waits for its
        counters."""
        line = text.encode() + b"\r\n"
        queued = (self._outgoing.free_s - self.now_s) / self._outgoing.byte_s - SENDING_BYTES
        if self.debug and self.now_s >= self._counts_s and queued + len(line) <= QUEUE_BYTES:
            self._outgoing.put(line, self.now_s)

    # ---- what handlers use

    def start_stream(self, code: int, period_ms: int) -> None:
        """Begins a stream; it replaces one that runs."""
        self.stream = Stream(code, period_ms / 1000.0)
        self._stream_due_s = self.now_s

    def stop_stream(self, code: int) -> None:
        """Ends the stream that `code` started."""
        if self.stream and self.stream.code == code:
            self.stream = None

    def want_baud(self, row: int) -> None:
        """Changes the line's speed to that of a row of `table.BAUDS`, once what is to be sent has left."""
        self._wanted_baud = row

    def set_check(self, on: bool) -> None:
        """Check value on or off, both ways."""
        self._decoder.checked = on

    def refuse(self, reason: str) -> None:
        """Counts a refusal, and says so in debug."""
        self.health.count(reason)
        self._say("[ERROR] " + reason)

    @property
    def motor_board(self) -> Omni3MD:
        """The motor board on the plant."""
        return self.plant.motor_board

    def motor_there(self) -> bool:
        """Whether the motor board answers now."""
        return self.motors.there(self.now_s)

    def stop_motors(self, reason: str) -> None:
        """The motor board's own stop, at once."""
        self.motors.stop(self.now_s, reason)

    def adc(self, channel: int) -> int:
        """ADC count of A0 to A3."""
        return min(1023, int(self.plant.adc_volts(channel, self.now_s) / VOLTS_PER_COUNT))


def _int16(value: int) -> int:
    return (value + 0x8000 & 0xFFFF) - 0x8000
