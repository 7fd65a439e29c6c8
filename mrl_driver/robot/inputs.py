"""Inputs of the board that stop the robot: replies to `read_inputs` to values.  Pure.

They are not safety devices: a real emergency stop cuts the motors' power.
"""

from typing import NamedTuple, Optional, Tuple

from mrl_driver.protocol.frames import Frame
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_NAME, INPUTS

CAPABILITY = "wiring"
READ_INPUTS, RELEASE = BY_NAME["read_inputs"].code, BY_NAME["release_emergency"].code
EMERGENCY = "emergency_stop"
SAFETY = "this input is not a safety device: a real emergency stop cuts the motors' power"
_WORDS = {
    "bumper": "{} is hit",
    "cliff": "{} sees no floor",
    "emergency": "{} is pressed, or its wire is broken",
}


class Inputs(NamedTuple):
    """Bumpers, cliff sensors and emergency stop of a board; names are rows of `table.INPUTS`."""

    active: Tuple[str, ...] = ()
    """The board refuses moves towards them, and all moves while the emergency stop is active."""
    latched: bool = False
    """The emergency stop was active, and was not released: the robot does not move."""
    connected: Tuple[str, ...] = ()

    def sides(self, kind: str) -> Tuple[str, ...]:
        """The active sides of a `kind`, bumper or cliff: left, right, rear."""
        return tuple(name.partition("_")[2] for name in self.active if name.startswith(f"{kind}_"))

    def against(self, slowest_m_s: float, fastest_m_s: float) -> StopReason:
        """Why the board would refuse speeds of the wheels between these; `none` if it would not."""
        if self.latched or EMERGENCY in self.active:
            return StopReason.EMERGENCY_STOP
        for rear, turns in ((False, fastest_m_s > 0.0), (True, slowest_m_s < 0.0)):
            side = [name for name in self.active if name.endswith("_rear") == rear]
            if turns and side:
                return StopReason.BUMPER if side[0].startswith("bumper") else StopReason.CLIFF
        return StopReason.NONE

    def __str__(self) -> str:
        """One line for people."""
        texts = [_WORDS[name.partition("_")[0]].format(name.replace("_", " ")) for name in self.active]
        if self.latched and EMERGENCY not in self.active:
            texts.append(
                "the emergency stop was pressed: look whether all is well, then release it (key r in mrl drive, the "
                "page of mrl web, or the ROS service release_stop)"
            )
        away = "; drive away from it" if self.active and not self.latched else ""
        return "; ".join(texts) + away or "no input is active"


def inputs_of(frame: Frame, before: Optional[Inputs]) -> Optional[Inputs]:
    """The inputs after a frame; None if it says nothing of them.

    A latch lasts until the board confirms its release, also if a restarted board does not know of it.
    """
    old = before or Inputs()
    if frame.code == RELEASE:
        return old._replace(latched=bool(frame.args[0]))
    if frame.code != READ_INPUTS:
        return None
    active, latched, connected = frame.args
    return Inputs(_names(active), bool(latched) or old.latched, _names(connected))


def _names(bits: int) -> Tuple[str, ...]:
    return tuple(name for bit, name in enumerate(INPUTS) if bits >> bit & 1)
