"""The conversation with a board, without I/O: bytes and time go in, events and bytes come out.

It greets the board, starts its stream, keeps the link fed, repeats commands and stops, and greets the board
anew when it has restarted.  Times are seconds of one monotonic clock, given by the caller.
"""

import math
from functools import lru_cache
from typing import Callable, List, Optional, Tuple

from mrl_driver.errors import BoardTimeout
from mrl_driver.protocol.codec import REPLIES, Event, Frame, FrameDecoder, Garbage, encode_request
from mrl_driver.protocol.table import BY_NAME

from .events import Counts, Info, Ready, Reply, SessionEvent, Sonars, Stale, Status, status_of
from .handshake import DEFAULT_PLAN, Board, Handshake, Plan, board_of
from .link_counters import Counters
from .motion_command import QUICK, SLOW, STOP, Motion, Pace
from .polling import INFO, SONARS, STATUS, Poll
from .sequence import Stream

__all__ = ["Counts", "Info", "Ready", "Reply", "Session", "SessionEvent", "Sonars", "Stale", "Status"]

LATE_S = 0.1
"""Telemetry older than this: no more motion commands are sent."""
STALE_S = 0.28
"""Telemetry older than this is reported, so that it is known within 300 ms; the command in force is dropped and the
board greeted anew.
"""
ATTENTION_S = 0.1
PAUSE_S = 0.25
"""With a command in force this program looks at the link every `ATTENTION_S`.  After a pause of its own longer than
`PAUSE_S` (a stopped process, a suspended machine) the command is stale, and the board's watchdog has stopped the robot.
"""
SAME_BOOT_S, BOOTED_S = 1.5, 3
"""A board that has been up for `BOOTED_S`, and tells to within `SAME_BOOT_S` (uptimes are whole seconds) that it
started when it did before the link was lost, has not restarted: its counters went on.
"""
STOPPING_S = 1.0
"""After its watchdog's period, or a stop, a robot stands within this time."""
PLAIN_FRAMES = 3
"""So many frames in a row without check value mean that the board has restarted, not that one was damaged."""

_COUNTS, _BOTH, _OMNI = (
    BY_NAME[n].code for n in ("read_encoders", "read_encoders_and_sonars", "start_omni_stream")
)
_STREAMS = (_BOTH, _COUNTS, _OMNI)
_CHECK = BY_NAME["set_check"].code

_encode = lru_cache(maxsize=32)(encode_request)
"""Questions, repeats and stops are the same bytes again and again."""
_TURNING = {BY_NAME[n].code for n in ("calibrate", "move_motors_pid", "move_motors", "move_to_position")}


class Session:
    """State of one board on one link.

    `admit(board)` may raise to refuse a board (wrong robot, dead battery) before anything is set on it, and names the
    row of the stream that is wanted if it is not the usual one.
    """

    def __init__(
        self,
        admit: Callable[[Board], Optional[str]],
        now: float,
        plan: Plan = DEFAULT_PLAN,
        command_timeout_s: Optional[float] = None,
        greeting_s: float = 8.0,
    ) -> None:
        self._admit, self._plan = admit, plan
        self._decoder = FrameDecoder(REPLIES)
        self._other = 0
        self._out = bytearray()
        self.counters = Counters()
        self.motion = Motion(timeout_s=command_timeout_s)
        self.board: Optional[Board] = None
        self.status: Optional[Status] = None
        self._stream = Stream(self.counters)
        self._last: Optional[Tuple[int, ...]] = None
        self.heard_s = -math.inf
        """Arrival of the last telemetry."""
        self._greeting: Optional[Handshake] = Handshake(plan, self._send, admit, now, timeout_s=greeting_s)
        self._restarted = True
        self._lost_before = 0
        """Frames lost until the board was greeted."""
        self._status_heard_s = -math.inf
        self._boot_s = self._boot_before_s = math.nan
        """When the board started, by its last status, and by the last one before it was greeted."""
        self.lead_s = plan.period_ms / 2000
        """What falls due within this time is better done with the frame that has just come, which saves a wake-up."""
        self.motion.lead_s = self.lead_s
        self._poll = Poll(self._send, self.counters, self.lead_s)
        self.sensors = self._poll.sensors
        self._attended_s = now

    @property
    def ready(self) -> bool:
        """The board is greeted, and telemetry is not stale."""
        return self._greeting is None

    @property
    def may_be_moving(self) -> bool:
        """The board was cut off while the robot moved, and has no watchdog to stop it."""
        return not self.ready and self.motion.unconfirmed and not self._watched

    @property
    def _watched(self) -> bool:
        """The board has a watchdog in force."""
        board = self.board
        return board is not None and "watchdog" in board.capabilities and self._plan.watchdog_ms > 0

    @property
    def checked(self) -> bool:
        """Frames carry a check value."""
        return self._decoder.checked

    def take(self) -> bytes:
        """Bytes to send now."""
        if not self._out:
            return b""
        data = bytes(self._out)
        self._out.clear()
        self.counters.bytes_out += len(data)
        return data

    def drive(self, linear_mm_s: int, angular_mrad_s: int, now: float, *lateral_mm_s: int) -> bool:
        """Put a command in force; False (and nothing) unless the board is ready."""
        if not self.ready:
            return False
        self._attended_s = now
        self.motion.drive(linear_mm_s, angular_mrad_s, now, *lateral_mm_s)
        self._move(now)
        return True

    def stop(self, now: float, reason: str = "user") -> None:
        """Stop at once, and again until telemetry confirms it; `reason` is one of `motion.STOPS`."""
        self.motion.stop(reason)
        self._move(now)

    def lose(self, now: float) -> None:
        """The link is gone: nothing is in force, and nothing is on its way."""
        self._greet_again(now, "link_lost")
        self._out.clear()

    def relink(self, now: float, same: bool = True) -> None:
        """There is a link again: the board is greeted from the start, for as long as it takes.

        `same` says that it is the board of before, which may not have restarted.
        """
        self._decoder = FrameDecoder(REPLIES, self.checked)
        self.lose(now)
        self._restarted = not (self.checked and same)
        if not same:
            self._boot_before_s = math.nan

    def end(self) -> None:
        """Take leave: no stream, no check value, as a 2013 host expects a board."""
        self.motion.forget("closed")
        self._send(BY_NAME["stop_stream"].code)
        if self.checked:
            self._send(_CHECK, 0)

    def request(self, code: int, *args: int) -> None:
        """Send a request; its answer comes as a `Reply` or its own event.

        Raises:
            FrameError: the table forbids it.
            BoardTimeout: it would turn motors, and the board is silent or being greeted; it was not sent.
        """
        if code in _TURNING and not self.ready:
            raise BoardTimeout(
                "the board is silent or being greeted, nothing was sent; try again when it is ready"
            )
        self._send(code, *args)
        if code in _TURNING:
            self._poll.hurry()

    def receive(self, data: bytes, now: float) -> List[SessionEvent]:
        """Events out of bytes that arrived at `now`.

        Raises:
            BoardError: the board is not one to work with.
        """
        if now - self._attended_s > PAUSE_S:
            self._resume()
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
            if frame.code in _STREAMS:
                self._on_counts(frame, now, events)
            if frame.code not in _STREAMS or self._greeting is not None:
                self._on_frame(frame, now, checked, events)
        if self._greeting is not None and (strange or b"@" not in data):
            self._greeting.heard(data, now)
        return events

    def tick(self, now: float) -> List[SessionEvent]:
        """Do what is due; call it at `deadline()` and after `receive`.

        Raises:
            NotARobot: nothing answers the greeting, or not in frames.
            BoardTimeout: the board stopped answering during the greeting.
        """
        if now - self._attended_s > PAUSE_S:
            self._resume()
        self._attended_s = now
        events: List[SessionEvent] = []
        if self._greeting is not None:
            self._greeting.tick(now, self.checked)
        elif now - self.heard_s >= STALE_S:
            self._greet_again(now, "stale")
            events.append(Stale(now - self.heard_s, self.may_be_moving))
            self._restarted = not self.checked
        elif not self.late(now):
            self._poll.take(now, self.motion.pace.repeat_s)
        self._move(now)
        return events

    def deadline(self, now: float) -> float:
        """When `tick` is due at the latest [s], unless bytes come before."""
        motion = self.motion
        if self._greeting is not None:
            return min(self._greeting.due_s, motion.due_s()) if motion.stopping else self._greeting.due_s
        due_s = self.heard_s + STALE_S
        if motion.target is not None:
            due_s = min(due_s, self._attended_s + ATTENTION_S)
        late = now - self.heard_s >= LATE_S
        if motion.stopping or (motion.target is not None and not late):
            due_s = min(due_s, motion.due_s())
        return due_s if late else min(due_s, self._poll.due_s)

    def late(self, now: float) -> bool:
        """Telemetry is so old that no motion is sent."""
        return now - self.heard_s >= LATE_S

    def _resume(self) -> None:
        """This program was not there for a while."""
        if self.motion.target is not None:
            self.motion.stop("host_paused")

    # -- out

    def _send(self, code: int, *args: int, checked: Optional[bool] = None) -> None:
        """A request on its way; a stop is always plain, for that works in every state of the board."""
        checked = self.checked if checked is None else checked
        self._out += _encode(code, *args, checked=checked and code != STOP)

    def _move(self, now: float) -> None:
        for request in self.motion.take(now, self.ready and not self.late(now)):
            self._send(*request)

    def _pace(self) -> Pace:
        """Repeats that keep a watchdog fed, however short, with one of them lost."""
        watchdog_s = self._plan.watchdog_ms / 1000
        repeat_s = min(QUICK.repeat_s, watchdog_s / 2.5) if watchdog_s else QUICK.repeat_s
        return QUICK._replace(repeat_s=repeat_s, gap_s=max(QUICK.gap_s, self._plan.gap_s))

    # -- in

    def _reread(self, event: Event, now: float) -> Optional[Frame]:
        """The frame in garbage, if it is one by the rules of the other mode and the board has evidently
        changed to it; what is not is counted.

        One frame without a check value is no evidence, because a damaged one may look like it: `PLAIN_FRAMES` in
        a row are.
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
            if self._greeting is not None and frame.code == INFO:
                self.counters.frames += 1
                self._greeting.hurry(now)
            else:
                self.counters.count_garbage(event.reason)
            return None
        self._decoder.checked = not self.checked
        self._other = 0
        self._restarted = True
        if self._greeting is None:
            self._greet_again(now, "restarted")
        return frame

    def _on_frame(self, frame: Frame, now: float, checked: bool, events: List[SessionEvent]) -> None:
        """Any frame but plain telemetry of a board that is ready; `checked` if it came with a check value."""
        code = frame.code
        self._poll.answered(code)
        if code == STATUS:
            self._on_status(status_of(frame.args), now, events)
        elif code == INFO:
            if checked or self._greeting is None:
                events.append(Info(board_of(frame.args)))
        elif code == SONARS:
            events.append(Sonars(frame.args))
        elif code not in _STREAMS:
            if frame.stamp is not None and self._stream.missing(frame.stamp.sequence, self._silent(now)) < 0:
                return  # numbers run over the frames of all streams
            self.sensors.heard(frame, now)
            events.append(Reply(frame))
        if self._greeting is not None:
            if code == _CHECK:
                self._decoder.checked = bool(frame.args[0])
            self._greeting.on_frame(frame, now, checked)
            if self._greeting is not None and self._greeting.done:
                self._begin(now, events)

    def _on_counts(self, frame: Frame, now: float, events: List[SessionEvent]) -> None:
        args, stamp = frame.args, frame.stamp
        if stamp is not None and self._decoder.checked:
            made = self._stream.numbered(stamp, now, self._silent(now))
        else:
            made = self._stream.unnumbered(now)
        if made is None:
            return
        if self._greeting is not None:
            return
        self.heard_s = now
        counts, sonars, rear = args[:2], args[2:] or None, None
        if frame.code == _OMNI:
            counts, sonars, rear = args[:3], args[3:], args[2]
        elif counts == args:
            self._poll.add_sonars(now)
        if self.motion.stopping:
            self.motion.observe(counts != self._last, now)
        self._last = counts
        sequence = stamp.sequence if stamp is not None else None
        times = made.board_s, made.stamp_s, now
        events.append(_new(Counts, (args[0], args[1], sonars, *times, sequence, rear)))

    def _silent(self, now: float) -> bool:
        return now - self.heard_s >= STALE_S

    def _on_status(self, status: Status, now: float, events: List[SessionEvent]) -> None:
        before, before_s = self.status, self._status_heard_s
        restarted = before is not None and status.uptime_s < before.uptime_s
        if restarted and status.uptime_s > now - before_s + 1.0:
            return  # older than the one before, which has overtaken it
        self.status, self._status_heard_s, self._boot_s = status, now, now - status.uptime_s
        if status.stop_reason not in ("none", "host", before.stop_reason if before else ""):
            if self.motion.target is not None:
                self.motion.stop(status.stop_reason)  # nor does it drive on by itself
            self.motion.stop_reason = status.stop_reason
        events.append(status)
        self._restarted = self._restarted or restarted
        if restarted and self._greeting is None:
            self._greet_again(now, "restarted")

    # -- greeting

    def _greet_again(self, now: float, reason: str) -> None:
        """The board restarted or fell silent: stopped until a new command, and greeted from the start."""
        self.motion.forget(reason)
        self._poll.end()
        if self._greeting is None:
            long_up = self.status is not None and self.status.uptime_s >= BOOTED_S
            self._boot_before_s = self._boot_s if long_up else math.nan
            self._lost_before = self.counters.lost
        self._status_heard_s = -math.inf
        self._greeting = Handshake(self._plan, self._send, self._admit, now, patient=True)

    def _begin(self, now: float, events: List[SessionEvent]) -> None:
        """The board streams: from here on it is ready."""
        greeting, self._greeting = self._greeting, None
        assert greeting is not None and greeting.board is not None
        again, self.board = self.board is not None, greeting.board
        old = self.board.protocol < 2
        self.motion.pace, self.motion.skip_minus_one = SLOW if old else self._pace(), old
        self._poll.begin(self.board, now)
        if abs(self._boot_s - self._boot_before_s) < SAME_BOOT_S:
            self._restarted = False
        self.counters.restarts += again and self._restarted
        if self._restarted:
            self._stream.begin_anew()
            self._last = None
            self.counters.lost = self._lost_before  # numbers that begin anew lost none
        self.heard_s = now
        self.motion.make_sure()
        coast_s = self._plan.watchdog_ms / 1000 + STOPPING_S if self._watched else math.inf
        events.append(Ready(self.board, self._restarted, self.checked, coast_s))
        self._restarted = False


_new = tuple.__new__
