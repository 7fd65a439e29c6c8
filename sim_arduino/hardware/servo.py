"""A servo for models: it turns to the angle that the length of its last pulse stands for."""

import math

RAD_PER_US, MIDDLE_US = math.pi / 2 / 1000, 1500.0
"""Usual servos turn by 90 degrees for 1 ms, about the middle; assumed."""
SPEED_RAD_S = math.radians(60) / 0.15
"""Speed without load, as on the label of a usual servo: 60 degrees in 0.15 s; assumed."""
LIMP_S = 0.06  # without a pulse for this time a servo does not drive [s]; assumed


class Servo:
    """A servo that follows the level of its wire.  Times are seconds; they never decrease.

    Attributes:
        stalled: Something holds it: it does not turn.
    """

    def __init__(self) -> None:
        self.stalled = False
        self._angle_rad = self._moved_s = 0.0
        self._length_us = 0.0
        self._rise_s = self._pulse_s = -math.inf

    def changed(self, level: int, time_s: float) -> None:
        """Its wire has this level from now on."""
        if level:
            self.angle_rad(time_s)
            self._rise_s = time_s
        elif self._rise_s > self._pulse_s:
            self.angle_rad(time_s)
            self._pulse_s, self._length_us = self._rise_s, (time_s - self._rise_s) * 1e6

    def pulse_us(self, time_s: float) -> float:
        """Length of the last pulse [us]; 0 if it was too long ago to drive the servo."""
        return self._length_us if time_s - self._pulse_s < LIMP_S else 0.0

    def angle_rad(self, time_s: float) -> float:
        """Its angle [rad]; it does not turn without pulses."""
        passed_s, self._moved_s = max(0.0, time_s - self._moved_s), max(time_s, self._moved_s)
        if self.pulse_us(time_s) and not self.stalled:
            left, most = (self._length_us - MIDDLE_US) * RAD_PER_US - self._angle_rad, SPEED_RAD_S * passed_s
            self._angle_rad += max(-most, min(most, left))
        return self._angle_rad
