"""Converts axes and buttons of a joystick to speeds while the dead-man button is held.  Pure."""

from typing import Dict, NamedTuple, Optional, Sequence, Tuple

DEAD_ZONE = 0.08
"""A released stick rests within this share of its full travel."""


class Layout(NamedTuple):
    """Layout of a joystick; numbers are indices into axes and buttons of sensor_msgs/Joy, None means absent."""

    dead_man: int
    linear_axis: Optional[int] = None
    angular_axis: Optional[int] = None
    forward: Optional[int] = None
    back: Optional[int] = None
    left: Optional[int] = None
    right: Optional[int] = None


LAYOUTS: Dict[str, Layout] = {
    # Linux hid-sony since 4.12: left stick is axes 0 and 1, L1 is button 4, the cross is buttons 13 to 16.
    "ps3": Layout(dead_man=4, linear_axis=1, angular_axis=0, forward=13, back=14, left=15, right=16),
    # wiimote_node: 1, 2, A, B, +, -, left, right, up, down, HOME; held sideways, the cross turns by 90 deg.
    "wiimote": Layout(dead_man=3, forward=7, back=6, left=8, right=9),
}


def shares_of(layout: Layout, axes: Sequence[float], buttons: Sequence[int]) -> Optional[Tuple[float, float]]:
    """Shares of the full speeds (linear, angular), -1 to 1; None while the dead-man button is not held."""
    if not _held(buttons, layout.dead_man):
        return None
    linear = _axis(axes, layout.linear_axis) + _pair(buttons, layout.forward, layout.back)
    angular = _axis(axes, layout.angular_axis) + _pair(buttons, layout.left, layout.right)
    return max(-1.0, min(1.0, linear)), max(-1.0, min(1.0, angular))


def _held(buttons: Sequence[int], index: Optional[int]) -> bool:
    return index is not None and index < len(buttons) and bool(buttons[index])


def _pair(buttons: Sequence[int], plus: Optional[int], minus: Optional[int]) -> int:
    return _held(buttons, plus) - _held(buttons, minus)


def _axis(axes: Sequence[float], index: Optional[int]) -> float:
    if index is None or index >= len(axes) or not abs(axes[index]) > DEAD_ZONE:
        return 0.0
    return axes[index]
