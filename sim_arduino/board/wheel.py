"""One wheel of an H-bridge board, in the integer arithmetic of the firmware: its target, its ramp, the control of its
speed, and its supervision, as in wheel.cpp, speed_estimate.cpp and wheel_watch.cpp.
"""

from enum import Enum
from typing import List, NamedTuple

from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.stop_reason import StopReason

from .integers import INT16_MAX, limit, sign, uint16
from .wheel_settings import FULL, PERIOD_TICKS, WheelSettings

CYCLE = 4  # edges of both channels in a cycle; they are not evenly spaced
LEAST_TICKS = 120
MOST_COUNTS = 400
STANDING = 200  # samples without a change after which the wheel stands
MARKS = 5


class Mark(NamedTuple):
    """Counter and time [64 us] of its last edge, or of a sample without one."""

    counter: int
    tick: int


class SpeedEstimate:
    """Counts by time between the last edges of two samples, which are at least a cycle apart."""

    def __init__(self) -> None:
        self.speed = 0  # signed share of full speed
        self._marks: List[Mark] = []
        self._quiet = 0
        self._counts, self._ticks = 0, 1
        self._backward = False

    def update(self, settings: WheelSettings, count: int, edge_tick: int, tick: int) -> None:
        """Takes a sample: the counter, the tick of its last edge, the tick of the sample (uint16)."""
        if not self._marks:
            self._rest(count, tick)
        elif count == self._marks[0].counter:
            self._quiet = min(STANDING, self._quiet + 1)
            if self._quiet == STANDING:
                self._rest(count, tick)
            else:
                self._fade(settings, uint16(tick - self._marks[0].tick))
        else:
            self._quiet = 0
            self._marks = [Mark(count, edge_tick), *self._marks[: MARKS - 1]]
            self._measure(settings)

    def _rest(self, count: int, tick: int) -> None:
        self._marks = [Mark(count, tick)]
        self._quiet = STANDING
        self._counts = self.speed = 0

    def _measure(self, settings: WheelSettings) -> None:
        newest, counts = self._marks[0], 0
        for mark in self._marks[1:]:
            counts = to_int16(newest.counter - mark.counter)
            self._ticks = uint16(newest.tick - mark.tick)
            if abs(counts) >= CYCLE and self._ticks >= LEAST_TICKS:
                break
        self._backward = counts < 0
        self._counts = min(MOST_COUNTS, abs(counts))
        self._ticks = max(PERIOD_TICKS, self._ticks)
        self._set_speed(settings.share_per_count_tick * self._counts // self._ticks)

    def _fade(self, settings: WheelSettings, waited: int) -> None:
        """Without an edge for 1.5 times as long as expected, the wheel is slower than it was."""
        if 2 * waited * self._counts > 3 * self._ticks:
            self._set_speed(settings.share_per_count_tick * 3 // 2 // waited)

    def _set_speed(self, magnitude: int) -> None:
        most = min(INT16_MAX, magnitude)
        self.speed = -most if self._backward else most


WRONG_PERIODS = 16
WRONG_COUNTS = 2
PATIENCE = 100
ALIVE = 16  # counts after which an encoder is known to work
DRIVEN, AT_FULL = FULL // 2, FULL // 16 * 15
PLAY = 2  # counts within which a wheel has not moved
SILENT_PERIODS, BLOCKED_PERIODS = 20, 40
EXPECTED_Q8 = 32 << 8
_UINT8_MAX = 255
NONE, ENCODER, BLOCKED = StopReason.NONE, StopReason.ENCODER, StopReason.WHEEL_BLOCKED


class WheelWatch:
    """Finds a wheel that does not turn, and an encoder that is silent or counts in the wrong direction."""

    def __init__(self) -> None:
        self._direction = 0
        self._settled = False
        self._patience = 0
        self._wrong_periods = self._wrong_counts = 0
        self._seen = 0
        self._restart()

    def update(
        self,
        settings: WheelSettings,
        direction: int,
        duty: int,
        moved: int,
        edges: bool,
        speed: int,
        controlled: bool,
    ) -> StopReason:
        """One period: the drive's direction and duty, the counts, whether there were edges, and the measured speed.

        Returns why the motors must stop, or "none".  Wrong counts matter only if the speed is `controlled`.
        """
        if moved:
            self._seen = min(ALIVE, self._seen + 1)
        if direction != self._direction:
            self._note_direction(direction, speed)
        if not direction:
            return NONE
        along = moved if direction > 0 else -moved
        if controlled and self._counts_wrong(along):
            return ENCODER
        return self._check_movement(settings, duty, along, edges, controlled)

    def _note_direction(self, direction: int, speed: int) -> None:
        self._direction = direction
        self._settled = speed >= 0 if direction > 0 else speed <= 0
        self._patience = PATIENCE
        self._wrong_periods = 0
        self._restart()

    def _counts_wrong(self, along: int) -> bool:
        if not self._settled:
            self._settled = along > 0
            if not self._settled:
                self._patience -= 1
                self._settled = not self._patience
            return False
        if not self._wrong_periods:
            if along >= 0:
                return False
            self._wrong_counts = 0
        self._wrong_periods += 1
        self._wrong_counts -= along
        over = self._wrong_periods > WRONG_PERIODS
        wrong = over and self._wrong_counts >= WRONG_COUNTS
        if over or self._wrong_counts <= 0:
            self._wrong_periods = 0
        return wrong

    def _restart(self) -> None:
        self._driven = self._with_edges = self._at_full = 0
        self._net = self._expected_q8 = 0

    def _check_movement(
        self, settings: WheelSettings, duty: int, along: int, edges: bool, controlled: bool
    ) -> StopReason:
        self._net += along
        if duty < DRIVEN or abs(self._net) > PLAY:
            self._restart()
            return NONE
        self._driven = min(_UINT8_MAX, self._driven + 1)
        if edges:
            self._with_edges = min(_UINT8_MAX, self._with_edges + 1)
        if duty >= AT_FULL:
            self._at_full = min(_UINT8_MAX, self._at_full + 1)
        if self._expected_q8 < EXPECTED_Q8:
            self._expected_q8 += settings.full_counts_q8 * duty >> 14
        if self._driven < SILENT_PERIODS or self._expected_q8 < EXPECTED_Q8:
            return NONE
        silent = self._with_edges > self._driven // 2 or self._seen < ALIVE
        if controlled and silent:
            return ENCODER
        return BLOCKED if self._at_full >= BLOCKED_PERIODS else NONE


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
    """Counts in, duty out.  Speeds and duties are shares of FULL."""

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

    def turns(self, backward: bool) -> bool:
        """Whether it is driven forward, or backward, or will be; a move to a travel may do both."""
        driven = bool(self._setpoint_q8) and (self._direction < 0) == backward
        return self._mode is Mode.POSITION or driven or (self._target != 0 and (self._target < 0) == backward)

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
