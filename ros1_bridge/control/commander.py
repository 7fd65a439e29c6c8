"""The node's commands to the driver: emergency stop, motor switch, operation mode, protective zones, and why the
robot stands.  No ROS.

The driver limits the speeds and owns the command timeout.  It also refuses commands while it is inhibited, so that no
command overtakes an emergency stop.  One lock keeps limits and mode together, `latched` and `enabled` with what the
driver refuses, and the cause of the last stop with the last command.
"""

import math
import time
from typing import Any, Callable, Optional, Tuple

from mrl_driver.clocks import slept_s
from mrl_driver.driver.options import QUEUED_S
from mrl_driver.lock_order import new_lock
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.models import Limits
from mrl_driver.safety.protective_zones import Zones
from mrl_driver.safety.speed_limiter import FASTEST_MANUAL_M_S, reduced
from mrl_driver.session.session import STALE_S

from .velocity_sources import Source, VelocitySources
from .wheel_motion import WheelMotion

PAUSED = f"this node stood still, and commands that were sent meanwhile are too old; try again after {QUEUED_S:g} s"
BLOCKING = (
    StopReason.EMERGENCY_STOP, StopReason.MOTORS_DISABLED, StopReason.NO_TELEMETRY, StopReason.MAY_BE_MOVING,
    StopReason.BATTERY, StopReason.HELD,
)  # fmt: skip
"""While one of them holds, no new command moves the robot."""
LOST_S = 1.0
"""After this time without telemetry, or suspended, goals of planners end: the robot must not set off after it [s]."""
REFUSALS = {
    StopReason.EMERGENCY_STOP: "the emergency stop is latched; call the service release_stop",
    StopReason.MOTORS_DISABLED: "the motors are disabled; call the service enable_motors with true",
}

INPUTS = (StopReason.BUMPER, StopReason.CLIFF, StopReason.EMERGENCY_STOP)
"""Stops of the board's inputs."""

Speeds = Tuple[float, ...]
"""Linear and angular speed; robots that move sideways add the lateral speed."""


class Commander:
    """Stands between the node's callbacks and a `Driver`; any thread may call it.

    Each method that moves or stops the robot raises the same errors as the driver's method.
    """

    def __init__(self, driver: Any, clock: Callable[[], float] = time.monotonic) -> None:
        self._driver, self._clock = driver, clock
        self._commanded_s = float("-inf")
        self._cause = StopReason.NONE
        self.latched = False  # the emergency stop is on: nothing moves until `release`
        self.enabled = True
        self.sources = VelocitySources()  # which sources of commands may move the robot
        self.cancel_goals: Callable[[bool], None] = lambda everything: None
        """Cancels all goals of planners, or those of before this moment alone.  It must not block."""
        self.zones: Optional[Zones] = None  # the protective zones, if there are any; see `watch`
        self.seeking = False
        """The node itself sends the commands, to drive to a pose; an emergency stop and disabled motors end it."""
        self.manual = False  # manual mode: reduced speed, and no drive to a pose; see `set_manual`
        self.manual_m_s = FASTEST_MANUAL_M_S  # highest speed in manual mode
        self._lock = new_lock("limits")
        self._limits: Optional[Limits] = None
        self._held = self._commanded = self._lost = False
        self._slept_s = slept_s()
        self._stops = 0  # stops so far: a command that one of them overtakes is not in force
        self.late_commands = 0  # operators' commands that arrived too late to be followed
        self._wheels = WheelMotion(driver)

    @property
    def in_force(self) -> Limits:
        """Limits of the present mode."""
        limits: Limits = self._driver.limits
        return limits

    @property
    def limits(self) -> Limits:
        """Limits of automatic mode; they may be replaced at any time."""
        return self._limits or self.in_force

    @limits.setter
    def limits(self, limits: Limits) -> None:
        with self._lock:
            self._limits = limits
            self._apply()

    def set_manual(self, manual: bool) -> bool:
        """Take a mode; returns whether it is another one.

        A command in force is lowered with the next frame; after that, only a new command is faster.
        """
        with self._lock:
            changes = manual != self.manual
            self._limits, self.manual = self.limits, manual
            self._apply()
        try:
            if manual and self.seeking:
                self.seeking = False
                self.stop(StopReason.MANUAL_MODE)
        finally:
            if changes:
                self.cancel_goals(True)
        return changes

    def _apply(self) -> None:
        limits = self.limits
        self._driver.limits = reduced(limits, self.manual_m_s) if self.manual else limits

    def watch(self, zones: Zones) -> None:
        """Let these zones limit each command."""
        self.zones = zones
        self._driver.restrict(self._within_zones)

    def drive(
        self, linear_m_s: float, angular_rad_s: float, *lateral_m_s: float, source: Optional[Source] = None
    ) -> bool:
        """Take a command; False if the robot may not move now (see `refusal`).  Only some bases move sideways.

        `source`: where it comes from; None if this node sends it.  A command of others ends the drive to a pose, unless
        its source must pause; `done` must follow it.
        """
        speeds, now = (linear_m_s, angular_rad_s, *lateral_m_s), self._clock()
        if source is not None:
            # If one is not finite, the driver stops the robot.
            moves = any(speeds) and all(map(math.isfinite, speeds))
            self._watch_suspension()
            refused = self.sources.may_move(source, now) if moves else StopReason.NONE
            if refused is not StopReason.NONE:
                if refused is StopReason.COMMAND_TOO_LATE and self.driving:  # by the first of them
                    self.stop(refused)
                self.refuse(refused)
                return False
            self.seeking = False
        with self._lock:
            self._cause, self._commanded_s, stops = StopReason.NONE, now, self._stops
        taken = self._driver.drive(*speeds)
        taken = taken or self._driver.command is not None  # held back while telemetry is late
        with self._lock:
            self._commanded = taken and self._stops == stops
            return self._commanded

    def done(self, source: Source) -> None:
        """The command of this source was carried out, or refused."""
        self.sources.done(source, self._clock())

    def refuse(self, cause: StopReason) -> None:
        """Note why a command is not followed."""
        with self._lock:
            self._cause = cause

    def stop(self, cause: StopReason = StopReason.NONE) -> None:
        """Stop at once; the next command moves the robot again."""
        self._note_stop(cause)
        self._driver.stop()

    def _note_stop(self, cause: StopReason) -> None:
        with self._lock:
            self._cause, self._commanded = cause, False
            self._stops += 1

    def latch(self) -> None:
        """Emergency stop: stop, and refuse commands until `release`.  It ends all goals."""
        try:
            with self._lock:  # a release on another thread comes before or after it
                self.latched = True
                self._inhibit(StopReason.EMERGENCY_STOP)
        finally:
            self.cancel_goals(True)

    def release(self) -> None:
        """End the emergency stop.  The robot stays still until a new command: goals and streams of commands that began
        before do not move it.
        """
        with self._lock:
            ends, self.latched = self.latched, False
            self._allow(StopReason.EMERGENCY_STOP, ends)
        if ends:
            self.cancel_goals(False)

    @property
    def emergency(self) -> bool:
        """The emergency stop is on: latched here, or by the board's input."""
        inputs = self._driver.inputs
        return self.latched or (inputs is not None and inputs.latched)

    def release_input(self) -> bool:
        """Release the emergency stop of the board's input, if it is on; False if it is still active."""
        inputs = self._driver.inputs
        if inputs is None or not inputs.latched:
            return True
        self.sources.distrust()
        released: bool = self._driver.release_emergency()
        self.cancel_goals(False)
        return released

    def enable(self, enabled: bool) -> None:
        """Let the motors follow new commands, or stop them, end all goals and refuse commands."""
        ends = False
        try:
            with self._lock:
                ends, self.enabled = enabled and not self.enabled, enabled
                if enabled:
                    self._allow(StopReason.MOTORS_DISABLED, ends)
                else:
                    self._inhibit(StopReason.MOTORS_DISABLED)
        finally:
            if ends or not enabled:
                self.cancel_goals(not enabled)

    def _inhibit(self, reason: StopReason) -> None:
        self.seeking = False
        self._note_stop(StopReason.NONE)
        self._driver.inhibit(reason)

    def _allow(self, reason: StopReason, ends: bool) -> None:
        """Let the driver follow commands; `ends`: it did not."""
        if ends:
            self.sources.distrust()  # before the driver follows them
        self._driver.allow(reason)

    def watch_link(self) -> None:
        """End all goals once telemetry has been silent for `LOST_S`; to be called some times a second."""
        lost = not self._driver.ready and self._driver.link.age_s > LOST_S
        if lost and not self._lost:
            self.end_goals()
        self._lost = lost
        self._watch_suspension()

    def _watch_suspension(self) -> None:
        """End all goals if the computer was suspended: nobody expects the robot to set off when it is woken."""
        before_s, self._slept_s = self._slept_s, slept_s()
        if self._slept_s > before_s + LOST_S:
            self.end_goals()

    def end_goals(self, stop: bool = True) -> None:
        """The board was away or has restarted, its power is off, or the computer was suspended.  The robot stands, and
        no goal and no command of before moves it again.  Without `stop`, the driver is already stopping it.

        Raises:
            MrlError: see `stop`; goals are ended nevertheless.
        """
        self.sources.distrust()
        try:
            if stop and self.driving:  # by a command that came just before
                self.stop()
        finally:
            self.cancel_goals(True)

    @property
    def wheels_turn(self) -> Optional[bool]:
        """The wheels turn, by their counts; None if that is not known."""
        return self._wheels.moving()

    @property
    def linked(self) -> bool:
        """Telemetry arrives, and with it the zones are checked."""
        ready: bool = self._driver.ready
        return ready

    @property
    def driving(self) -> bool:
        """A command other than standstill is in force."""
        command = self._driver.command
        return command is not None and any(command)

    @property
    def dropped(self) -> bool:
        """The driver has dropped the last command (for example on a lost link), or the board has stopped by itself."""
        if not self._commanded or self._driver.command is not None:
            return False
        silent = self._clock() - self._commanded_s >= STALE_S
        return silent or self._driver.stop_reason is not StopReason.COMMAND_TIMEOUT

    @property
    def stopped_by(self) -> StopReason:
        """Why the robot may not move, or why it stopped; `none` if there is no reason."""
        driver, ready, mismatch = self._driver, self._driver.ready, self._driver.mismatch
        if not ready and driver.may_be_moving:
            return StopReason.MAY_BE_MOVING
        if self.emergency or not self.enabled:
            return StopReason.EMERGENCY_STOP if self.emergency else StopReason.MOTORS_DISABLED
        if not ready:
            return StopReason.NO_TELEMETRY
        if driver.battery_state in ("empty", "off"):
            return StopReason.BATTERY
        if mismatch is not None:
            reason: StopReason = mismatch.reason
            return reason
        hold = driver.radio.hold
        if hold is not None and hold.held:
            return StopReason.HELD
        told: StopReason = driver.stop_reason
        if driver.command is not None:  # it says whether the robot stands
            return StopReason.PROTECTIVE_ZONE if self._held else StopReason.NONE
        never_driven = self._cause is StopReason.NONE and self._commanded_s == float("-inf")
        if told is StopReason.BOOT and never_driven:
            return StopReason.NONE  # the board was switched on
        own = self._cause is not StopReason.NONE or told in (StopReason.NONE, StopReason.USER)
        return self._cause if own else told

    @property
    def ready(self) -> bool:
        """The next command would move the robot."""
        return not self.wheel_fault and self.stopped_by not in BLOCKING

    @property
    def wheel_fault(self) -> bool:
        """The robot was stopped for a wheel, and waits for a stop or a command of zero."""
        return self._driver.mismatch is not None

    def refusal(self) -> str:
        """Why a command was refused, and what to do."""
        cause = self.stopped_by
        if cause == StopReason.BATTERY:
            driver = self._driver
            return f"the battery is {driver.battery_state} at {driver.board.battery_v:.1f} V, charge it"
        mismatch = self._driver.mismatch
        if mismatch is not None and cause == mismatch.reason:
            return f"{mismatch}; once that is put right, a command of zero lets it drive again"
        if cause == StopReason.HELD:
            return f"{self._driver.radio.hold}"
        inputs = self._driver.inputs
        if inputs is not None and (inputs.active or inputs.latched) and cause in INPUTS:
            return f"{inputs}"
        unlinked = (StopReason.NO_TELEMETRY, StopReason.MAY_BE_MOVING)
        if self._cause is StopReason.COMMAND_TOO_LATE and cause not in (*REFUSALS, *unlinked):
            return "it came at once with others after a silence, as if a network had held them back; send it again"
        if self._cause is StopReason.COMMANDS_UNPAUSED and cause not in (*REFUSALS, *unlinked):
            return (
                "its source has sent commands to move since before the last stop or this node's start; it may drive "
                f"after it has been silent or zero for {self.sources.pause_s:g} s"
            )
        if cause not in REFUSALS and self._driver.link.since_pause_s < QUEUED_S:
            return PAUSED
        silent = "the board is silent or just restarting; send the command again when telemetry is back"
        return REFUSALS.get(cause, silent)

    def _within_zones(self, speeds: Speeds, now: float) -> Speeds:
        """Return the speeds as far as the zones allow them; the driver asks with its lock held."""
        assert self.zones is not None
        linear, angular, *lateral = speeds
        if not lateral:
            allowed = self.zones.limit(linear, now)
            self._held = linear != 0 and allowed == 0
            return allowed, angular
        forward, left = self.zones.limited((linear, lateral[0]), now)
        self._held = bool(linear or lateral[0]) and not (forward or left)
        return forward, angular, left


def lowered(limits: Limits, *wanted: float) -> Limits:
    """The model's limits, each lowered to the wanted value (same order); 0 keeps the model's limit."""
    lower = (min(most, own) if most > 0 else own for most, own in zip(wanted, limits))
    return Limits(*lower, *limits[len(wanted) :])
