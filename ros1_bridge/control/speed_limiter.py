"""Limits the node's commands before they reach the driver: speeds, timeout, emergency stop.  No ROS.

Speeding up is limited.  Slowing down and stopping are not limited, so that a stop is never delayed.
"""

import math
import threading
import time
from typing import Any, Callable, Optional, Tuple

from mrl_driver.navigation.protective_zones import Zones
from mrl_driver.robot.models import Limits

FIRST_STEP_S, LONGEST_STEP_S = 0.02, 0.1
"""Time of the first acceleration step, and of the longest one.

A command from standstill takes effect at once, as if it were one frame of the stream old.  After a pause, a step
accelerates for at most the longer time.
"""
EMERGENCY, DISABLED, LINK, BATTERY = "emergency stop", "motors disabled", "no telemetry", "battery"
WHEEL = "wheel mismatch"
ADRIFT = "no telemetry, may still be moving"
"""The link to a board without a watchdog was lost while the robot drove."""
ZONE = "protective zone"
TIMEOUT, NOT_FINITE, NONE = "command timeout", "command not finite", "none"
REFUSALS = {
    EMERGENCY: "the emergency stop is latched; call the service release_stop",
    DISABLED: "the motors are disabled; call the service enable_motors with true",
}
SILENT_S = 0.28
"""A caller that commands on every telemetry frame has received no frame for this long."""
_FASTEST = 1e6
"""Beyond this [m/s, rad/s] the arc of a command is not kept, because the scale overflows near the largest floats."""

Speeds = Tuple[float, ...]
"""Linear and angular speed; robots that move sideways add the lateral speed."""
STANDING: Speeds = (0.0, 0.0)


class Commander:
    """Stands between the node's callbacks and a `Driver`; any thread may call it.

    One call runs at a time.  Each call holds the lock while the driver writes, at most 100 ms if the port is stuck.
    `tick` runs on the reading thread and waits at most this long.

    Each method that moves or stops the robot raises the same errors as the driver's method.
    """

    def __init__(
        self, driver: Any, limits: Limits, timeout_s: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._driver, self._clock = driver, clock
        self._timeout_s = timeout_s
        self._lock = threading.Lock()
        self._target: Optional[Speeds] = None
        self._now = STANDING
        self._commanded_s = self._stepped_s = float("-inf")
        self._cause = NONE
        self.limits = limits
        """Limits in force; they may be replaced at any time."""
        self.latched = False
        """The emergency stop is on: nothing moves until `release`."""
        self.enabled = True
        self.zones: Optional[Zones] = None
        """If set, the zones limit each command."""
        self.seeking = False
        """The node itself sends the commands, to drive to a pose."""
        self._held = self._dropped = False

    def drive(self, linear_m_s: float, angular_rad_s: float, *lateral_m_s: float) -> bool:
        """Take a command; False if the robot may not move now (see `refusal`).  Only some bases move sideways."""
        with self._lock:
            if self.latched or not self.enabled:
                return False
            now = self._commanded_s = self._clock()
            self._cause, self._dropped = NONE, False
            self._target = scaled(linear_m_s, angular_rad_s, self.limits, *lateral_m_s)
            return self._step(now)

    def tick(self) -> None:
        """Continue to accelerate, and stop after the command timeout; called for each frame of the stream."""
        if self._target is None:  # the common case, which does not need the lock
            return
        with self._lock:
            if self._target is None:
                return
            now = self._clock()
            if now - self._commanded_s >= self._timeout_s:
                self._halt(TIMEOUT if any(self._target) else NONE)
            elif self._driver.command is None:  # stopped by driver or board: a new command must drive again
                self._target, self._now, self._held, self._dropped = None, STANDING, False, True
            elif self.zones is not None:
                if self._within_zones(now) != self._now:
                    self._step(now)
            elif self._now != self._target:
                self._step(now)

    def stop(self, cause: str = NONE) -> None:
        """Stop at once; the next command moves the robot again."""
        with self._lock:
            self._halt(cause)

    def latch(self) -> None:
        """Emergency stop: stop, and refuse commands until `release`."""
        with self._lock:
            self.latched = True
            self._halt(NONE)

    def release(self) -> None:
        """End the emergency stop; the robot stays still until the next command."""
        with self._lock:
            self.latched = False

    def enable(self, enabled: bool) -> None:
        """Let the motors follow commands, or stop them and refuse commands."""
        with self._lock:
            self.enabled = enabled
            if not enabled:
                self._halt(NONE)

    @property
    def moving(self) -> bool:
        """A command other than standstill is in force."""
        command = self._driver.command
        return command is not None and any(command)

    @property
    def dropped(self) -> bool:
        """The driver has dropped the last command (for example on a lost link), or the board has stopped by itself."""
        with self._lock:
            if self._target is None:
                return self._dropped
            silent = self._clock() - self._commanded_s >= SILENT_S
            return self._driver.command is None and (silent or self._driver.stop_reason != "command_timeout")

    @property
    def stopped_by(self) -> str:
        """Why the robot may not move, or why it stopped; `none` if there is no reason."""
        if not self._driver.ready and self._driver.may_be_moving:
            return ADRIFT
        if self.latched or not self.enabled:
            return EMERGENCY if self.latched else DISABLED
        if not self._driver.ready:
            return LINK
        if self._driver.battery_state in ("empty", "off"):
            return BATTERY
        if self._driver.mismatch is not None:
            return WHEEL
        if self._held:
            return ZONE
        told = self._driver.stop_reason
        if self._driver.command is not None:
            return NONE  # if the robot stands still, its command says so
        if told == "boot" and self._commanded_s == float("-inf"):
            return NONE  # the board was switched on, and nobody has driven yet
        return self._cause if self._cause != NONE or told in ("none", "user") else told.replace("_", " ")

    @property
    def ready(self) -> bool:
        """The next command would move the robot."""
        return self.stopped_by not in (EMERGENCY, DISABLED, LINK, ADRIFT, BATTERY, WHEEL)

    def refusal(self) -> str:
        """Why a command was refused, and what to do."""
        cause = self.stopped_by
        if cause == BATTERY:
            driver = self._driver
            return f"the battery is {driver.battery_state} at {driver.battery_v:.1f} V, charge it"
        if cause == WHEEL:
            return f"{self._driver.mismatch}; once that is put right, a command of zero lets it drive again"
        return REFUSALS.get(
            cause, "the board is silent or just restarting; send the command again when telemetry is back"
        )

    def _halt(self, cause: str) -> None:
        self._target, self._now, self._cause, self._held = None, STANDING, cause, False
        self._driver.stop()

    def _step(self, now: float) -> bool:
        assert self._target is not None
        limits, wanted = self.limits, self._within_zones(now)
        dt_s, self._stepped_s = min(LONGEST_STEP_S, now - self._stepped_s), now
        before = self._now
        if not any(before) or self._driver.command is None:  # stopped meanwhile, for any reason
            before, dt_s = (0.0,) * len(wanted), FIRST_STEP_S
        speeds = ramped(before, wanted, limits, dt_s)
        self._now = speeds
        if self._driver.drive(*speeds):
            return True
        self._target, self._now, self._held = None, STANDING, False
        return False

    def _within_zones(self, now: float) -> Speeds:
        """The target speeds, as far as the zones allow them."""
        assert self._target is not None
        if self.zones is None:
            return self._target
        linear, angular, *lateral = self._target
        if not lateral:
            allowed = self.zones.limit(linear, now)
            self._held = linear != 0 and allowed == 0
            return allowed, angular
        forward, left = self.zones.limited((linear, lateral[0]), now)
        self._held = bool(linear or lateral[0]) and not (forward or left)
        return forward, angular, left


def ramped(before: Speeds, wanted: Speeds, limits: Limits, dt_s: float) -> Speeds:
    """The next speeds on the way from `before` to `wanted`.

    Slowing down takes effect at once, and so does a new direction of sideways motion.  Linear and angular speed
    increase by the same share of their differences, so that a robot at rest follows the commanded arc from the
    start.  The acceleration limits set this share.
    """
    plane, turn = wanted[0::2], wanted[1:2]
    plane_base, turn_base = _kept(before[0::2], plane), _kept(before[1:2], turn)
    share = min(
        _share(plane_base, plane, limits.linear_acceleration_m_s2 * dt_s),
        _share(turn_base, turn, limits.angular_acceleration_rad_s2 * dt_s),
    )
    linear, *lateral = _part(plane_base, plane, share)
    return (linear, *_part(turn_base, turn, share), *lateral)


def _kept(before: Speeds, wanted: Speeds) -> float:
    """The part of a speed that is kept: nothing if the direction reverses, and at most the wanted speed."""
    along = sum(one * other for one, other in zip(before, wanted))
    return min(math.hypot(*wanted), math.hypot(*before) if along > 0 else 0.0)


def _share(base: float, wanted: Speeds, rise: float) -> float:
    """Share of the difference that this step may cover, 0 to 1."""
    excess = math.hypot(*wanted) - base
    return rise / excess if excess > rise else 1.0


def _part(base: float, wanted: Speeds, share: float) -> Speeds:
    goal = math.hypot(*wanted)
    if share == 1.0 or goal == base:
        return wanted
    return tuple(speed * (base + share * (goal - base)) / goal for speed in wanted)


def scaled(linear_m_s: float, angular_rad_s: float, limits: Limits, *lateral_m_s: float) -> Speeds:
    """The speeds, scaled down together if one exceeds its limit; arc and direction stay the same."""
    if lateral_m_s:
        return _scaled_in_plane(linear_m_s, angular_rad_s, limits, lateral_m_s[0])
    if abs(linear_m_s) <= limits.linear_m_s and abs(angular_rad_s) <= limits.angular_rad_s:
        return linear_m_s, angular_rad_s
    linear_m_s = max(-_FASTEST, min(_FASTEST, linear_m_s))
    angular_rad_s = max(-_FASTEST, min(_FASTEST, angular_rad_s))
    excess = max(abs(linear_m_s) / limits.linear_m_s, abs(angular_rad_s) / limits.angular_rad_s, 1.0)
    return linear_m_s / excess, angular_rad_s / excess


def _scaled_in_plane(linear_m_s: float, angular_rad_s: float, limits: Limits, lateral_m_s: float) -> Speeds:
    speeds = [max(-_FASTEST, min(_FASTEST, speed)) for speed in (linear_m_s, angular_rad_s, lateral_m_s)]
    excess = max(
        math.hypot(speeds[0], speeds[2]) / limits.linear_m_s,
        abs(speeds[1]) / limits.angular_rad_s,
        abs(speeds[2]) / (limits.lateral_m_s or limits.linear_m_s),
        1.0,
    )
    return tuple(speed / excess for speed in speeds)


def lowered(limits: Limits, *wanted: float) -> Limits:
    """The model's limits, each lowered to the wanted value (same order); 0 keeps the model's limit."""
    lower = (min(most, own) if most > 0 else own for most, own in zip(wanted, limits))
    return Limits(*lower, *limits[len(wanted) :])
