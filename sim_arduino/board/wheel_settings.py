"""What the parameters mean to the control of a wheel, in fixed point.

Speeds and duties are shares: FULL is the full speed of parameter 18, or a duty of 100 %.  A period is the time between
two samples of the encoders, 4.992 ms.  A name that ends in qN is scaled by 2^N.
"""

from typing import NamedTuple, Optional

from .integers import UINT16_MAX
from .parameter_store import Config

FULL = 16384
PERIOD_TICKS = 78

MOST_COUNTS = 34_000_000  # largest number of counts a wheel turn [0.01]
FEWEST_Q8, MOST_Q8 = 64, 32767
COUNTS = 587  # 6000 / (4.992 ms * 256 * 8)
PER_COUNT_TICK = 327155712  # FULL * PERIOD_TICKS * 256
PER_COUNT = 26800596  # FULL * 4.992 ms / 200 ms * 256 * 256
PER_MM_S = 4005265287  # FULL * 256 * 6000 / (2 pi)
RAMP = 20937966  # FULL * 256 * 4.992 ms


class WheelSettings(NamedTuple):
    """Settings of all wheels."""

    full_counts_q8: int  # counts a period at full speed; 0 without encoders, and then no wheel is watched
    share_per_count_tick: int  # speed is counts times this, divided by ticks
    share_per_count_q8: int  # speed of a positional move for each count that is left: 1 / (200 ms)
    share_per_mm_s_q8: int
    share_per_mrad_s_q12: int
    ramp_q8: int  # largest change of the setpoint in a period
    kp_q10: int  # duty for each share of error
    target_gain_q10: int  # duty for each share of the setpoint: kp, but at least the feed-forward
    ki_q16: int  # duty for each share of error in a period
    friction: int  # duty at which a wheel begins to turn
    pause_periods: int  # periods for which a reversal rests at zero


NO_SETTINGS = WheelSettings(*[0] * len(WheelSettings._fields))  # before the parameters have been taken


def _times(value: int, factor_q16: int) -> int:
    return (value * factor_q16 + 32768 >> 16) & UINT16_MAX


def settings_of(config: Config) -> Optional[WheelSettings]:
    """Settings for these parameters.

    None if they cannot be controlled: fewer than 50 or more than 25000 counts/s at full speed, or a full speed below
    64 mm/s.
    """
    full_speed = config["full_speed"]
    counts = config["gearbox"] * config["encoder_counts"]
    if counts > MOST_COUNTS:
        return None
    full_q8 = (counts // 8 * full_speed + COUNTS // 2) // COUNTS
    per_mm_s = PER_MM_S // (full_speed * config["wheel_radius"])
    per_mrad_s = per_mm_s * config["axis_radius"] // 6250
    if not FEWEST_Q8 <= full_q8 <= MOST_Q8 or per_mm_s > UINT16_MAX or per_mrad_s > UINT16_MAX:
        return None
    ramp_ms = config["ramp_time"]
    has_encoders = not config["no_encoders"]
    friction, kp_q10 = _times(config["friction_duty"], 1073742), has_encoders * _times(config["kp"], 67109)
    return WheelSettings(
        has_encoders * full_q8,
        PER_COUNT_TICK // full_q8,
        PER_COUNT // full_q8,
        per_mm_s,
        per_mrad_s,
        RAMP // ramp_ms if ramp_ms else FULL << 8,
        kp_q10,
        max(kp_q10, (FULL - friction) // 16),
        has_encoders * _times(config["ki"], 21440),
        friction,
        _times(config["reversal_pause"], 13128) & 0xFF,
    )
