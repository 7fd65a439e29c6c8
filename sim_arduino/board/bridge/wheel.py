"""One wheel: its target, its ramp, the control of its speed, and its supervision."""

from enum import Enum

from mrl_driver.protocol.stop_reason import StopReason

from .integers import INT16_MAX, limit, sign, uint16
from .speed_estimate import SpeedEstimate
from .wheel_settings import FULL, WheelSettings
from .wheel_watch import WheelWatch

REACHED = 2  # counts within which a positional move is at its end
FAR = 5000
SLOWEST = FULL // 64  # speed of a positional move near its end
INTEGRAL_MOST = FULL << 16


class Mode(Enum):
    """What a wheel is controlled by."""

    SPEED = "speed"
    DUTY = "duty"
    POSITION = "position"


class Wheel:
    """Counts in, duty out; see wheel.cpp.  Speeds and duties are shares of FULL."""

    def __init__(self) -> None:
        self.travel = 0  # the sum of all counts
        self.last_direction = 1  # direction of the last drive, in which single-channel encoders count
        self._estimate, self._watch = SpeedEstimate(), WheelWatch()
        self._mode = Mode.SPEED
        self._target = self._go_to = 0
        self._setpoint_q8 = 0
        self._direction = 0
        self._pause, self._paused = 0, True
        self._integral_q16 = self._duty = self._carry = 0
        self._edge_tick = 0

    # ---- targets

    def set_speed(self, speed: int) -> None:
        """Turns at a speed."""
        self._set(Mode.SPEED, speed)

    def set_duty(self, duty: int) -> None:
        """Turns without control of the speed."""
        self._set(Mode.DUTY, duty)

    def go_to(self, travel: int, speed: int) -> None:
        """Turns to a travel at this speed at most, and comes back when it is pushed away."""
        self._go_to = travel
        self._set(Mode.POSITION, abs(speed))

    def stop(self) -> None:
        """Switches the output off at once, without a ramp."""
        self._set(Mode.SPEED, 0)
        self._setpoint_q8 = self._integral_q16 = self._duty = 0

    def _set(self, mode: Mode, target: int) -> None:
        if mode is not self._mode:
            self._integral_q16 = 0
        self._mode, self._target = mode, target

    # ---- one period

    def update(self, settings: WheelSettings, moved: int, edge_tick: int, tick: int) -> StopReason:
        """The counts and the tick of the last edge at the end of the period; why the motors must stop, or "none"."""
        edges = edge_tick != self._edge_tick
        self._edge_tick = edge_tick
        self.travel += moved
        self._estimate.update(settings, uint16(self.travel), edge_tick, tick)
        reason = self._watch.update(
            settings,
            self._direction,
            self._duty,
            moved,
            edges,
            self._estimate.speed,
            self._mode is not Mode.DUTY,
        )
        self._ramp(settings, self._approach(settings) if self._mode is Mode.POSITION else self._target)
        self._control(settings)
        return reason

    def _approach(self, settings: WheelSettings) -> int:
        """Speed of a positional move, which falls with the way that is left."""
        left = self._go_to - self.travel
        if abs(left) <= REACHED:
            return 0
        speed = settings.share_per_count_q8 * min(FAR, abs(left)) >> 8
        magnitude = min(self._target, limit(speed, SLOWEST, FULL))
        return -magnitude if left < 0 else magnitude

    def _ramp(self, settings: WheelSettings, target: int) -> None:
        """Moves the setpoint by at most the ramp; a reversal passes through zero and rests there."""
        wanted = sign(target)
        if self._pause:
            self._pause -= 1
        if not self._direction and (not wanted or (self._pause and wanted != self.last_direction)):
            self._come_to_rest(settings)
            return
        turns_back = self._direction != 0 and wanted != self._direction
        goal = 0 if turns_back else abs(target) << 8
        at_once = self._mode is Mode.POSITION and goal < self._setpoint_q8
        step = self._setpoint_q8 if at_once else settings.ramp_q8
        self._setpoint_q8 += limit(goal - self._setpoint_q8, -step, step)
        if not self._setpoint_q8:
            self._come_to_rest(settings)
        elif not self._direction:
            self._direction = self.last_direction = wanted
            self._paused = False

    def _come_to_rest(self, settings: WheelSettings) -> None:
        if not self._paused:
            self._pause = settings.pause_periods
        self._paused = True
        self._direction = self._integral_q16 = 0

    def _control(self, settings: WheelSettings) -> None:
        setpoint = self._setpoint_q8 >> 8
        if not self._direction or self._mode is Mode.DUTY:
            self._duty = setpoint if self._direction else 0
            return
        speed = self._estimate.speed if self._direction > 0 else -self._estimate.speed
        wanted = (
            settings.friction
            + (settings.target_gain_q10 * setpoint >> 10)
            - (settings.kp_q10 * speed >> 10)
            + (self._integral_q16 >> 16)
        )
        self._duty = limit(wanted, 0, FULL)
        error = limit(setpoint - speed, -INT16_MAX, INT16_MAX)
        if wanted != self._duty and (wanted > FULL) == (error > 0):
            return
        self._integral_q16 = limit(
            self._integral_q16 + settings.ki_q16 * error, -INTEGRAL_MOST, INTEGRAL_MOST
        )

    # ---- what comes out

    def level(self) -> int:
        """The output for the next period, -255 to 255; its mean over the periods is the duty."""
        if not self._duty:
            return 0
        total = self._duty * 255 + self._carry
        self._carry = total & (FULL - 1)
        return (total >> 14) * (1 if self._direction > 0 else -1)
