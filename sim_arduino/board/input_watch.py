"""The board's inputs that stop it, as in inputs.cpp."""

import math
from typing import Dict, Mapping, Set, Tuple

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import INPUTS, NOT_CONNECTED, TICK_S
from mrl_driver.robot.wiring import Pins, reads_high

LOOK_S = 15 * TICK_S  # time between two looks at the pins [s]
EMERGENCY = "emergency_stop"
_REAR = "bumper_rear"


class InputWatch:
    """What is active in two looks counts; until the first one, all that are connected are active."""

    def __init__(self) -> None:
        self.latched = False  # the emergency stop
        self.next_s = math.inf  # time of the next look [s]
        self._pins: Dict[str, int] = {}
        self._high: Set[str] = set()
        self._seen: Set[str] = set()
        self._active: Set[str] = set()

    def begin(self, pins: Pins, now_s: float) -> None:
        """Takes the inputs of a wiring."""
        self._pins = {name: pins[f"pin_{name}"] for name in INPUTS if pins[f"pin_{name}"] != NOT_CONNECTED}
        self._high = reads_high(pins)
        self._seen = self._active = set(self._pins)
        self.next_s = now_s + LOOK_S if self._pins else math.inf
        self.latched = self.latched and EMERGENCY in self._pins

    def look(self, now_s: float, levels: Mapping[int, int]) -> None:
        """Looks at the pins; one that nothing drives is pulled up."""
        now = {name for name, pin in self._pins.items() if levels.get(pin, 1) == int(name in self._high)}
        self._seen, self._active = now, now & self._seen
        self.latched = self.latched or EMERGENCY in self._active
        self.next_s = now_s + LOOK_S

    def against(self, backward: bool) -> StopReason:
        """Why no wheel may turn forward, or backward."""
        if self.latched or EMERGENCY in self._active:
            return StopReason.EMERGENCY_STOP
        side = {name for name in self._active if (name == _REAR) == backward}
        if any("bumper" in name for name in side):
            return StopReason.BUMPER
        return StopReason.CLIFF if side else StopReason.NONE

    def release(self) -> None:
        """The host releases the emergency stop, if it is not active any more."""
        self.latched = self.latched and EMERGENCY in self._active

    def report(self) -> Tuple[int, int, int]:
        """The reply to `read_inputs`."""
        active, connected = (
            sum(1 << INPUTS.index(name) for name in names) for names in (self._active, self._pins)
        )
        return active, int(self.latched), connected
