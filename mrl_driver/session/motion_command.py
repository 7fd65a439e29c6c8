"""The motion command in force: the latest command wins, and a stop is repeated until the wheels stand still.

This module has no I/O and no clock; time is a parameter.  Commands in wire units (mm/s, mrad/s) go in; requests that
are due come out.
"""

import math
from typing import Callable, NamedTuple, Optional, Tuple

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_NAME

MOVE, STOP = BY_NAME["move_differential"].code, BY_NAME["stop"].code

Speeds = Tuple[int, ...]
"""Linear and angular speed [mm/s, mrad/s], and lateral speed [mm/s] if the base can move sideways."""
Request = Tuple[int, ...]

STILL_S = 0.08
STILL_FRAMES = 3
"""A stop is confirmed after `STILL_FRAMES` frames, over at least `STILL_S` [s], in which no wheel moved."""


class Pace(NamedTuple):
    """How often commands are sent [s]."""

    gap_s: float  # minimum time between two new commands; a newer command replaces one that waits
    repeat_s: float  # the last command is sent again after this time, which feeds the board's watchdog
    stop_s: float  # an unconfirmed stop is sent again after this time
    after_repeat_s: float = 0.0  # minimum time from a repeat to a new command


QUICK = Pace(0.005, 0.1, 0.05)  # pace for this project's firmware, which executes about 880 commands a second
SLOW = Pace(0.1, 0.5, 0.15, 0.1)
"""Pace for 2013 boards: they lose commands above 26 a second while they stream, and have no watchdog to feed."""
# Pace for 2013 boards that stream their environment sensors: the board reads one byte for each frame that it sends, and
# sends 163 of these frames a second.
SLOWEST = Pace(0.15, 0.5, 0.15, 0.15)


class Motion:
    """The command in force, and when it must be sent."""

    def __init__(
        self, pace: Pace = QUICK, timeout_s: Optional[float] = None, skip_minus_one: bool = False
    ) -> None:
        """`timeout_s` stops the robot after this time without a new command [s].  `skip_minus_one` is for boards that
        drop frames with an argument of -1: they get 0 instead, which differs by 1 mm/s or 1 mrad/s.
        """
        self.pace = pace
        self.timeout_s = timeout_s
        self.skip_minus_one = skip_minus_one
        self.target: Optional[Speeds] = None  # speeds in force [mm/s, mrad/s]; None while stopped
        self.sent: Optional[Speeds] = None  # speeds that were sent last; None after a stop
        self.request_of: Optional[Callable[[Speeds], Request]] = None
        """Returns the request that commands these speeds; None for a base with two driven wheels or tracks."""
        self.stop_reason = StopReason.NONE  # reason of the last stop, of this program or of the board
        self.stops = 0  # times that a command in force was dropped
        self.lead_s = 0.0
        """`take` repeats a command this long before it is due, to use a call that happens anyway [s]."""
        self.unconfirmed = False
        """A command was dropped while the robot moved, and no standstill was observed since."""
        self.stopping = False  # a stop is not confirmed yet
        self.settling = False
        """After a stop or a command of zero: `observe` has not confirmed that the wheels stand still."""
        self.due_s = math.inf  # time when `take` next has something to send [s]; infinity while stopped
        self._new = self._moves = self._turning = False
        self._moves_since_s = math.inf
        self._expires_s = math.inf
        self._sent_s = self._free_s = -math.inf
        self._fade: Optional[Tuple[float, float, Speeds]] = None
        self._still_since_s: Optional[float] = None  # the first still reading; None before it
        self._still: int  # readings after it

    def drive(self, speeds: Speeds, now: float, moves: Optional[bool] = None) -> None:
        """Set the command in force.  Its time begins now.

        `moves` says whether the command was to move, if its limited speeds may still be zero.
        """
        wants = any(speeds) if moves is None else moves
        if wants and (self.target is None or not self._moves):
            self._moves_since_s = now
        self._moves = wants
        self._set(speeds)
        self._expires_s = now + self.timeout_s if self.timeout_s is not None else math.inf
        self._new, self.stopping, self._fade = True, False, None
        self.due_s = min(self._free_s, self._expires_s)

    @property
    def held_back(self) -> bool:
        """The command in force is not the one that was sent last."""
        return self.target is not None and self.target != self.sent

    @property
    def wanted(self) -> bool:
        """The last command was to move, and no stop of the user has followed it."""
        return self._moves and (self.target is not None or self.stop_reason != StopReason.USER)

    def moves_for_s(self, now: float) -> float:
        """Time for which commands to move have been in force, one after the other [s]; 0 if none is."""
        return now - self._moves_since_s if self.target is not None and self._moves else 0.0

    def adjust(self, speeds: Speeds) -> None:
        """Change the speeds of the command in force, without starting its time again; a `fade` is never raised."""
        if self._fade is not None:
            start_s, duration_s, faded = self._fade
            speeds = tuple(min(was, now, key=abs) for was, now in zip(faded, speeds))
            changed, self._fade = speeds != faded, (start_s, duration_s, speeds)
        else:
            changed = speeds != self.target
        if changed:
            self._set(speeds)
            self._new, self.due_s = True, min(self._free_s, self._expires_s)

    def _set(self, speeds: Speeds) -> None:
        self.target = speeds
        if any(speeds):
            self._turning, self.settling = True, False
            self._still_since_s = None
        else:
            self.settling = self._turning or self.stopping

    def stop(self, reason: StopReason = StopReason.USER) -> None:
        """Stop; the request is due at once and is repeated until `observe` has confirmed the stop."""
        self.stop_reason = reason
        self.stops += self.target is not None
        self.target = self.sent = self._fade = self._still_since_s = None
        self.stopping = self.settling = self._new = True
        self.due_s = -math.inf

    def make_sure(self) -> None:
        """Stop the robot again if no command is in force, until `observe` confirms it.  The stop reason stays."""
        self.unconfirmed = False
        if self.target is None:
            self.stop(self.stop_reason)

    def repeat(self, now: float) -> None:
        """Let the command in force, or a stop that is not confirmed, be due now if the pace allows."""
        if (self.stopping or self.target is not None) and now - self._sent_s >= self.pace.gap_s:
            self.due_s = min(self.due_s, now)

    def forget(self, reason: StopReason) -> None:
        """Drop the command without a stop: the board is stopped already, or away."""
        if self.target is not None:
            self.stop_reason = reason
            self.stops += 1
        self.unconfirmed = self.unconfirmed or self.stopping or self._turning
        self.target = self.sent = self._fade = None
        self._new = self.stopping = self.settling = False
        self.due_s = math.inf

    def fade(self, now: float, duration_s: float) -> None:
        """Slow down evenly over `duration_s`, then stop."""
        if self.target is not None and self._fade is None:
            self._fade = (now, duration_s, self.target)
            self.due_s = min(self._free_s, self._expires_s)

    def prolong(self, now: float) -> None:
        """Let a `fade` go on, because a new command shows that the source of commands is alive."""
        if self._fade is not None and self.timeout_s is not None:
            self._expires_s = now + self.timeout_s

    def observe(self, moved: bool, now: float) -> None:
        """Process a reading: `moved` says that a wheel moved since the one before.  Enough still readings confirm a
        stop, or that the robot stands under a command of zero.
        """
        if not self.settling or self._new:
            return
        if moved or self._still_since_s is None:
            self._still_since_s, self._still = now, 0
            return
        self._still += 1
        if self._still >= STILL_FRAMES and now - self._still_since_s >= STILL_S:
            self.stopping = self.settling = self._turning = False
            if self.target is None:
                self.due_s = math.inf

    def take(self, now: float, allowed: bool = True) -> Optional[Request]:
        """Return the request to send now, or None.  Without `allowed` (telemetry is late) it returns only stops."""
        if self.target is not None and now >= self._expires_s:
            self.stop(StopReason.COMMAND_TIMEOUT if self._moves else StopReason.USER)
        if self._fade is not None:
            self._fade_on(now)
        target, stopping, pace = self.target, self.stopping, self.pace
        lead_s = 0.0 if self._new or self._fade else self.lead_s
        if now + lead_s < self.due_s or not (stopping or (allowed and target is not None)):
            return None
        gap_s = pace.gap_s if self._new else pace.after_repeat_s
        self._sent_s, self._free_s, self._new = now, now + gap_s, False
        if target is None:
            self.due_s = now + pace.stop_s
            return (STOP,)
        self.sent = target
        self.due_s = min(now + (pace.gap_s if self._fade else pace.repeat_s), self._expires_s)
        if self.settling and not any(target):
            return (STOP,)  # brakes at once; a speed of 0 would follow the motor board's ramp
        if self.request_of is not None:
            return self.request_of(target)
        linear, angular = target
        if self.skip_minus_one:
            linear, angular = (0 if linear == -1 else linear), (0 if angular == -1 else angular)
        return MOVE, linear, angular

    def _fade_on(self, now: float) -> None:
        assert self._fade is not None
        start_s, duration_s, speeds = self._fade
        left = 1 - (now - start_s) / duration_s if duration_s > 0 else 0.0
        if left <= 0:
            self.stop(StopReason.BATTERY)
        else:
            self.target = tuple(int(speed * left) for speed in speeds)
