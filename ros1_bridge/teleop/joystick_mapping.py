"""Converts axes, buttons and tilt of a joystick to speeds while the dead-man button is held.  Pure."""

import math
from typing import Dict, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.geometry import GRAVITY_M_S2

DEAD_ZONE = 0.08  # a released stick rests within this share of its full travel
REPEATED_S = 0.3
"""A joystick whose messages repeat one stamp for longer than this is lost [s]: wiimote_node keeps publishing the last
state of a Wiimote that is out of reach or empty, and a held button would stay held.
"""
TILT_DEAD_RAD, TILT_FULL_RAD = math.radians(5), math.radians(30)
"""Tilt from the neutral position below which a Wiimote does not drive, and from which it drives at full speed."""
SMOOTH_S = 0.1
"""Time constant of the low-pass for the Wiimote's accelerations [s]: a hand trembles at 8 to 12 Hz."""
UNSTEADY = 0.4
"""A Wiimote is shaken, or falls, if its acceleration differs from gravity by more than this share, smoothed."""
STEEPEST_RAD = math.radians(45)  # the neutral position must be at most this far from flat
PAUSE_S = 0.5  # after a gap of this time the low-pass begins again [s]

Shares = Tuple[float, float]
"""Shares of the full speeds: linear and angular, -1 to 1."""


class Layout(NamedTuple):
    """Layout of a joystick; numbers are indices into axes and buttons of sensor_msgs/Joy, None means absent."""

    dead_man: int
    linear_axis: Optional[int] = None
    angular_axis: Optional[int] = None
    forward: Optional[int] = None
    back: Optional[int] = None
    left: Optional[int] = None
    right: Optional[int] = None
    tilt: bool = False  # axes 0 to 2 are the accelerations of a Wiimote, which steers by its tilt


LAYOUTS: Dict[str, Layout] = {
    # Linux hid-sony since 4.12: left stick is axes 0 and 1, L1 is button 4, the cross is buttons 13 to 16.
    "ps3": Layout(dead_man=4, linear_axis=1, angular_axis=0, forward=13, back=14, left=15, right=16),
    # wiimote_node: 1, 2, A, B, +, -, left, right, up, down, HOME; held sideways, the cross turns by 90 deg.
    "wiimote": Layout(dead_man=3, forward=7, back=6, left=8, right=9),
    # Held flat, pointing ahead: the cross as it is printed.
    "wiimote_tilt": Layout(dead_man=3, forward=8, back=9, left=6, right=7, tilt=True),
}


class Joystick:
    """Speeds from the messages of one joystick.

    Attributes:
        trouble: why the joystick does not drive though its dead-man button is held; empty if it may.  It lasts until
            the button is released.
    """

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._tilt = Tilt() if layout.tilt else None
        self._stamp_s, self._new_s = 0.0, -math.inf
        self.trouble = ""

    def shares(
        self, axes: Sequence[float], buttons: Sequence[int], stamp_s: float, now_s: float
    ) -> Optional[Shares]:
        """Shares of the full speeds; None while the dead-man button is not held, or the joystick is lost.

        Args:
            axes, buttons: of the message.
            stamp_s: of the message, on any clock; 0 if it has none [s].
            now_s: time of its arrival [s].
        """
        if stamp_s != self._stamp_s or not stamp_s:
            self._stamp_s, self._new_s = stamp_s, now_s
        crossed = shares_of(self._layout, axes, buttons)
        if crossed is None:
            self.trouble = ""
        elif now_s - self._new_s > REPEATED_S:
            self.trouble = "the joystick is lost: its messages repeat an old state"
            return None
        tilted = self._tilt.update(axes, crossed is not None, now_s) if self._tilt is not None else (0.0, 0.0)
        if crossed is None:
            return None
        self.trouble = self.trouble or (self._tilt.trouble if self._tilt is not None else "")
        if self.trouble:
            return 0.0, 0.0
        return crossed if any(crossed) else tilted


class Tilt:
    """Speeds from the tilt of a Wiimote: nose down drives forward, right side down turns right.

    wiimote_node's axes are accelerations [m/s2]: x to the left, y back, z up; one that rests flat shows gravity on z.
    The position in which the dead-man button is pressed is the neutral one, so that the press alone moves nothing and
    the hand may be at rest.

    Attributes:
        trouble: why the tilt does not drive now; empty if it may.
    """

    def __init__(self) -> None:
        self._mean = (0.0, 0.0, 0.0)
        self._unsteady = math.inf
        self._neutral: Optional[Tuple[float, float]] = None
        self._updated_s = -math.inf
        self.trouble = ""

    def update(self, axes: Sequence[float], held: bool, now_s: float) -> Shares:
        """Shares of the full speeds after a message; `held` says that the dead-man button is held."""
        self._smooth(axes, now_s)
        if not held:
            self._neutral, self.trouble = None, ""
            return 0.0, 0.0
        self.trouble = self._find_trouble(axes)
        if self.trouble:
            return 0.0, 0.0
        x, y, z = self._mean
        pitch = math.atan2(y, math.hypot(x, z))  # of the nose
        roll = math.atan2(x, math.hypot(y, z))  # of the right side
        if self._neutral is None:
            self._neutral = pitch, roll
        return _tilt_share(pitch - self._neutral[0]), -_tilt_share(roll - self._neutral[1])

    def _smooth(self, axes: Sequence[float], now_s: float) -> None:
        if len(axes) < 3:
            return
        x, y, z = axes[:3]
        unsteady = abs(math.hypot(math.hypot(x, y), z) / GRAVITY_M_S2 - 1)
        gap_s = now_s - self._updated_s
        self._updated_s = now_s
        if not gap_s < PAUSE_S or not math.isfinite(self._unsteady):
            self._mean, self._unsteady = (x, y, z), unsteady
            return
        part = 1 - math.exp(-max(0.0, gap_s) / SMOOTH_S)
        old_x, old_y, old_z = self._mean
        self._mean = old_x + part * (x - old_x), old_y + part * (y - old_y), old_z + part * (z - old_z)
        self._unsteady += part * (unsteady - self._unsteady)

    def _find_trouble(self, axes: Sequence[float]) -> str:
        if len(axes) < 3:
            return f"the message has {len(axes)} axes, expected the 3 accelerations of a Wiimote"
        if not self._unsteady <= UNSTEADY:
            return "the Wiimote is shaken or falls"
        up = self._mean[2] / math.hypot(math.hypot(*self._mean[:2]), self._mean[2])
        if up <= 0 or (self._neutral is None and up < math.cos(STEEPEST_RAD)):
            return f"the Wiimote is {math.degrees(math.acos(up)):.0f} deg from flat; hold it flat"
        return ""


def shares_of(layout: Layout, axes: Sequence[float], buttons: Sequence[int]) -> Optional[Shares]:
    """Shares of the full speeds by sticks and buttons; None while the dead-man button is not held."""

    def held(index: Optional[int]) -> bool:
        return index is not None and index < len(buttons) and bool(buttons[index])

    def stick(index: Optional[int]) -> float:
        share = axes[index] if index is not None and index < len(axes) else 0.0
        return share if abs(share) > DEAD_ZONE else 0.0

    if not held(layout.dead_man):
        return None
    linear = stick(layout.linear_axis) + held(layout.forward) - held(layout.back)
    angular = stick(layout.angular_axis) + held(layout.left) - held(layout.right)
    return max(-1.0, min(1.0, linear)), max(-1.0, min(1.0, angular))


def _tilt_share(angle_rad: float) -> float:
    share = (abs(angle_rad) - TILT_DEAD_RAD) / (TILT_FULL_RAD - TILT_DEAD_RAD)
    return math.copysign(max(0.0, min(1.0, share)), angle_rad)
