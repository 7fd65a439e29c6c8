"""The session with a board, without I/O: bytes and time go in, events and bytes come out.

It greets the board, starts its stream, feeds its watchdog, and repeats commands and stops.  It greets the board again
after a restart.  All times are seconds of one monotonic clock, which the caller reads.
"""

import math
from functools import lru_cache
from typing import Callable, List, Optional, Tuple

from mrl_driver.errors import BoardTimeout, HostBusy
from mrl_driver.problems import PROBLEMS
from mrl_driver.protocol import REPLIES, Event, Frame, FrameDecoder, Garbage, encode_request
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_NAME, COMMANDS

from .events import (
    Counts,
    Info,
    OwnStop,
    Ranges,
    Ready,
    Reply,
    SensorRead,
    SessionEvent,
    Sonars,
    Stale,
    Status,
    imu_reading,
    status_of,
)
from .handshake import DEFAULT_PLAN, Board, Handshake, Plan, board_of
from .link_counters import Counters
from .motion_command import QUICK, SLOW, SLOWEST, STOP, Motion, Speeds
from .polling import BUSY_S, IMU_S, INFO, INPUTS, RANGES, SONARS, STATUS, STOP_IMU, Poll
from .sensor_polling import SENSOR_STREAM
from .sequence import Stream

LATE_S = 0.1  # if telemetry is older than this, no motion commands are sent [s]; see `Session._stop_blind`
# If telemetry is older than this, the session reports `Stale` (so the caller knows within 300 ms), drops the command
# and greets the board again [s].
STALE_S = 0.28
ATTENTION_S = 0.1
PAUSE_S = 0.25
"""With a command in force, `tick` is due at least every `ATTENTION_S`.  If this program itself paused for longer than
`PAUSE_S` (stopped process, suspended machine), the command is stale and the board's watchdog has stopped the robot [s].
"""
# With a command in force, a program that is not run for `LATE_HOST_S` may let the board's watchdog stop the robot. For
# `BLAMED_S` after that, a stop for lack of data or commands counts as `host_paused` [s].
LATE_HOST_S, BLAMED_S = 0.15, 1.0
LATE_GREETING_S = 0.5
"""In a greeting this program is due every 0.25 s; if it was late by as much again, a board without an answer is excused
[s]."""
# If a board was up for at least `BOOTED_S` and its start time is the same as before the link was lost, to within
# `SAME_BOOT_S`, it has not restarted and its counters are still valid [s].  Uptimes are whole seconds.
SAME_BOOT_S, BOOTED_S = 1.5, 3
NOT_BY_ITSELF = (StopReason.NONE, StopReason.HOST)
"""Reasons in a status with which the board has not stopped the motors by itself."""
REFUSED_S, MOST_REFUSED_S = 0.15, 0.5
"""If the board names a stop of its own this long after a command to move, it refuses this command [s].  A status that
was in transit before the command arrives within this time, or within two round trips up to `MOST_REFUSED_S` [s]."""
STOPPING_S = 1.0  # the robot stands still within this time after a stop, or after the watchdog's period [s]
PLAIN_FRAMES = 3
"""This many frames in a row without a checksum mean that the board restarted; fewer may be damaged frames."""

_COUNTS, _BOTH, _OMNI, _WHEELS, _SENSING = (
    BY_NAME[n].code
    for n in ("read_encoders", "read_encoders_and_sonars", "start_omni_stream", "read_wheels", SENSOR_STREAM)
)
STREAMS = (_BOTH, _COUNTS, _OMNI, _WHEELS, _SENSING)
_CHECK, _IMU, _PROTOCOL = (BY_NAME[n].code for n in ("set_check", "read_imu", "read_protocol"))

_encode = lru_cache(maxsize=32)(encode_request)
"""Cached, because polls, repeats and stops are often the same bytes."""
TURNING = {row.code for row in COMMANDS if row.turns}  # requests that turn motors


class Session:
    """State of one board on one link.

    `admit(board)` may raise to refuse a board (wrong robot, dead battery) before anything is set on it.  It returns the
    table row of the stream to start, or None for the usual one.
    """

    reads_imu = True  # start the stream of the board's IMU, if it has one
    queued_s = 0.0  # commands to move are refused for this time after a pause, see `Options.queued_s` [s]
    board: Optional[Board] = None
    status: Optional[Status] = None
    last_frame: Optional[Frame] = None  # frame of the last telemetry; None before the first
    _last: Optional[Tuple[int, ...]] = None  # its counters

    def __init__(
        self,
        admit: Callable[[Board], Optional[str]],
        now: float,
        plan: Plan = DEFAULT_PLAN,
        command_timeout_s: Optional[float] = None,
        greeting_s: float = 8.0,
    ) -> None:
        self._admit, self._plan = admit, plan
        self._decoder, self._other = FrameDecoder(REPLIES), 0
        self.out = bytearray()  # bytes to send; see `take`
        self.counters = Counters()
        self.motion = Motion(timeout_s=command_timeout_s)
        self._stream = Stream(self.counters)
        self._greeting_s = greeting_s
        self._telemetry_by_s = math.inf  # latest time of the first telemetry [s]
        self.stream_code = _BOTH  # code of the stream's frames; other counters are replies to requests
        self.heard_s = self._status_heard_s = -math.inf  # arrival of the last telemetry and status [s]
        self._wrapped = True  # until the board is known, requests have the form for 2013: `table.WRAP`
        self._greeting: Optional[Handshake] = Handshake(plan, self._send, admit, now, timeout_s=greeting_s)
        self._restarted, self._lost_before = True, 0  # frames lost before the greeting
        # Start time of the board [s], from its last status, and from the last one before the greeting.
        self._boot_s = self._boot_before_s = math.nan
        # Work that is due before the next frame is done with the current one, which saves a wake-up [s].
        self.lead_s = self.motion.lead_s = plan.period_ms / 1000
        self._poll = Poll(self._send, self.counters, self.lead_s)
        self.sensors = self._poll.sensors
        # When this program last attended to the board, when it last went on after a pause, and was late [s].
        self._attended_s, self.resumed_s, self._busy_s, self._late_greeting = now, -math.inf, -math.inf, False
        self._pause_s = max(PAUSE_S, 2 * plan.period_ms / 1000)  # also without a command in force [s]
        # Times of the first and of the last request that turns motors since the last stop or command [s].
        self._requested_s = self._asked_s = math.inf
        # When the wheels turned last without a command, and when the last stop was sent for that [s].
        self._turned_s = self._stopped_again_s = -math.inf
        self.hurried = True  # work, but that of `motion`, may be due earlier than `deadline` said last

    def poll_ranges(self, now: float) -> None:
        """Request the HC-SR04 of a board that has just become ready, until it is greeted again."""
        self._poll.add_ranges(now)
        self.hurried = True

    @property
    def ready(self) -> bool:
        """The greeting is complete, and telemetry is not stale."""
        return self._greeting is None

    @property
    def turning(self) -> bool:
        """A request turns motors, or did a short time ago."""
        return self._requested_s < math.inf

    @property
    def may_be_moving(self) -> bool:
        """The board was cut off while the robot moved, and has no watchdog to stop it."""
        return not self.ready and self.motion.unconfirmed and not self._watched

    @property
    def _watched(self) -> bool:
        """The board has a watchdog, and it is on."""
        board = self.board
        return board is not None and "watchdog" in board.capabilities and self._plan.watchdog_ms > 0

    def round_trip_s(self, now: float) -> float:
        """Time from a request to its answer, measured once a second (every 2 s on boards of 2013); NaN before [s]."""
        return self._poll.round_trip.delay_s(now) if self.ready else math.nan

    @property
    def checked(self) -> bool:
        """Frames carry a checksum."""
        return self._decoder.checked

    @property
    def pending(self) -> bytes:
        """Bytes from the board whose frame is not complete yet."""
        return self._decoder.pending

    def take(self) -> bytes:
        """Return the bytes to send now, and forget them."""
        if not self.out:
            return b""
        data = bytes(self.out)
        self.out.clear()
        self.counters.bytes_out += len(data)
        return data

    def drive(self, speeds: Speeds, now: float, moves: Optional[bool] = None) -> bool:
        """Put a command in force; for `moves` see `Motion`.

        While telemetry is late, the command is held back; while the board is silent or being greeted, it is dropped.

        Returns:
            The command is sent, at the latest when the pace allows it.
        """
        if self._greeting is not None:
            return False
        if now - self._attended_s > self._pause_s:
            self._resume(now)
        self._attended_s = now
        if now - self.resumed_s < self.queued_s and (any(speeds) if moves is None else moves):
            return False
        late = now - self.heard_s >= LATE_S
        if late and not (any(speeds) or moves):
            self.stop(now)  # a command would not be sent now
            return True
        motion, self._requested_s = self.motion, math.inf
        motion.drive(speeds, now, moves)
        if late:
            self._move(now)
            return motion.target == motion.sent is not None
        request = motion.take(now)
        if request is not None:
            self._send(*request)
        return True

    def adjust(self, speeds: Speeds, now: float) -> None:
        """Change the speeds of the command in force; see `Motion.adjust`."""
        self.motion.adjust(speeds)
        self._move(now)

    def stop(self, now: float, reason: StopReason = StopReason.USER) -> None:
        """Stop at once, and repeat the stop until telemetry confirms it."""
        self.motion.stop(reason)
        self._requested_s = math.inf
        self._move(now)

    def expire(self, now: float) -> None:
        """Stop the robot if it must not drive on, else repeat the command, before something feeds the board's watchdog.

        The reading thread may hang in a callback meanwhile.
        """
        self._move(now, feeds=True)

    def lose(self, now: float) -> None:
        """The link is gone: drop the command and the bytes not yet sent."""
        self._telemetry_by_s = math.inf
        self._greet_again(now, StopReason.LINK_LOST)
        self.out.clear()

    def relink(self, now: float, same: bool = True) -> None:
        """There is a link again: greet the board from the start, without a time limit.

        `same` says that it is the same board as before; then it may not have restarted.
        """
        self._decoder = FrameDecoder(REPLIES, self.checked)
        self.lose(now)
        self._restarted = not (self.checked and same)
        if not same:
            self._boot_before_s, self._wrapped = math.nan, True

    def join(
        self, board: Board, stream_code: int, checked: bool, now: float, last: Optional[Frame] = None
    ) -> List[SessionEvent]:
        """Go on with a board that was greeted and streams already; for recordings that begin after the greeting.

        `last` is the frame of the last telemetry, which was made at `now`.

        Raises:
            BoardError: as for `admit`.
        """
        self._decoder.checked, self.stream_code, self._wrapped = checked, stream_code, board.protocol < 2
        greeting = self._greeting = Handshake(self._plan, self._send, self._admit, now)
        greeting.board, greeting.stream = board, self._admit(board) or greeting.stream
        events: List[SessionEvent] = []
        self._begin(now, events)
        if last is not None:
            self._on_counts(last, now, events)
        return events

    def end(self) -> None:
        """End the session: stop the stream and turn checksums off, as a 2013 host expects."""
        self.motion.forget(StopReason.CLOSED)
        self._send(BY_NAME["stop_stream"].code)
        if self.stream_code == _SENSING:
            self._send(BY_NAME["stop_sensor_ldr_stream"].code)
        if self.stream_code == _WHEELS:
            self._send(BY_NAME["stop_wheel_stream"].code)
        if self.board is not None and "imu" in self.board.capabilities:
            self._send(STOP_IMU)
        if self.checked or (self.board is not None and "check" in self.board.capabilities):
            self._send(_CHECK, 0)

    def request(self, code: int, *args: int) -> None:
        """Send a request; its answer arrives as a `Reply` or as an event of its own.

        Raises:
            FrameError: the command table does not allow the request.
        """
        self._send(code, *args)
        if code in TURNING:
            self._poll.hurry()
            self._requested_s, self._asked_s = min(self._requested_s, self._attended_s), self._attended_s
            self.hurried = True

    def require_answers(self, now: float) -> None:
        """Raise BoardTimeout if the board is silent or being greeted."""
        if not self.ready or self._silent(now):
            raise BoardTimeout(
                "the board is silent or being greeted, nothing was sent; try again when it is ready"
            )

    def identify(self) -> None:
        """Ask a ready board again for its identity, for a recording that begins now."""
        if self.ready and self.board is not None:
            self._poll.ask_info()
            if self.board.protocol >= 2:
                self._send(_PROTOCOL)
            self.hurried = True

    def receive(self, data: bytes, now: float) -> List[SessionEvent]:
        """Decode the bytes that arrived at `now`, and return their events.

        Raises:
            BoardError: the board is not the right one, or has a fault.
        """
        if now - self._attended_s > LATE_HOST_S:
            self._resume(now)
        self._attended_s = now
        counters = self.counters
        counters.bytes_in += len(data)
        events: List[SessionEvent] = []
        strange, checked = False, self._decoder.checked
        for event in self._decoder.feed(data):
            frame = event if type(event) is Frame else self._reread(event, now)
            if frame is not event:
                checked = self._decoder.checked
            if frame is None:
                strange = True
                continue
            self._other = 0
            counters.frames += 1
            code = frame.code
            if code in STREAMS:
                self._on_counts(frame, now, events)
                if self._greeting is None:
                    continue
            elif code == _IMU and self._poll.imu_s < math.inf:
                self._on_imu(frame, now, events)
                continue
            self._on_frame(frame, now, checked, events)
        if self._greeting is not None:
            self.hurried = True
            if strange or b"@" not in data:
                self._greeting.heard(data, now)
        return events

    def tick(self, now: float) -> List[SessionEvent]:
        """Do what is due; call it at `deadline()` and after `receive`.

        Raises:
            NotARobot: nothing answers the greeting, or the answer is not made of frames.
            BoardTimeout: the board stopped answering during the greeting, or sends no telemetry after it.
        """
        if now - self._attended_s > LATE_HOST_S:
            self._resume(now)
        self._attended_s = now
        events: List[SessionEvent] = []
        if self._last is None and self.board is not None and now >= self._telemetry_by_s:
            raise self._excused(
                BoardTimeout(
                    f"the board (robot id {self.board.robot_id}) has answered, but no telemetry follows, expected a "
                    f"frame every {self._plan.period_ms} ms; reset it and try again"
                )
            )
        if self._greeting is not None:
            try:
                self._greeting.tick(now, self.checked)
            except BoardTimeout as error:
                raise self._excused(error) from None
        elif now - self.heard_s >= STALE_S:
            self._greet_again(now, self._cause(StopReason.NO_TELEMETRY, now))
            events.append(Stale(now - self.heard_s, self.may_be_moving))
            self._restarted = not self.checked
        elif now - self.heard_s < LATE_S:
            self._poll.take(now, self.motion.pace.repeat_s)
        self._move(now)
        return events

    def deadline(self, now: float) -> float:
        """Latest time of the next `tick` if no bytes arrive before [s]."""
        self.hurried, motion = False, self.motion
        if self._greeting is not None:
            return min(self._greeting.due_s, motion.due_s) if motion.stopping else self._greeting.due_s
        due_s = self.heard_s + STALE_S
        if motion.target is not None or self.turning:
            due_s = min(due_s, self._attended_s + ATTENTION_S)
        late = now - self.heard_s >= LATE_S
        if motion.stopping or (motion.target is not None and not late):
            due_s = min(due_s, motion.due_s)
        return due_s if late else min(due_s, self._poll.due_s)

    def _resume(self, now: float) -> None:
        """This program was late; after a pause, stop the robot if a command was in force or a request turned motors."""
        late_s = now - self._attended_s
        if late_s > self._pause_s:
            self.resumed_s = now
        self._late_greeting |= self._last is None and late_s > LATE_GREETING_S
        if self.motion.target is not None or self.turning:
            self._busy_s = now
            if late_s > PAUSE_S:
                self._requested_s = math.inf
                self.motion.stop(StopReason.HOST_PAUSED)

    def _excused(self, error: BoardTimeout) -> BoardTimeout:
        """Return the error of a greeting without an answer: if this program was late, the board is not blamed."""
        problem = PROBLEMS["late_host"]
        text = f"{problem.message}, and the board did not answer in time; {problem.remedy}"
        return HostBusy(text) if self._late_greeting else error

    def _cause(self, reason: StopReason, now: float) -> StopReason:
        """Return the reason of a stop for lack of data or commands: `host_paused` if this program was just late."""
        return StopReason.HOST_PAUSED if now - self._busy_s < BLAMED_S else reason

    # -- out

    def _send(
        self, code: int, *args: int, checked: Optional[bool] = None, wrapped: Optional[bool] = None
    ) -> None:
        """Queue a request.  A stop never has a checksum, because the board accepts a plain stop in every state."""
        checked = self._decoder.checked if checked is None else checked
        wrapped = self._wrapped if wrapped is None else wrapped
        self.out += _encode(code, *args, checked=checked and code != STOP, wrapped=wrapped)

    def _move(self, now: float, feeds: bool = False) -> None:
        """Send the command or stop that is due.  `feeds` says that something is sent next that feeds the watchdog: the
        command or stop goes before it, because the last one may be lost.
        """
        late = now - self.heard_s >= LATE_S
        if late and self.motion.target is not None:
            self._stop_blind(now, feeds)
        if feeds and self._watched:
            self.motion.repeat(now)
        if self._requested_s < math.inf:
            self._end_requested(now)
        request = self.motion.take(now, self.ready and not late)
        if request is not None:
            self._send(*request)

    def _stop_blind(self, now: float, feeds: bool) -> None:
        """Telemetry is late: stop the robot if it is stale, if its watchdog is fed, or if the command in force is held
        back and is zero, or there is no watchdog.

        A command that was sent may be lost, and telemetry does not show it; so a feed needs a stop in any case.
        """
        motion, watched = self.motion, self._watched
        goes_on = not watched or not any(motion.target or ())
        if self._silent(now) or (feeds and watched) or (motion.held_back and goes_on):
            motion.stop(self._cause(StopReason.NO_TELEMETRY, now) if motion.wanted else StopReason.USER)

    def _end_requested(self, now: float) -> None:
        """Stop what a request turns, if telemetry is stale or the last such request is long ago.

        The watchdog stops the motors only if no other request, such as a sensor's, comes more often.
        """
        silent = self._silent(now)
        if silent or (now - self._asked_s >= BUSY_S and self._watched):
            self._requested_s = math.inf
            self.motion.stop(
                self._cause(StopReason.NO_TELEMETRY, now) if silent else StopReason.COMMAND_TIMEOUT
            )

    # -- in

    def _reread(self, event: Event, now: float) -> Optional[Frame]:
        """Read garbage again in the other checksum mode; return the frame if the board has changed to that mode.

        Otherwise the garbage is counted and the result is None.  One frame without a checksum proves nothing, because a
        damaged frame may look like it; `PLAIN_FRAMES` in a row do.
        """
        assert isinstance(event, Garbage)
        found: List[Event] = []
        if event.reason in ("bad_check", "argument_count"):
            found = FrameDecoder(REPLIES, checked=not self.checked).feed(event.data)
        if len(found) != 1 or not isinstance(found[0], Frame):
            self.counters.count_garbage(event.reason)
            return None
        frame = found[0]
        self._other += 1
        if self.checked and self._other < PLAIN_FRAMES:
            if self._greeting is not None and frame.code in (INFO, _PROTOCOL):
                self.counters.frames += 1
                self._greeting.hurry(now)
            else:
                self.counters.count_garbage(event.reason)
            return None
        self._decoder.checked = not self.checked
        self._restarted = True
        if self._greeting is None:
            self._greet_again(now, StopReason.RESTARTED)
        return frame

    def _on_frame(self, frame: Frame, now: float, checked: bool, events: List[SessionEvent]) -> None:
        """Process any frame except telemetry of a ready board; `checked` says that it had a checksum."""
        code = frame.code
        self._poll.answered(code, now)
        self.hurried |= self._poll.due_s == -math.inf
        if code == STATUS:
            self._on_status(status_of(frame.args), now, events)
        elif code == INFO:
            if checked or self._greeting is None:
                events.append(Info(board_of(frame.args)))
        elif code == SONARS:
            events.append(Sonars(frame.args))
        elif code == RANGES:
            events.append(Ranges(frame.args))
        elif code not in STREAMS:
            if frame.stamp is not None:  # all streams share one sequence of numbers
                missing = self._stream.missing(frame.stamp.sequence, self._silent(now))
                if missing < 0:
                    return  # an old frame
                self._stream.clock.beside(frame.stamp.time, now, not missing)
            self.sensors.heard(frame, now)
            if code == INPUTS and not frame.args[-1]:
                self._poll.drop(INPUTS)  # the board has none
            events.append(Reply(frame))
        if self._greeting is not None:
            if code == _CHECK:
                self._decoder.checked = bool(frame.args[0])
            self._greeting.on_frame(frame, now, checked)
            if self._greeting.of_2013 is not None:
                self._wrapped = self._greeting.of_2013
            if self._greeting is not None and self._greeting.done:
                self.stream_code = code
                self._begin(now, events)

    def _on_counts(self, frame: Frame, now: float, events: List[SessionEvent]) -> None:
        (code, args, stamp), stream = frame, self._stream
        if stamp is not None and self._decoder.checked:
            sequence, board_time = stamp
            missing = stream.missing(sequence, now - self.heard_s >= STALE_S)
            if missing < 0:
                return
            stamp_s = stream.clock.update(board_time, now, not missing)
            time_s = stream.clock.board_s
        else:
            sequence, stamp_s, time_s = None, stream.unnumbered(now), now
        if self._greeting is not None:
            return
        if code != self.stream_code:
            events.append(Reply(frame))
            return
        self.heard_s = now
        self.counters.streamed += 1
        counts, sonars = args[:2], args[2:] or None
        others: Tuple[int, ...] = ()
        if code == _OMNI:
            counts, sonars, others = args[:3], args[3:], args[2:3]
        elif code == _WHEELS:
            left, right, *_ = args
            others, sonars = args[2:4], None
            counts = right, left, *others
            self._add_sonars(now)
        elif code == _SENSING:
            sonars = None
            for name in self.sensors.in_stream(args, now):
                events.append(SensorRead(name, self.sensors.readings[name]))
        elif counts == args:
            self._add_sonars(now)
        motion = self.motion
        if motion.settling:
            motion.observe(counts != self._last, now)
        elif motion.target is None and counts != self._last and self._requested_s == math.inf:
            self._on_uncommanded_motion(now)
        self._last, self.last_frame = counts, frame
        fields = counts[0], counts[1], sonars, time_s, stamp_s, now, sequence, others
        events.append(tuple.__new__(Counts, fields))  # without a call in Python

    def _add_sonars(self, now: float) -> None:
        """The stream has no sonars."""
        self._poll.add_sonars(now)
        self.hurried |= self._poll.due_s == -math.inf

    def _on_uncommanded_motion(self, now: float) -> None:
        """The wheels turn without a command: perhaps the line has delivered a move after its stop.  Send a stop, and
        another one if they turn later.  A robot that is pushed by hand gets the same stops.
        """
        self.counters.uncommanded_motions += now - self._turned_s > STOPPING_S
        self._turned_s = now
        if now - self._stopped_again_s >= self.motion.pace.stop_s:
            self._stopped_again_s = now
            self._send(STOP)

    def _on_imu(self, frame: Frame, now: float, events: List[SessionEvent]) -> None:
        """Process a frame of the IMU's stream.  Without board time it is not used; see `_begin`."""
        stamp, stream = frame.stamp, self._stream
        if stamp is None:
            return
        missing = stream.missing(stamp.sequence, self._silent(now))
        if missing < 0:
            return
        self._poll.imu_s = now + IMU_S
        events.append(imu_reading(frame.args, *stream.clock.beside(stamp.time, now, not missing), now))

    def _silent(self, now: float) -> bool:
        return now - self.heard_s >= STALE_S

    def _on_status(self, status: Status, now: float, events: List[SessionEvent]) -> None:
        before, before_s = self.status, self._status_heard_s
        restarted = before is not None and status.uptime_s < before.uptime_s
        if restarted and status.uptime_s > now - before_s + 1.0:
            return  # older than the status before, which overtook it
        self.status, self._status_heard_s, self._boot_s = status, now, now - status.uptime_s
        events.append(status)
        if status.stop_reason not in NOT_BY_ITSELF:
            new = before is None or before.stop_reason != status.stop_reason
            self._on_own_stop(status.stop_reason, new, now, events)
        self._restarted = self._restarted or restarted
        if restarted and self._greeting is None:
            self._greet_again(now, StopReason.RESTARTED)

    def _on_own_stop(self, reason: StopReason, new: bool, now: float, events: List[SessionEvent]) -> None:
        """The board has stopped the robot, which must not drive on without a new command: drop the command.

        The board refuses all moves until it gets a stop.  Its reason may be that of a stop before the last command,
        unless that is `new` or the command is not.
        """
        if reason == StopReason.LINK_WATCHDOG:
            reason = self._cause(reason, now)
        motion, least_s = self.motion, max(REFUSED_S, min(2 * self.round_trip_s(now), MOST_REFUSED_S))
        if new or (reason != StopReason.BOOT and self._refuses(least_s, now)):
            if motion.wanted:
                events.append(OwnStop(reason))
            if motion.target is not None:
                motion.stop(reason)
            motion.stop_reason = reason
        if motion.target is None and now - self._requested_s >= least_s:
            self._requested_s = math.inf
            self._send(STOP)

    def _refuses(self, least_s: float, now: float) -> bool:
        """Whether the board does not carry out a command that has been in force for at least this time [s]."""
        return self.motion.moves_for_s(now) >= least_s

    # -- greeting

    def _greet_again(self, now: float, reason: StopReason) -> None:
        """The board restarted or fell silent: drop the command and greet the board from the start."""
        if self.turning:
            self.motion.stop(reason)
        self.motion.forget(reason)
        self._poll.end()
        self._requested_s = math.inf
        if self._greeting is None:
            long_up = self.status is not None and self.status.uptime_s >= BOOTED_S
            self._boot_before_s = self._boot_s if long_up else math.nan
            self._lost_before = self.counters.lost
        self._status_heard_s = -math.inf
        self._greeting = Handshake(self._plan, self._send, self._admit, now, patient=True)

    def _begin(self, now: float, events: List[SessionEvent]) -> None:
        """The board streams: it is ready from now on."""
        greeting, self._greeting = self._greeting, None
        assert greeting is not None and greeting.board is not None
        again, self.board = self.board is not None, greeting.board
        streams = self._plan.stream
        if not again and streams:
            self._telemetry_by_s = now + self._greeting_s
        old = self.board.protocol < 2
        sensing = self.stream_code == _SENSING
        watchdog_s = self._plan.watchdog_ms / 1000
        # Its repeats feed the watchdog, however short its period, even if one is lost.
        repeat_s = min(QUICK.repeat_s, watchdog_s / 2.5) if watchdog_s else QUICK.repeat_s
        quick = QUICK._replace(repeat_s=repeat_s, gap_s=max(QUICK.gap_s, self._plan.gap_s))
        pace = (SLOWEST if sensing else SLOW) if old else quick
        self.motion.pace, self.motion.skip_minus_one = pace, old
        read = self.checked and self.reads_imu  # only checked frames have board time
        imu_period_ms = self._plan.imu_period_ms if read else 0
        self._poll.begin(self.board, now, imu_period_ms, sensing, greeting.stream != SENSOR_STREAM)
        if abs(self._boot_s - self._boot_before_s) < SAME_BOOT_S:
            self._restarted = False
        self.counters.restarts += again and self._restarted
        if self._restarted:
            self._stream.begin_anew()
            self.counters.lost = self._lost_before  # after a restart the numbers start again: none were lost
        else:
            self._stream.clock.count_wraps(now)  # frames that were not made have no numbers
        self.heard_s = now if streams else math.inf  # without a stream nothing is late or stale
        self.motion.make_sure()
        coast_s = self._plan.watchdog_ms / 1000 + STOPPING_S if self._watched else math.inf
        imu = self._poll.imu_s < math.inf
        events.append(Ready(self.board, self._restarted, self.checked, coast_s, imu))
        self._restarted, self.hurried = False, True
