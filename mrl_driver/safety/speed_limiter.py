"""The speed limiter, the only one between a command and the board: no I/O, no clock.

It scales a command to the limits, on the same arc, and ramps the speeds up.  Slowing down takes effect at once, unless
the limits say that the robot would tip over.  A stop never passes here, and what `restrict` takes away is at once.
"""

import math
import operator
from typing import Callable, Optional, Tuple

from mrl_driver.arguments import require_numbers
from mrl_driver.robot.models import Limits

Speeds = Tuple[float, ...]
"""Linear and angular speed [m/s, rad/s]; on a base that moves sideways also the lateral speed [m/s]."""

FIRST_STEP_S, LONGEST_STEP_S = 0.02, 0.1
"""Time of the first acceleration step, and of the longest one.

A command from standstill takes effect at once, as if it were one frame of the stream old.  After a pause, a step
accelerates for at most the longer time."""
AUTOMATIC, MANUAL = "automatic", "manual"
OPERATION_MODES = (AUTOMATIC, MANUAL)
"""A mode is a set of limits for the limiter, which stays the only one that limits speeds."""
FASTEST_MANUAL_M_S = 0.25
"""Highest speed in manual mode [m/s]: ISO 10218-1 allows 250 mm/s in manual mode with reduced speed."""


class SpeedLimiter:
    """Limits the commands of one robot."""

    def __init__(self) -> None:
        self.limits: Optional[Limits] = None  # limits in force; None until the model is known
        self.saturate: Optional[Callable[[Speeds], Speeds]] = None
        """Scales speeds down to what the wheels reach; None if the limits say it all."""
        self.restrict: Optional[Callable[[Speeds, float], Speeds]] = None
        """`restrict(speeds, now)` returns the speeds that are allowed now, such as by protective zones."""
        self.target: Optional[Speeds] = None
        """The last command within the limits, before `restrict` and the ramp; None while stopped."""
        self.speeds: Speeds = ()  # the speeds in force
        self._stepped_s = -math.inf

    def change(self, limits: Limits) -> None:
        """Replace the limits; a command in force is lowered with the next step."""
        self.limits = limits
        if self.target is not None:
            self.target = self.limited(self.target)

    def is_below(self, usual: Limits) -> bool:
        """Return whether a restriction is in force, or a speed is limited to less than usual."""

        def speeds(limits: Limits) -> Speeds:
            return limits.linear_m_s, limits.angular_rad_s, limits.lateral_m_s or limits.linear_m_s

        lower = self.limits is not None and any(map(operator.lt, speeds(self.limits), speeds(usual)))
        return lower or self.restrict is not None

    def drop(self) -> None:
        """The robot was stopped: the next command starts from standstill."""
        self.target, self.speeds = None, ()

    def limited(self, speeds: Speeds) -> Speeds:
        """Return the speeds, scaled down together if one exceeds its limit; arc and direction stay the same.

        Beyond about 1e305 m/s or rad/s, where the scale is infinite, they are 0.
        """
        limits = self.limits
        assert limits is not None
        linear, angular, lateral = (*speeds, 0.0)[:3]
        speed = math.hypot(linear, lateral)
        excess = max(
            1.0,
            speed / limits.linear_m_s,
            abs(angular) / limits.angular_rad_s,
            abs(lateral) / (limits.lateral_m_s or limits.linear_m_s),
            math.sqrt(speed) * math.sqrt(abs(angular) / (limits.curve_m_s2 or math.inf)),
        )
        speeds = (linear / excess, angular / excess, lateral / excess)[: len(speeds)]
        return self.saturate(speeds) if self.saturate is not None else speeds

    def step(self, now: float) -> Speeds:
        """Continue to accelerate, and apply `restrict`; return the speeds that are in force from now on.

        Raises:
            ConfigError: `restrict` has not returned finite speeds.
        """
        target, limits = self.target, self.limits
        assert target is not None and limits is not None
        allowed = target if self.restrict is None else self._restricted(target, now)
        wanted = target if allowed == target else self.limited(allowed)
        # Another thread may have stepped a moment later already.
        dt_s = min(LONGEST_STEP_S, max(0.0, now - self._stepped_s))
        self._stepped_s = max(now, self._stepped_s)
        if wanted != self.speeds:
            if not any(self.speeds):
                self.speeds = ramp((0.0,) * len(wanted), wanted, limits, FIRST_STEP_S)
            elif limits.braking_m_s2 and wanted == target:
                self.speeds = self._restricted(gentle_ramp(self.speeds, wanted, limits, dt_s), now)
            else:
                self.speeds = ramp(self.speeds, wanted, limits, dt_s)
        return self.speeds

    def _restricted(self, speeds: Speeds, now: float) -> Speeds:
        if self.restrict is None:
            return speeds
        parts = ("linear", "angular", "lateral")[: len(speeds)]
        return require_numbers("speed that restrict allows", self.restrict(speeds, now), parts)


def _curve_excess(speeds: Speeds, limits: Limits) -> float:
    """Return the acceleration to the inside of the curve, as a share of its limit; 0 without one."""
    return math.hypot(*speeds[0::2]) * abs(speeds[1]) / (limits.curve_m_s2 or math.inf)


def gentle_ramp(before: Speeds, wanted: Speeds, limits: Limits, dt_s: float) -> Speeds:
    """Return the next speeds on the way from `before` to `wanted` of a robot that may tip over.

    No change of speed or direction exceeds the limit of acceleration or, if it slows down, of braking.  A
    turn that ends keeps its share of it, and with it the arc; one that begins never delays the braking.
    """
    (was, turn_was, aside_was), (to, turn_to, aside_to) = ((*each, 0.0)[:3] for each in (before, wanted))
    change, turn_change, aside_change = to - was, turn_to - turn_was, aside_to - aside_was
    brakes = change * was + aside_change * aside_was < 0
    rate_m_s2 = limits.braking_m_s2 if brakes else limits.linear_acceleration_m_s2
    share = turn_share = _share(math.hypot(change, aside_change), rate_m_s2 * dt_s)
    if turn_change * turn_to > 0:
        turn_share = min(share, _share(abs(turn_change), limits.angular_acceleration_rad_s2 * dt_s))
    if not brakes:
        share = turn_share
    if share == turn_share == 1.0:
        return wanted
    speeds = was + share * change, turn_was + turn_share * turn_change, aside_was + share * aside_change
    turn = speeds[1] / max(1.0, _curve_excess(speeds, limits))
    return (speeds[0], turn, speeds[2])[: len(wanted)]


def _share(change: float, most: float) -> float:
    return most / change if change > most else 1.0


def ramp(before: Speeds, wanted: Speeds, limits: Limits, dt_s: float) -> Speeds:
    """Return the next speeds on the way from `before` to `wanted`.

    Slowing down takes effect at once, and so does a new direction of sideways motion.  Linear and angular speed
    increase by the same share of their differences, so that a robot at rest follows the commanded arc from the
    start.  The acceleration limits set this share.
    """
    goal, was, turn_goal = math.hypot(*wanted[0::2]), math.hypot(*before[0::2]), abs(wanted[1])
    along = sum(map(operator.mul, before[0::2], wanted[0::2]))
    # Nothing of a speed is kept if its direction reverses, and at most the wanted speed.
    rise = goal - (min(goal, was) if along > 0 else 0.0)
    turn_rise = turn_goal - max(0.0, min(turn_goal, before[1] * math.copysign(1.0, wanted[1])))
    time_s = max(rise / limits.linear_acceleration_m_s2, turn_rise / limits.angular_acceleration_rad_s2)
    lack = max(0.0, 1.0 - dt_s / time_s) if time_s else 0.0
    factor = 1.0 - lack * rise / (goal or math.inf)
    turn_factor = 1.0 - lack * turn_rise / (turn_goal or math.inf)
    return tuple(map(operator.mul, wanted, (factor, turn_factor, factor)))


def manual_speed_m_s(limits: Limits) -> float:
    """Return the usual speed in manual mode for a robot with these limits: half its speed, at most 0.25 m/s."""
    return min(FASTEST_MANUAL_M_S, limits.linear_m_s / 2)


def reduced(limits: Limits, speed_m_s: float) -> Limits:
    """Return the limits, with all speeds lowered by one factor so that the linear speed is at most `speed_m_s`.

    A joystick that is fully deflected then drives the same arc as in automatic mode.
    """
    share = min(1.0, speed_m_s / limits.linear_m_s)
    return limits._replace(
        linear_m_s=limits.linear_m_s * share,
        angular_rad_s=limits.angular_rad_s * share,
        lateral_m_s=limits.lateral_m_s * share,
    )
