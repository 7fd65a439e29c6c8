"""Compares commanded and measured motion of each wheel: finds dead or reversed encoders, blocked wheels, motors
without power, and wheels that run faster than commanded.

No I/O: commands, counts and seconds go in, a mismatch comes out.  Each wheel must move at least as far as that of a
slow robot: the command is late, the ramp takes twice as long as in the model, and the wheel stops before it reverses.
A wheel that makes less than a tenth of that distance over a quarter of a second does not follow its command.  Nor does
one that makes half as much again as the fastest command over half a second, or as its own speed while it brakes.
"""

import math
from collections import deque
from typing import Deque, NamedTuple, Optional, Sequence, Set, Tuple

from mrl_driver.problems import PROBLEMS
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.kinematics import Planar, differential, kinematics_of
from mrl_driver.robot.models import Drive, RobotModel
from mrl_driver.robot.models.drives import Base
from mrl_driver.robot.odometry import WHEELS_BY_COUNT, AnyWheels
from mrl_driver.session.motion_command import Pace

TICK_S = 0.05  # period of the comparison [s]; frames in between cost nothing
ROUNDING_S = 0.0005
"""A frame that is this much early counts as on time [s]: the board's times are rounded, and a stream of `TICK_S` would
otherwise be compared at every second frame."""
WINDOW = 5  # number of ticks over which the motion is compared
LEAST_SHARE = 0.1  # less than this share of the expected distance is a mismatch
REVERSED_SHARE = -0.3
"""A wheel that moved backwards by more than this share of the expected distance in the newest ticks runs in reverse."""
NEWEST = 2
# Smallest expected distance over the window that is judged [m]: 24 mm/s.  A slower motor may stick for half a second.
LEAST_DISTANCE_M = 0.006
LEAST_COUNTS = 6
"""The same in counts: the control sees a wheel with a slotted disc late, and the wheel may stand meanwhile."""
FAST_SHARE, FAST_TICKS = 1.5, 10
"""A wheel that makes more than this share of the largest distance, over this many ticks, is too fast."""
COAST_M_S2 = 0.2
"""A wheel with a slower command slows down at least at this rate: one that coasts has its friction alone.  Assumed."""
SLOWNESS = 0.5  # the wheel may accelerate this much more slowly than in the model (factor)
HIDDEN_S = 0.8  # after a reversal, a wheel may keep accelerating in the old direction for this time [s]
LEAST_RAMP_MS = 500  # shortest ramp to full speed that is assumed for a motor [ms]
DELAY_S = 0.05  # delay of a command from the driver to the motors if none is lost [s]
STILL_M, STILL_TICKS = 0.0002, 10
"""A wheel that moves less than this per tick [m], for this many ticks, has come to rest.  A wheel that reverses sticks
for up to 0.5 s, until the speed control has overcome friction at a control rate of 10 Hz."""
GAP_S = 0.15
"""After a longer gap between readings the monitor starts again [s]: the board may have stopped during the gap."""

DEAD = "encoder dead or unplugged, or the wheel blocked"
REVERSED = "encoder or motor wires swapped: it counts against the command"
POWERLESS = "motor power off, or the motor board stopped"
FAST = "too fast: the board has other parameters than the robot's file, or does not control its motors; see mrl doctor"
BOARD_STOPS = {StopReason.WHEEL_BLOCKED: "wheel_blocked", StopReason.ENCODER: "encoder_dead"}
"""Reasons for which a board with an H-bridge stops by itself because of a wheel, and their codes in `problems`."""


class Mismatch(NamedTuple):
    """A wheel does not follow its command; the robot was stopped."""

    wheel: str
    """Name of a wheel as in the counts, or `both` or `several`; empty if the board has stopped the robot."""
    cause: str  # the most likely cause; if the board has stopped the robot, its reason: one of `BOARD_STOPS`
    expected_m: float = 0.0
    """Smallest distance that the wheel should have made in the last quarter of a second; if it is too fast, the largest
    in the last half second [m].
    """
    moved_m: float = 0.0  # distance by its counts [m]; negative is against the command

    @property
    def reason(self) -> StopReason:
        """Reason of the stop, as in `Driver.stop_reason`."""
        return StopReason.WHEEL_MISMATCH if self.wheel else StopReason(self.cause)

    def __str__(self) -> str:
        if not self.wheel:
            row = PROBLEMS[BOARD_STOPS.get(self.reason, "wheel_fault")]
            return f"{row.message[0].lower()}{row.message[1:]}: {row.remedy}"
        wheels = f"{self.wheel.replace('_', ' ')} wheel" + ("s" if self.wheel in ("both", "several") else "")
        bound = f"at {'most' if self.cause == FAST else 'least'} {self.expected_m * 1000:.0f} mm"
        return f"{wheels} moved {self.moved_m * 1000:.0f} mm, expected {bound}: {self.cause}"


class _Wheel:
    """One wheel, by its name in the counts.

    `reference` is the speed on the slowest ramp of a healthy wheel [m/s, along the command]; below zero the wheel still
    runs in the other direction.
    """

    def __init__(self, name: str, least_m: float, acceleration_m_s2: float, latency_ticks: int) -> None:
        self._name, self._least_m = name, least_m
        self._acceleration_m_s2 = SLOWNESS * acceleration_m_s2
        self._braking_m_s2 = min(COAST_M_S2, self._acceleration_m_s2)
        self._hidden_m_s = HIDDEN_S * acceleration_m_s2
        self._targets: Deque[float] = deque([0.0] * (latency_ticks + 1), maxlen=latency_ticks + 1)
        self._speeds = self._targets.copy()
        self._expected_m: Deque[float] = deque(maxlen=WINDOW)
        self._moved_m: Deque[float] = deque(maxlen=WINDOW)
        self._fastest_m: Deque[float] = deque(maxlen=FAST_TICKS)
        self._made_m: Deque[float] = deque(maxlen=FAST_TICKS)
        self._fastest: Optional[float] = None
        self._reference = 0.0
        self._direction = self._last = 0.0
        self._asked: Set[float] = set()
        self._still = 0

    def ask(self, target_m_s: float) -> None:
        """Note a new command, even if the next one replaces it at once."""
        if target_m_s:
            self._asked.add(math.copysign(1.0, target_m_s))

    def tick(self, target_m_s: float, moved_m: float, dt_s: float) -> Optional[Mismatch]:
        """Return the mismatch; None if there is none or it is too early to judge."""
        self._targets.append(target_m_s)
        self._speeds.append(moved_m / dt_s)
        self._still = self._still + 1 if abs(moved_m) < STILL_M else 0
        return self._too_slow(moved_m, dt_s) or self._too_fast(moved_m, dt_s)

    def _too_fast(self, moved_m: float, dt_s: float) -> Optional[Mismatch]:
        """Compare with the fastest command, and with what was faster at the start or before, slowing down slowly."""
        before = abs(self._speeds[-1]) if self._fastest is None else self._fastest
        self._fastest = max(*map(abs, self._targets), before - self._braking_m_s2 * dt_s)
        if not self._targets[-1]:  # a hand may push a robot that is to stand
            self._fastest_m.clear()
            self._made_m.clear()
            return None
        self._fastest_m.append(self._fastest * dt_s)
        self._made_m.append(moved_m)
        most_m = FAST_SHARE * sum(self._fastest_m) + self._least_m * FAST_TICKS / WINDOW
        made_m = math.copysign(1.0, self._targets[-1]) * sum(self._made_m)
        if len(self._made_m) < FAST_TICKS or abs(made_m) <= most_m:
            return None
        cause, bound_m = (FAST, most_m) if made_m > 0.0 else (REVERSED, 0.0)
        return Mismatch(self._name, cause, bound_m, made_m)

    def _too_slow(self, moved_m: float, dt_s: float) -> Optional[Mismatch]:
        least, most = min(self._targets), max(self._targets)
        floor = max(least, 0.0) + min(most, 0.0)  # the slowest of them; 0 if they differ in direction
        if floor == 0.0:
            self._direction = 0.0
            self._forget()
            return None
        direction = math.copysign(1.0, floor)
        if direction != self._direction:
            self._turn(direction, direction * self._speeds[0])
        self._follow(abs(floor), dt_s)
        if self._reference <= 0.0:
            self._forget()
            return None
        self._expected_m.append(self._reference * dt_s)
        self._moved_m.append(direction * moved_m)
        expected_m, moved_m = sum(self._expected_m), sum(self._moved_m)
        if len(self._moved_m) < WINDOW or expected_m < self._least_m or moved_m >= LEAST_SHARE * expected_m:
            return None
        lately, moved_lately = (sum(list(each)[-NEWEST:]) for each in (self._expected_m, self._moved_m))
        cause = REVERSED if moved_lately < REVERSED_SHARE * lately else DEAD
        return Mismatch(self._name, cause, expected_m, moved_m)

    def _forget(self) -> None:
        self._expected_m.clear()
        self._moved_m.clear()

    def _turn(self, direction: float, speed: float) -> None:
        """Start on a command in a new direction, with the wheel at `speed` along it.  If the other direction was
        commanded before, the wheel may still accelerate in that direction.
        """
        slowest = min(0.0, speed) - (self._hidden_m_s if -direction in self._asked else 0.0)
        self._reference = min(self._reference, slowest) if direction == self._last else slowest
        self._direction = self._last = direction
        self._asked = {direction}

    def _follow(self, floor: float, dt_s: float) -> None:
        ramped = self._reference + self._acceleration_m_s2 * dt_s
        if self._reference < 0.0 and self._still >= STILL_TICKS:
            ramped = 0.0
        self._reference = min(floor, ramped)


class WheelMonitor:
    """Monitors the wheels of one robot.

    Args:
        drive: geometry of the drive.
        acceleration_m_s2: acceleration of a wheel by the model.
        latency_s: longest delay of a command from the driver to the motors, if one is lost [s].
    """

    def __init__(self, drive: Base, acceleration_m_s2: float, latency_s: float) -> None:
        self._metres, base = drive.metres_per_count, kinematics_of(drive)
        least_m = max(LEAST_DISTANCE_M, LEAST_COUNTS * self._metres)
        self._make = (least_m, acceleration_m_s2, math.ceil(latency_s / TICK_S))
        self._names = WHEELS_BY_COUNT[len(base.wheels)]._fields
        self._order = [base.wheels.index(name) for name in self._names]  # in the numbers of the kinematics
        two = len(self._names) == 2
        self._kinematics = differential(drive.wheel_separation_m) if two else base
        self.reset()

    def reset(self) -> None:
        """The robot was stopped: start again."""
        self._wheels = [_Wheel(name, *self._make) for name in self._names]
        self._time_s = self.next_s = -math.inf
        self._travel: Sequence[float] = (0,) * len(self._names)
        self._command: Tuple[float, ...] = ()
        self._targets: Tuple[float, ...] = ()

    def update(
        self,
        linear_m_s: float,
        angular_rad_s: float,
        travel: AnyWheels,
        time_s: float,
        lateral_m_s: float = 0.0,
    ) -> Optional[Mismatch]:
        """Compare the command in force with `travel` [count, without wrap] read at `time_s` [s]."""
        if time_s - self._time_s > GAP_S:
            before = self._targets
            self.reset()
            self._ask(before)  # the wheels may still follow the command from before the gap
        command = linear_m_s, lateral_m_s, angular_rad_s
        if command != self._command:
            self._command = command
            speeds = self._kinematics.wheel_steps(Planar(*command))
            self._ask(tuple(speeds[i] for i in self._order))
        if time_s < self.next_s:
            return None
        dt_s, last = time_s - self._time_s, self._travel
        self._time_s, self.next_s, self._travel = time_s, time_s + TICK_S - ROUNDING_S, travel
        if dt_s > GAP_S:
            return None
        found = (
            wheel.tick(target, (now - before) * self._metres, dt_s)
            for wheel, target, now, before in zip(self._wheels, self._targets, travel, last)
        )
        wrong = [each for each in found if each is not None]
        return self._combine(wrong) if wrong else None

    def _ask(self, targets: Tuple[float, ...]) -> None:
        self._targets = targets
        for wheel, target in zip(self._wheels, targets):
            wheel.ask(target)

    def _combine(self, wrong: Sequence[Mismatch]) -> Mismatch:
        """Return one mismatch for those of all wheels."""
        if len(wrong) == 1:
            return wrong[0]
        causes = {each.cause for each in wrong}
        cause = next(each for each in (REVERSED, DEAD, FAST) if each in causes)
        if cause == DEAD and len(wrong) == len(self._names):
            cause = POWERLESS
        return wrong[0]._replace(wheel="both" if len(self._names) == 2 else "several", cause=cause)


def monitor_of(model: RobotModel, pace: Pace) -> WheelMonitor:
    """Return the monitor for a robot of this model with commands at this pace."""
    ramp_ms = max(LEAST_RAMP_MS, model.board["ramp_time"])
    latency_s = pace.repeat_s + DELAY_S
    drive, full_mm_s = model.base, float(model.board["linear_ceiling"])
    if not isinstance(drive, Drive):
        full_mm_s = 1000 * drive.full_speed_m_s
    return WheelMonitor(drive, full_mm_s / ramp_ms, latency_s)
