"""Finds a wheel that does not turn, and an encoder that is silent or counts in the wrong direction."""

from mrl_driver.protocol.stop_reason import StopReason

from .wheel_settings import FULL, WheelSettings

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
    """Supervision of one wheel; see wheel_watch.cpp."""

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
            self._settled = along >= 0
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
