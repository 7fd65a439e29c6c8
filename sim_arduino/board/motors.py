"""The motors of a board as its requests see them: one interface for all motor back ends, as the firmware's motor.h."""

from typing import NamedTuple, Optional, Protocol, Tuple

from mrl_driver.protocol.stop_reason import StopReason


class Counts(NamedTuple):
    """Counters of the wheels (int16)."""

    right: int
    left: int
    rear: int


class Info(NamedTuple):
    """What the back end contributes to the reply to `robot_info`, in wire values; 0 is what it cannot measure."""

    temperature: int
    version: int
    battery: int


class Motors(Protocol):
    """A motor back end, from one start of the board to the next.  Times are the board's [s]; they never decrease.

    A method that carries out a request returns whether it could.
    """

    @property
    def ever_found(self) -> bool:
        """Whether there have been motors since the start."""

    @property
    def capabilities(self) -> Tuple[str, ...]:
        """Names in `table.CAPABILITIES` that this back end adds."""

    @property
    def counts_s(self) -> float:
        """Time to read the counters [s]."""

    @property
    def next_s(self) -> float:
        """Time of the next call of `run` [s]; may be infinite."""

    def boot(self, now_s: float) -> None:
        """The sketch starts: stops the motors and sets them up."""

    def changed(self) -> bool:
        """Whether the motors have disappeared or come back since the last call of `there`."""

    def there(self, now_s: float) -> bool:
        """Whether the motors can be commanded."""

    def run(self, now_s: float) -> None:
        """Does what is due."""

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

    def info(self, now_s: float) -> Info:
        """Temperature, version and battery voltage."""

    def status(self) -> Tuple[int, ...]:
        """What the back end adds to the reply to `read_status`."""

    def move_speed(self, now_s: float, linear_mm_s: int, angular_mrad_s: int) -> bool:
        """Drives at these speeds."""

    def move_percent(self, now_s: float, left: int, right: int, controlled: bool) -> bool:
        """Turns the motors at shares [%] of full speed (`controlled`) or of full duty."""

    def move_position(self, now_s: float, motor: int, percent: int, position: int) -> bool:
        """Turns a motor until its counter is at `position`, and holds it there."""

    def move_omni(self, now_s: float, speed: int, rotation: int, direction: int) -> bool:
        """Moves a robot with three wheels [% % deg]."""

    def calibrate(self, now_s: float) -> bool:
        """Finds the working points of the speed control; the wheels turn."""

    def set_prescaler(self, now_s: float, encoder: int, value: int) -> bool:
        """Sets how many pulses make a count: 1, 10, 100, 1000 or 10000 for 0 to 4."""

    def preset_encoder(self, now_s: float, encoder: int, count: int) -> bool:
        """Sets a counter."""

    def reset_encoders(self, now_s: float) -> bool:
        """Sets all counters to 0."""
