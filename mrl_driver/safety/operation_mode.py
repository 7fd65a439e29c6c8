"""Operation modes: automatic, and manual with reduced speed.  No I/O.

A mode is a set of limits for the speed limiter, which stays the only one that limits speeds.
"""

from mrl_driver.robot.models import Limits

AUTOMATIC, MANUAL = "automatic", "manual"
OPERATION_MODES = (AUTOMATIC, MANUAL)
FASTEST_MANUAL_M_S = 0.25
"""Highest speed in manual mode [m/s]: ISO 10218-1 allows 250 mm/s in manual mode with reduced speed."""


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
