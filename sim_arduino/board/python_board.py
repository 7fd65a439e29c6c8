"""PythonBoard: the firmware's behaviour in Python, wired to a Plant, with the timing of the serial link.

`handlers` carries out the requests.  This module has the line, the order of events, streams and failsafes.
"""

import math
from collections import deque
from typing import Deque, List, NamedTuple, Optional

from mrl_driver.protocol import REQUESTS, Frame, FrameDecoder, Stamp, encode_reply
from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BAUD, BAUDS, BY_CODE, BY_NAME, TICK_S
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import CHIPS
from sim_arduino.hardware.sonars import VOLTS_PER_COUNT
from sim_arduino.hardware.wiring import FAN, HEATER, Plant, sonar_pins_of

from . import handlers, parameter_store
from .board_status import BoardStatus
from .bridge_control import BridgeControl
from .engine import Engine
from .imu_reader import ImuReader, Reading
from .motor_control import MotorControl
from .motors import Motors
from .parameter_store import Config
from .radio_port import RadioHold, RadioPort
from .range_task import RangeTask
from .servo_outputs import ServoOutputs
from .sonar_chain import SonarTask
from .uart import OUT_BYTE_S, Incoming, Outgoing, through_line

BOOT_S = 1.2e-3
"""From a reset to the motors' stop and the first request [s]; measured with the image, without the bootloader."""
STALL_S = 0.25
CHECK_SILENCE_S = 2.0
BAUD_SILENCE_S = 1.0
BAUD_QUIET_S = 4 * TICK_S
"""The chip's wait after its queue is empty, because two bytes are still in the transmitter."""
RETRY_S = 5e-3  # pause of a full-rate stream if its values are not available [s]
ANSWERS = 8  # largest number of waiting replies; one more is dropped and counted as an overrun
FETCH_S = {23: 0.64e-3, 25: 0.65e-3, 27: 0.0}
"""Time to read the values of a sensor stream's frame on the simulated ATmega328P [s]; other streams need the counters
alone.  A fast link waits for them."""
LOW_WATER = 9  # the reading begins when this many bytes of the previous frame have not left yet
QUEUE_BYTES, SENDING_BYTES = 64, 2  # size of the send queue, and number of bytes in the transmitter itself
IMU_FRAME_S = 6.6e-3  # longest time of an IMU frame with its reading, at the slowest baud rate [s]
_TOGETHER_S = 1e-6
"""Frames that are due within this time are due at the same time; sums of periods differ by rounding [s]."""
READ_IMU = BY_NAME["read_imu"].code
_COUNTS_OF = frozenset(
    BY_NAME[name].code for name in ("read_encoders", "read_encoders_and_sonars", "read_wheels")
)
"""Answers with counters."""


class WaitingReply(NamedTuple):
    """A waiting reply: earliest time [s], code, and a value passed back to its builder."""

    due_s: float
    code: int
    value: int


class RunningStream(NamedTuple):
    """A running stream: the command that started it, and the time between frames [s]; 0 is as fast as possible."""

    code: int
    period_s: float


class ImuStream:
    """The stream of IMU frames, independent of the other one: time between frames, and time of the next frame [s]."""

    def __init__(self, period_s: float, now_s: float) -> None:
        self.period_s, self.due_s = period_s, now_s

    @property
    def late_s(self) -> float:
        """Time at which the next frame is late: half a period after it is due [s]."""
        return self.due_s + 0.5 * self.period_s

    def align(self, due_s: float, now_s: float) -> None:
        """Lets its frames coincide with those of a stream whose next frame is due at `due_s` [s]."""
        self.due_s = due_s - self.period_s * max(0, math.ceil((due_s - now_s) / self.period_s - 1.0))

    def sent(self, now_s: float) -> None:
        """Plans the next frame; after one that is more than a period late, a new cadence starts."""
        self.due_s += self.period_s
        if self.due_s <= now_s:
            self.due_s = now_s + self.period_s


class PythonBoard(Engine):
    """A board with our firmware, of the environment-sensor build or of the sonar build.

    `eeprom` has 1024 bytes that survive resets; None makes a valid image of the defaults for `robot_id`, 0 if not set.
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
        if eeprom is None:
            eeprom = bytearray(parameter_store.image(parameter_store.first(first_id, plant.model)))
        self.eeprom = eeprom
        self.now_s = 0.0
        self._host_baud = float(BAUD)
        self._left = b""
        self._start("power_on")

    # ---- the Engine interface

    def receive(self, data: bytes) -> None:
        self._incoming.put(self._through_line(data), self.now_s)

    def advance(self, to_s: float) -> bytes:
        if self._booted and self.motors.changed():
            self.motors.there(self.now_s)
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
        """Set the host's baud rate in both directions; if it differs from the board's, bytes arrive corrupted."""
        self._host_baud = baud
        self._incoming.byte_s = 10.0 / baud

    def _through_line(self, data: bytes) -> bytes:
        return through_line(data, self._host_baud, BAUDS[self.baud])

    @property
    def next_event_s(self) -> float:
        """Time of the next event, or when the next frame has left, if no bytes come [s].

        A stream frame needs a call only when it is complete; its values are still those of its start.
        """
        return min(self._outgoing.next_s, self._next_s(self._frame_s))

    def gap(self, to_s: float, waiting: bytes) -> None:
        """The loop stood still until `to_s`; after more than 250 ms the waiting bytes are stale and dropped."""
        if to_s - self.now_s <= STALL_S:
            self.receive(waiting)
            return
        self.motors.halt(self.now_s, to_s)
        self.now_s = self._valid_s = self._stream_due_s = to_s
        if self.imu_stream:
            self.imu_stream.due_s = to_s
        self._incoming.clear()
        if self.radio:
            self.radio.gap(to_s)
        self._decoder.drop()
        self.stop_motors(StopReason.STALL)

    def reset(self) -> None:
        """Pull the reset line: RAM is cleared, EEPROM stays; the motors stop when the sketch has started."""
        self._restart("external")
        if self.plant.bridge:
            self.ready_s += self.plant.bridge.boot(self.now_s)

    def brown_out(self) -> None:
        """The supply voltage dropped: a reset with that cause."""
        self._restart("brown_out")

    def _restart(self, cause: str) -> None:
        self.motors.release(self.now_s)
        self._start(cause)

    # ---- start

    def _start(self, cause: str) -> None:
        self.started_s = self.now_s
        self.ready_s = self.now_s + BOOT_S
        self.health = BoardStatus(cause, self._ask_status)
        pins = wiring.rows(CHIPS[self.plant.model.chip]) if self.plant.bridge else ()
        self.config = Config(self.eeprom, pins)
        self.motors: Motors = (
            BridgeControl(self.plant, self.config, self.health, self.adc, self.started_s)
            if self.plant.bridge
            else MotorControl(self.plant.motor_board, self.config, self.health, self.plant.advance)
        )
        self.sonars: Optional[SonarTask] = None  # None in the environment-sensor build
        self.servos = ServoOutputs(self.plant, {}, self.now_s)
        self.ranges = RangeTask(self.plant, {}, 0, self.now_s, self.adc)
        self.imu = ImuReader(self.plant.i2c, self.environment, self.health)
        self.imu_reading: Optional[Reading] = None  # what the last reading of the IMU gave
        self._imu_read_s, self._imu_ahead = 0.0, False
        hold = RadioHold(self.config, lambda: self.stop_motors(StopReason.HELD), self.ready_s)
        self.radio = RadioPort(self.plant.xbee, hold, self.ask, self._can_ask) if self.plant.xbee else None
        self.debug = False
        self.stream: Optional[RunningStream] = None
        self.imu_stream: Optional[ImuStream] = None
        self.watchdog_ms = 0
        self._valid_s = self._stream_due_s = self.ready_s
        self._silent = self._lost = False
        self._sequence = 0
        self._frame_s = 0.0
        self._last_turn = 0
        self._counts_s = 0.0
        self._booted = False
        self._incoming, self._outgoing = Incoming(), Outgoing()
        self._incoming.byte_s = 10.0 / self._host_baud
        self.baud = self.wanted_baud = 0  # rows of `table.BAUDS`: now, and after all waiting bytes have left
        self._left = b""
        self._outgoing.free_s = self.now_s
        self._decoder: FrameDecoder = FrameDecoder(REQUESTS)
        self._answers: Deque[WaitingReply] = deque()

    def _boot(self) -> None:
        self._booted = True
        self.health.set_fault("eeprom", not self.config.sound)
        self.health.set_fault("id_unset", self.config["robot_id"] == 0)
        if self.environment:
            self.plant.pin_changed(HEATER, 0, self.now_s)
            self.plant.pin_changed(FAN, 1, self.now_s)
        self.motors.boot(self.now_s)
        self.connect()

    def connect(self) -> None:
        """Begins with what is on the pins besides motors; on an H-bridge board these pins are in the wiring."""
        motors = self.motors
        sound = not isinstance(motors, BridgeControl) or motors.accepted
        pins = sonar_pins_of(self.plant.model, self.config.pins)
        self.sonars = None
        if sound and not self.environment:
            self.sonars = SonarTask(self.plant, pins, self.config, self.adc, self.now_s)
        own = self.config.pins if sound else {}
        self.servos = ServoOutputs(self.plant, own, self.now_s)
        if self.config.pins:
            self.ranges = RangeTask(self.plant, own, self.config["air_temperature"], self.now_s, self.adc)
            self.health.set_fault("sensor", False)
        bus = sound and self.config.pins.get(wiring.I2C, 1)
        if self.plant.imu and bus and not self.imu.found:
            self.imu.next_s = self.now_s

    # ---- events in time

    def _next_s(self, frame_s: float) -> float:
        """Time of the next event [s]; `frame_s` is added to the time of the next frame."""
        if not self._booted:
            return self.ready_s
        trigger_s = self.sonars.next_s if self.sonars else math.inf
        return min(
            self._incoming.next_s,
            trigger_s,
            self.servos.next_s,
            self.ranges.next_s,
            self.motors.next_s,
            self.imu.next_s,
            self._watchdog_due_s(),
            self._lost_due_s(),
            self._baud_due_s(),
            self.radio.next_s if self.radio else math.inf,
            self._wire_due_s() + frame_s,
        )

    def _run_events(self) -> None:
        now = self.now_s
        if not self._booted:
            self._boot()
            return
        if self.motors.next_s <= now:
            self.motors.run(now)
        if self.imu.next_s <= now:
            self.imu.run(now)
        if self._incoming.next_s <= now:
            self._take(self._incoming.take())
        if self.sonars:
            self.sonars.run(now)
        self.servos.run(now)
        if self.ranges.next_s <= now:
            self.ranges.run(now)
            self.health.set_fault("sensor", self.ranges.held)
        if self._watchdog_due_s() <= now:
            self._silent = True
            self.stop_motors(StopReason.LINK_WATCHDOG)
        if self._lost_due_s() <= now:
            self._lost = True
            self.servos.lose_host(bool(self.config.pins.get(wiring.RELEASE)), now)
            if self._decoder.checked:
                self.stop_motors(StopReason.CHECK_ENDED)
                self.set_check(False)
        if self._baud_due_s() <= now:
            self._change_baud(self.wanted_baud if self.wanted_baud != self.baud else 0)
        if self.radio:
            self.radio.run(now)
        if self._wire_due_s() <= now:
            self._send_next()
            if self.radio:
                self.radio.serve_host(now)

    def _baud_due_s(self) -> float:
        """Time of the baud rate change [s]: after the reply has left, or back if no valid frame comes."""
        if self.wanted_baud != self.baud:
            return math.inf if self._answers else self._outgoing.free_s + BAUD_QUIET_S
        return self._valid_s + BAUD_SILENCE_S if self.baud else math.inf

    def _change_baud(self, row: int) -> None:
        self._left += self._through_line(self._outgoing.take(self.now_s))
        self.baud = self.wanted_baud = row
        self._outgoing.byte_s = OUT_BYTE_S if row == 0 else 10.0 / BAUDS[row]

    def _watchdog_due_s(self) -> float:
        return (
            self._valid_s + self.watchdog_ms / 1000.0 if self.watchdog_ms and not self._silent else math.inf
        )

    def _lost_due_s(self) -> float:
        return math.inf if self._lost else self._valid_s + CHECK_SILENCE_S

    def _wire_due_s(self) -> float:
        """Time at which the next frame is sent [s]: the line is free, and a reply or a stream is due."""
        due = self._main_due_s()
        if self._answers:
            due = min(due, self._answer_due_s())
        if self.imu_stream:
            due = min(due, self._imu_turn_s(self.imu_stream))
        return max(due, self._outgoing.free_s)

    def _main_due_s(self) -> float:
        return self._stream_due_s if self.stream and self.wanted_baud == self.baud else math.inf

    def _answer_due_s(self) -> float:
        return min((answer.due_s for answer in self._answers), default=math.inf)

    def _imu_turn_s(self, imu: ImuStream) -> float:
        """Time at which an IMU frame has its turn if nothing else is sent before [s].

        It gives way to answers, and to frames of the other stream that are due or that it would delay.  Behind one of
        those frames it goes first if the stream has no period, and behind either if it is late.
        """
        if self.wanted_baud != self.baud:
            return math.inf
        turn_s = max(imu.due_s, self._outgoing.free_s)
        answer, main = self._answer_due_s() <= turn_s, self.stream
        if main and self._main_due_s() - (IMU_FRAME_S if main.period_s else 0.0) <= turn_s:
            if self._last_turn != main.code:
                return math.inf
            return max(turn_s, imu.late_s) if answer or main.period_s else turn_s
        if answer:
            return math.inf if self._last_turn else max(turn_s, imu.late_s)
        return turn_s

    def _take(self, data: bytes) -> None:
        """Decodes `data` and carries out the request, or counts why it was refused."""
        self._decoder.plain_calibrate = bool(self.config["plain_calibrate"])
        for event in self._decoder.feed(data):
            if isinstance(event, Frame):
                self.carry_out(event)
            else:
                self.refuse(event.reason)

    def carry_out(self, frame: Frame) -> None:
        """Carries out a valid request."""
        self._valid_s, self._silent, self._lost = self.now_s, False, False
        row = BY_CODE[frame.code]
        if row.reply and not row.stamped and not self._can_ask():
            self.refuse("overrun")
            return
        needed = handlers.NEEDS.get(row.name)
        if needed and needed not in self.capabilities:
            self.refuse("unavailable")
        else:
            handlers.REQUESTS[row.name](self, *frame.args)
        if self.debug and self._answers and self._wire_due_s() <= self.now_s:
            self._send_next()
        self._say("[INFO] " + row.name)

    # ---- the wire

    def ask(self, name: str, value: int = 0, after_s: float = 0.0) -> None:
        """Queues the reply of the row with this name."""
        if len(self._answers) >= ANSWERS:
            self.refuse("overrun")
        else:
            self._answers.append(WaitingReply(self.now_s + after_s, BY_NAME[name].code, value))

    def _ask_status(self) -> None:
        if self._can_ask():
            self.ask("read_status")

    def _can_ask(self) -> bool:
        return len(self._answers) < ANSWERS

    def _send_next(self) -> None:
        """Sends a reply or a frame of a stream; if replies and the stream are due, they take turns."""
        now = self.now_s
        main_due = self._main_due_s() <= now
        answer = next((each for each in self._answers if each.due_s <= now), None) if self._answers else None
        if self.imu_stream and self._imu_turn_s(self.imu_stream) <= now:
            self._last_turn = READ_IMU
            self._send_imu(self.imu_stream)
        elif answer and (not main_due or self._last_turn):
            self._last_turn = 0
            self._send_answer(answer)
        elif main_due:
            assert self.stream
            self._last_turn = self.stream.code
            if self.imu_stream:
                self._read_imu_ahead(self.imu_stream)
            self._send_stream()

    def _send_answer(self, answer: WaitingReply) -> None:
        self._answers.remove(answer)
        if BY_CODE[answer.code].stamped:
            self._counts_s = self.now_s + self.motors.counts_s
        if answer.code == READ_IMU:
            self._read_imu()
        elif self.imu_stream and answer.code in _COUNTS_OF:
            self._read_imu_ahead(self.imu_stream)
        if not self._send(answer.code, answer.value):
            self.refuse("unavailable")

    def _send_imu(self, stream: ImuStream) -> None:
        if not self._imu_ahead:
            self._read_imu()
        self._imu_ahead = False
        self._send(READ_IMU)
        stream.sent(self.now_s)

    def _read_imu(self) -> None:
        self.imu_reading, self._imu_read_s, self._imu_ahead = self.imu.read(self.now_s), self.now_s, False

    def _read_imu_ahead(self, stream: ImuStream) -> None:
        """Reads the IMU directly after the counters if its frame is due as well."""
        self._imu_ahead = False
        if stream.due_s <= self.now_s + _TOGETHER_S:
            self._read_imu()
            self._imu_ahead = True

    def _send_stream(self) -> None:
        assert self.stream
        period = self.stream.period_s
        sent = self._send(BY_CODE[self.stream.code].repeats)
        self._stream_due_s += period
        if self._stream_due_s <= self.now_s:
            self._stream_due_s = self.now_s + (period if period or sent else RETRY_S)
        if sent and not period:
            fetch_s = FETCH_S.get(self.stream.code, self.motors.counts_s)
            wait_s = max(0.0, fetch_s - LOW_WATER * self._outgoing.byte_s)
            self._stream_due_s = self._outgoing.free_s + wait_s

    def _send(self, code: int, value: int = 0) -> bool:
        """Builds and sends a reply with the values of now; False if there is nothing valid to send."""
        args = handlers.REPLIES[BY_CODE[code].name](self, value)
        if args is None:
            return False
        stamp = None
        if self._decoder.checked and BY_CODE[code].stamped:
            read_s = self._imu_read_s if code == READ_IMU else self.now_s
            stamp = Stamp(to_int16(self._sequence), to_int16(int((read_s - self.started_s) / TICK_S)))
            self._sequence += 1
        self._outgoing.put(encode_reply(code, *args, stamp=stamp, checked=self._decoder.checked), self.now_s)
        self._frame_s = self._outgoing.free_s - self.now_s
        return True

    def _say(self, text: str) -> None:
        """Sends a line of text in debug mode; it is lost if the queue is full or a reply waits for its counters."""
        line = text.encode() + b"\r\n"
        queued = (self._outgoing.free_s - self.now_s) / self._outgoing.byte_s - SENDING_BYTES
        if self.debug and self.now_s >= self._counts_s and queued + len(line) <= QUEUE_BYTES:
            self._outgoing.put(line, self.now_s)

    # ---- methods for the handlers

    def start_stream(self, code: int, period_ms: int) -> None:
        """Starts a stream; it replaces a running one."""
        self.stream = RunningStream(code, period_ms / 1000.0)
        self._stream_due_s = self.now_s
        self._align_imu()

    def start_imu_stream(self, period_ms: int) -> None:
        """Starts the stream of the IMU; its first frame has a reading of its own."""
        self.imu_stream, self._imu_ahead = ImuStream(period_ms / 1000.0, self.now_s), False
        self._align_imu()

    def _align_imu(self) -> None:
        if self.imu_stream and self.stream and self.stream.period_s:
            self.imu_stream.align(self._stream_due_s, self.now_s)

    def stop_stream(self, code: int) -> None:
        """Ends the stream that `code` started."""
        if self.stream and self.stream.code == code:
            self.stream = None

    def ask_for_checks(self, on: bool) -> None:
        """The host turns the checksum on or off; moves need one until it is turned off."""
        self._decoder.asked = on
        self.health.stops_are_final = self.health.stops_are_final and on
        self.set_check(on)

    def set_check(self, on: bool) -> None:
        """Turns the checksum on or off in both directions."""
        self._decoder.checked = on

    def refuse(self, reason: str) -> None:
        """Counts a refusal, and reports it in debug mode."""
        self.health.count(reason)
        self._say("[ERROR] " + reason)

    @property
    def capabilities(self) -> List[str]:
        """Names in `table.CAPABILITIES` of what the board can do."""
        names = ["check", "watchdog", "period", "config", "baud", *self.motors.capabilities]
        names.append("environment" if self.environment else "sonars")
        if self.imu.found:
            names.append("imu")
        if self.radio:
            names += ["xbee", "hold"]
        return names

    def require_motors(self) -> bool:
        """Whether the motors can be commanded now; counts a refusal if not."""
        there = self.motors.there(self.now_s)
        if not there:
            self.refuse("unavailable")
        return there

    def refuses_move(self) -> bool:
        """Whether other robots hold this one; counts the refusal of a move that the motors could carry out."""
        held = bool(self.radio and self.radio.hold.held and self.motors.there(self.now_s))
        if held:
            self.refuse("held")
        return held

    def stop_motors(self, reason: StopReason) -> None:
        """Stops the motors at once."""
        self.motors.stop(self.now_s, reason)

    def adc(self, channel: int) -> int:
        """ADC count of A0 to A3."""
        return min(1023, int(self.plant.adc_volts(channel, self.now_s) / VOLTS_PER_COUNT))
