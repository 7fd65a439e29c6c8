"""From an open port to a streaming board: one request after the other, each repeated until the board answers.

This module does no I/O: frames and time go in, requests come out.  The robot stays still: the first request is a stop.

No single damaged byte of a request may turn motors.  The first requests are therefore `read_protocol`, which boards of
2013 do not know, and `robot_info` in a form that only they understand (`table.WRAP`).  The answer shows which kind of
board it is; until then, other boards than those of 2013 get no stop.

A damaged frame without a checksum may look like a good one.  A board that supports checksums is therefore asked twice
for its identity and capabilities: the second time after the checksum is on, before anything else is set.  If a board
has no checksums, `ALIKE` equal answers in a row are required.  An answer that refuses the board ends the session:
without a checksum it must come `ALIKE_TO_REFUSE` times in a row.
"""

import math
from typing import Callable, Dict, FrozenSet, Iterator, List, NamedTuple, Optional, Tuple

from mrl_driver.errors import BoardError, BoardTimeout, MrlError, NotARobot, WrongRobot
from mrl_driver.protocol import REQUESTS, Frame, FrameDecoder
from mrl_driver.protocol.table import BY_NAME, CAPABILITIES, FAULTS, PROTOCOL_VERSION

from .sensor_polling import SENSOR_STREAM

RETRY_S = 0.25
# Time for the first answer [s].  A 2013 board with its bootloader needs up to 5.4 s; row 16 of the fault table allows 8
# s.
TIMEOUT_S = 8.0
# A board that has identified itself and is then silent for this time is greeted again from the start [s].  It may have
# restarted, or turned checksums off, while this program was not running.
STEP_TIMEOUT_S = 2.0
MOST_ATTEMPTS = int(STEP_TIMEOUT_S / RETRY_S)
# After this many `robot_info` replies without a frame of `SENSOR_STREAM`, start the usual stream instead: a 2013 board
# may not know the other one.
DEAF = 6
ALIKE, ALIKE_TO_REFUSE = 3, 5
"""Number of equal answers in a row required to accept, or to refuse, a board that answers without a checksum."""
NEAR_V, NEAR_DEGC = 0.5, 5.0
"""Battery and temperature readings count as equal if they differ by less than this [V, degC]."""
JUNK_S = 4.0
JUNK_BYTES = 32
"""This many bytes that are not text, and no frame within `JUNK_S` of the first byte [s], mean another baud rate.
A board of August 2013 is silent for 3.35 s after its bootloader."""
# This many of this program's own requests come back only if something echoes them.  Lines of a debug text, which begin
# with '[', quote requests.
ECHOES = 3
SAID_BYTES = 2048  # an echo is searched in this many of the first bytes
_FAULT = {name: bit for bit, (name, _) in enumerate(FAULTS)}
_TEXT = bytes(range(0x20, 0x7F)) + b"\r\n\t"
_CODE = {name: row.code for name, row in BY_NAME.items()}
_ANSWERS: Dict[int, Tuple[int, ...]] = {
    row.code: (row.code,) for row in BY_NAME.values() if row.reply and not row.repeats
}
"""Codes of the frames that answer a request."""
for _name in ("start_omni_stream", SENSOR_STREAM):
    _ANSWERS[_CODE[_name]] = (_CODE[_name],)
WHEEL_STREAM = "start_wheel_stream"
_ANSWERS[_CODE[WHEEL_STREAM]] = (_CODE["read_wheels"],)
_ANSWERS[_CODE["start_stream"]] = (_CODE["read_encoders_and_sonars"], _CODE["read_encoders"])
_WHEELS = {"start_omni_stream": ("omni", "three"), WHEEL_STREAM: ("wiring", "four")}
"""Capability of a board with such a stream, and its number of wheels."""


class Board(NamedTuple):
    """Board identity, battery voltage and temperature; a value that the board does not measure is NaN.

    A board that does not report its protocol counts as protocol 1; 2013 boards (firmware version 1) are of this kind.
    Such a board has no capabilities, except `environment` if its telemetry is `SENSOR_STREAM`.
    """

    robot_id: int
    version: int
    motor_board_version: float
    battery_v: float
    temperature_c: float
    protocol: int = 1
    capabilities: FrozenSet[str] = frozenset()

    @property
    def virtual(self) -> bool:
        """The board has no robot: it calculates one."""
        return "virtual" in self.capabilities


class Plan(NamedTuple):
    """Settings for a board that supports them."""

    watchdog_ms: int = 250
    # Period of the stream [ms].  At most 50, so that two frames are sent within the 100 ms after which telemetry is
    # late; longer only on a slow serial link.
    period_ms: int = 20
    check: bool = True
    gap_s: float = 0.0  # minimum time between two commands on a slow serial link [s]
    imu_period_ms: int = 20  # period of the IMU's stream [ms]; 0 turns it off
    stream: bool = True
    """Start the stream.  Without it there is no telemetry, and the board's silence goes unnoticed."""


DEFAULT_PLAN = Plan()


def board_of(args: Tuple[int, ...]) -> Board:
    """Return the fields of a `robot_info` reply, in SI units and degrees Celsius."""
    temperature, motor_board, battery, version, robot_id = args
    return Board(robot_id, version, motor_board / 100, battery / 100, temperature / 100)


def capabilities_of(bits: int) -> FrozenSet[str]:
    """Return the names of the capabilities in a `read_protocol` reply."""
    return frozenset(name for i, (name, _) in enumerate(CAPABILITIES) if bits >> i & 1)


def with_measured(board: Board, capabilities: FrozenSet[str]) -> Board:
    """Return the board with NaN in place of each value that a board with these capabilities does not measure.

    On the wire these values are 0.
    """
    return board._replace(
        battery_v=math.nan if "no_battery" in capabilities else board.battery_v,
        temperature_c=math.nan if "no_temperature" in capabilities else board.temperature_c,
    )


def are_alike(one: Board, other: Board) -> bool:
    """Return whether both answers can come from the same board within a short time."""
    return (
        one[:3] == other[:3]
        and abs(one.battery_v - other.battery_v) < NEAR_V
        and abs(one.temperature_c - other.temperature_c) < NEAR_DEGC
    )


class Handshake:
    """Greets a board.  `board` is set after the board has identified itself, `done` after its stream has started.

    Args:
        plan: settings for the board.
        send: `send(code, *args, checked, wrapped)` sends a request with a checksum, or as to a board of 2013; None: as
            for the last board.
        admit: `admit(board)` may raise to refuse a board before anything is set.  It returns the table row of the
            stream to start, or None for the usual one.  It is called again after the board has reported its
            capabilities, and after the board has identified itself with a checksum.
        now: time of the start [s].
        patient: never give up; used after a board's restart.
        timeout_s: time for the first answer [s].
    """

    def __init__(
        self,
        plan: Plan,
        send: Callable[..., None],
        admit: Callable[[Board], Optional[str]],
        now: float,
        patient: bool = False,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        self._plan, self._send, self._admit, self._patient = plan, send, admit, patient
        self._give_up_s = now + timeout_s
        self.due_s = now  # time of the next `tick` [s]
        self.board: Optional[Board] = None
        self.done = False
        self.stream = "start_stream"  # row of the stream that the robot model needs
        self.of_2013: Optional[bool] = None
        """The board is one of 2013, or has no `read_protocol` either; None before it has answered."""
        self._steps: Iterator[Tuple[int, ...]]  # the requests that follow
        self._step: Tuple[int, ...] = (_CODE["read_protocol"],)
        self._attempts = 0
        self._answered = False
        """The last request was answered: the board takes its form, with or without a checksum."""
        self._silent: Optional[Board] = None
        self._deaf = self._alike = 0
        self._info: Optional[Board] = None
        self._protocol: Tuple[int, ...] = ()  # the last answers, accepted or not
        self._sure = False  # the board identified itself in a frame with a checksum
        self._junk: List[float] = []
        self._said, self._strange, self._faults = b"", 0, 0

    def heard(self, data: bytes, now: float) -> None:
        """Count bytes that may not belong to frames."""
        if self.board is None and data:
            self._junk = self._junk or [now]
            self._strange += len(data.translate(None, _TEXT))
            self._said = (self._said + data)[:SAID_BYTES]

    def tick(self, now: float, checked: bool) -> None:
        """Send what is due.

        Raises:
            NotARobot: nothing answers, or the answer is not made of frames.
            BoardError: the motor board, or the thermopile in the stream of sensors, does not answer its Arduino.
            BoardTimeout: the board stopped answering.
        """
        if now < self.due_s:
            return
        if now - self.due_s > RETRY_S:
            self._give_up_s += now - self.due_s  # this program did not run during that time
        if not self._patient:
            self._judge(now)
        if self.board is not None and now >= self._give_up_s:
            self._silent, self.board, self._sure = self.board, None, False
            self._forget()
            self._ask(self._step, now)
        if self.board is None:
            self._ask_who(checked)
        elif self._step[0] == _CODE[SENSOR_STREAM] and self._attempts and not self._sure:
            self._say(_CODE["robot_info"], checked=checked)
        self._say(*self._step, checked=checked)
        self._attempts += 1
        self._answered = False
        self.due_s = now + RETRY_S

    def _ask_who(self, checked: bool) -> None:
        """Send what belongs to the first questions, which nothing may have heard yet."""
        if self.of_2013 is not None and self._attempts >= MOST_ATTEMPTS:
            self._forget()
        self._say(_CODE["stop"])
        if self._junk:  # a frame after text on the same line is not decoded
            self._say(_CODE["set_debug"], 0, checked=False)
        if self.of_2013 is None:
            self._send(_CODE["robot_info"], wrapped=True)
        if self._patient or self._silent or (self._attempts % 3 == 2 and not self._answered):
            self._say(*self._step, checked=not checked)

    def _say(self, code: int, *args: int, checked: Optional[bool] = None) -> None:
        """Send a request in the form that the board understands; `read_protocol` is the question which one that is."""
        self._send(code, *args, checked=checked, wrapped=code != _CODE["read_protocol"] and self.of_2013)

    def _forget(self) -> None:
        """Begin with the first question; another board may answer."""
        self.of_2013, self._step, self._attempts, self._alike = None, (_CODE["read_protocol"],), 0, 0

    def _ask(self, step: Tuple[int, ...], now: float) -> None:
        """Set the next request and reset the counts of attempts and answers."""
        self._step, self._attempts, self._alike = step, 0, 0
        self._give_up_s, self.due_s = now + STEP_TIMEOUT_S, now

    def hurry(self, now: float) -> None:
        """Ask again at once: an answer arrived, but more equal answers are needed."""
        self._answered = True
        self.due_s = min(self.due_s, now)

    def _judge(self, now: float) -> None:
        board = self.board or self._silent
        if board is not None:
            if now >= self._give_up_s and (self._silent or self._silencer()):
                raise self._mute(board)
        elif _requests_in(self._said) >= ECHOES:
            raise NotARobot(
                f"the bytes that were sent come back ({self._said[:24]!r}): a login prompt, or an adapter that echoes, "
                "is on this port, or TX is connected to RX; end that, or check the wires"
            )
        elif self._junk and self._strange >= JUNK_BYTES and now >= self._junk[0] + JUNK_S:
            raise NotARobot(
                f"this port sends text at another baud rate, or another device is on it (got "
                f"{self._said[:24]!r}, expected '@29,...e'): check baud"
            )
        elif now >= self._give_up_s:
            raise NotARobot(self._nothing())

    def _mute(self, board: Board) -> BoardError:
        silencer = self._silencer()
        if silencer:
            return BoardError(
                f"the {silencer} of robot {board.robot_id} does not answer its Arduino: check its power "
                "and the I2C wires"
            )
        if self._alike:
            return BoardTimeout(f"the board (robot id {board.robot_id}) {self._differing()}")
        hint = ""
        if self.stream == SENSOR_STREAM and board.version < 2:
            hint = (
                ": a 2013 board hangs if its thermopile does not answer, so check its wires, or if the board has "
                "sonars choose build sonar"
            )
        return BoardTimeout(
            f"the board (robot id {board.robot_id}) does not answer request {self._question} any more{hint}; "
            "reset it and try again"
        )

    def _silencer(self) -> str:
        """Return what keeps the stream from starting by the faults in the board's status; empty if nothing does."""
        fault, name = (
            ("sensor", "thermopile") if self.stream == SENSOR_STREAM else ("motor_board", "motor board")
        )
        return name if self._faults >> _FAULT[fault] & 1 else ""

    @property
    def _question(self) -> int:
        """Code of the request that has no answer; boards of 2013 answer the first question in their own form."""
        return _CODE["robot_info"] if self._alike and self.of_2013 is None else self._step[0]

    def _differing(self) -> str:
        return (
            f"answers request {self._question} differently each time, expected the same answer {ALIKE_TO_REFUSE} times "
            "in a row: the line damages what is sent; use a shorter or better cable, away from the motor wires"
        )

    def _nothing(self) -> str:
        if self._alike:
            return f"the device on this port {self._differing()}"
        if self._junk:
            return (
                f"no answer to '@29e', but other bytes ({self._said[:24]!r}): another device or firmware, or check "
                "baud; flash the board with: mrl flash --port PORT"
            )
        return "no answer to '@29e': check that the board is powered, that this is its port, and that it is flashed"

    def on_frame(self, frame: Frame, now: float, checked: bool) -> None:
        """Process a frame; `checked` says that it had a checksum.

        Raises:
            WrongRobot: the board is not one for this driver; `admit` may raise it as well.
        """
        if self._sure and not checked:
            return
        code = frame.code
        if code == _CODE["robot_info"]:
            self._on_info(board_of(frame.args), now, checked)
        elif code == _CODE["read_protocol"] and self.of_2013 is None:
            self.of_2013 = False  # the board knows `read_protocol`: ask for its identity, in the same time
            self._step, self._attempts, self._alike, self.due_s = (_CODE["robot_info"],), 0, 0, now
        elif code == self._step[0] == _CODE["read_protocol"]:
            self._on_protocol(frame.args, now, checked)
        elif code in _ANSWERS.get(self._step[0], ()):
            assert self.board is not None
            if code == _CODE["read_board"]:
                self._require_motors(frame.args[1])
            if code == _CODE["read_status"]:
                self._faults = frame.args[4]
            elif code == _CODE[SENSOR_STREAM] and self.board.protocol < 2:
                self.board = self.board._replace(capabilities=frozenset({"environment"}))
            self._next(now)

    def _on_info(self, board: Board, now: float, checked: bool) -> None:
        if self._step[0] == _CODE[SENSOR_STREAM] and not checked:
            self._deaf = min(self._deaf + 1, self._attempts)  # replies to requests of before may still arrive
            if self._deaf >= DEAF:
                self._steps = iter([(_CODE["start_stream"],)])
                self._next(now)
        asked = self._step[0] == _CODE["robot_info"] or self.of_2013 is None
        if not asked or (self.board is not None and not checked):
            return
        self._alike = self._alike + 1 if self._info is not None and are_alike(board, self._info) else 1
        self._info = board
        if not checked and self._alike < ALIKE:
            self.hurry(now)
            return
        try:
            stream = self._admit(board)
        except MrlError:
            if checked or self._alike >= ALIKE_TO_REFUSE:
                raise
            self.hurry(now)
            return
        again, self._sure = self.board is not None, checked
        self.stream = stream or "start_stream"
        self.board = board
        if self.of_2013 is None:
            self.of_2013 = not checked
        if not again:
            self._steps, self._deaf = self._program(), 0
        self._next(now)

    def _on_protocol(self, args: Tuple[int, ...], now: float, checked: bool) -> None:
        self._alike = self._alike + 1 if args == self._protocol else 1
        self._protocol = args
        protocol, bits = args
        known, capabilities = protocol == PROTOCOL_VERSION, capabilities_of(bits)
        asked_again = known and self._plan.check and "check" in capabilities  # with a checksum
        if not checked and self._alike < (ALIKE if known else ALIKE_TO_REFUSE) and not asked_again:
            self.hurry(now)
            return
        if not known:
            raise WrongRobot(
                f"the board speaks protocol {protocol}, this driver {PROTOCOL_VERSION}: update the older "
                "one (the board with: mrl flash --port PORT)"
            )
        assert self.board is not None
        self.board = with_measured(self.board, capabilities)._replace(
            protocol=protocol, capabilities=capabilities
        )
        if checked or self._alike >= ALIKE:
            self.stream = self._admit(self.board) or "start_stream"
        self._next(now)

    def _next(self, now: float) -> None:
        """Go to the next request that gets an answer; send those before it that get none."""
        for step in self._steps:
            if step[0] in _ANSWERS:
                self._ask(step, now)
                return
            self._say(*step)
        self.done = True

    def _program(self) -> Iterator[Tuple[int, ...]]:
        """The requests after `robot_info`; later ones may depend on the answers to earlier ones.

        Raises:
            WrongRobot: the firmware is newer than this driver, or the board lacks the stream of the robot model.
        """
        assert self.board is not None
        yield (_CODE["stop_stream"],)
        if self.of_2013:
            if self.board.version > PROTOCOL_VERSION:
                raise WrongRobot(
                    f"the board has firmware {self.board.version} and does not tell its protocol, this driver knows "
                    f"firmware up to {PROTOCOL_VERSION}: flash it with: mrl flash --port PORT, or update the driver"
                )
            yield from self._plain_program()
            return
        yield (_CODE["read_protocol"],)
        if "check" in self.board.capabilities:  # also makes each pulse a count again
            # After 0, moves need no checksum any more.
            yield (_CODE["set_check"], int(self._plan.check or self._sure))
            if self._plan.check and not self._sure:
                yield (_CODE["robot_info"],)
                yield (_CODE["read_protocol"],)
        if self._plan.stream:
            self._require_stream()
        if "watchdog" in self.board.capabilities:
            yield (_CODE["set_watchdog"], self._plan.watchdog_ms)
        if self.stream == WHEEL_STREAM:
            yield (_CODE["read_board"],)
        yield (_CODE["read_status"],)
        if self._plan.stream:
            yield (_CODE[self.stream], self._plan.period_ms)

    def _plain_program(self) -> Iterator[Tuple[int, ...]]:
        if not self._plan.stream:
            return
        self._require_stream()
        if self.stream == SENSOR_STREAM:  # on 2013 boards the streams of 23 and 27 come before it
            yield (_CODE["stop_sensor_stream"],)
            yield (_CODE["stop_compass_stream"],)
        yield (_CODE[self.stream],)

    def _require_motors(self, motors: int) -> None:
        """Raise WrongRobot if the board drives two of the four wheels; without a sound wiring it drives none."""
        if motors == 2:
            raise WrongRobot(
                "the wiring of the board has 2 motors, expected the 4 of this robot model: write its pins with: "
                "mrl flash --port PORT, or choose another model"
            )

    def _require_stream(self) -> None:
        """Raise WrongRobot unless the board has the stream that the robot model needs."""
        assert self.board is not None
        capability, wheels = _WHEELS.get(self.stream, ("", ""))
        if capability and capability not in self.board.capabilities:
            raise WrongRobot(
                f"the firmware of the board does not know {wheels} wheels (no request {_CODE[self.stream]}), which "
                "this robot model needs: flash it with: mrl flash --port PORT, or choose another model"
            )
        if self.stream == SENSOR_STREAM and "sonars" in self.board.capabilities:
            raise WrongRobot(
                "the firmware of the board has the build sonar, this robot model needs its environment sensors: "
                "flash it with: mrl flash --build environment --port PORT, or choose another model"
            )


def _requests_in(data: bytes) -> int:
    """Return how many of this program's own requests came back."""
    lines = (line for line in data.split(b"\n") if not line.startswith(b"["))
    return sum(type(event) is Frame for event in FrameDecoder(REQUESTS).feed(b"\n".join(lines)))
