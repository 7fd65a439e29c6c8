"""The motors of a board as its requests see them: one interface for all motor back ends, as the firmware's motor.h."""

import math
from typing import NamedTuple, Optional, Protocol, Tuple

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import Command


class Counts(NamedTuple):
    """Counters of the wheels (int16)."""

    right: int
    left: int
    rear: int


class Motors(Protocol):
    """A motor back end, from one start of the board to the next.  Times are the board's [s]; they never decrease."""

    ever_found: bool = True  # there have been motors since the start
    counts_s: float = 0.05e-3  # from reading the counters to the frame [s]; about a pass of the firmware
    next_s: float = math.inf  # time of the next call of `run` [s]; may be infinite

    @property
    def capabilities(self) -> Tuple[str, ...]:
        """Names in `table.CAPABILITIES` that this back end adds."""

    def boot(self, now_s: float) -> None:
        """The sketch starts: stops the motors and sets them up."""

    def changed(self) -> bool:
        """Whether the motors have disappeared or come back since the last call of `there`."""
        return False

    def there(self, now_s: float) -> bool:
        """Whether the motors can be commanded."""
        return True

    def run(self, now_s: float) -> None:
        """Does what is due."""
        return

    def halt(self, now_s: float, to_s: float) -> None:
        """The processor stands still from `now_s` to `to_s`."""

    def release(self, now_s: float) -> None:
        """The reset line is pulled: the processor controls nothing until `boot`."""

    def refresh(self, now_s: float, parameter: Optional[str] = None) -> None:
        """A parameter has changed; None stands for all."""

    def stop(self, now_s: float, reason: StopReason) -> None:
        """Stops the motors at once."""

    def counts(self, now_s: float) -> Optional[Counts]:
        """The counters, or None if they cannot be read."""

    def info(self, now_s: float) -> Tuple[int, int, int]:
        """Temperature, version and battery voltage in wire values; 0 is what the back end cannot measure."""

    def status(self) -> Tuple[int, ...]:
        """What the back end adds to the reply to `read_status`."""
        return ()

    def set_prescaler(self, now_s: float, encoder: int, value: int) -> bool:
        """10^`value` pulses of an encoder are a count; returns whether there is this encoder."""

    def carry_out(self, now_s: float, row: Command, *values: int) -> bool:
        """Carries out a request that moves the motors or sets them up; returns whether it could."""
