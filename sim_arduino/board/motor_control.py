"""The motor back end of boards with an OMNI-3MD: finds it, sets it up, stops it, sends it moves, reads its counts."""

import math
from typing import Callable, Optional, Tuple

from mrl_driver.protocol.stop_reason import StopReason
from sim_arduino.hardware.omni3md import BoardGeometry, Omni3MD

from .board_status import BoardStatus
from .motors import Counts, Info
from .parameter_store import Config

_NO_INFO = Info(0, 0, 0)


class MotorControl:
    """The motor board, as the firmware sees it from one start to the next; see `motors.Motors`.

    Args:
        driver: The motor board itself.
        advance: Runs the whole robot to a time [s].
    """

    capabilities = ("omni",)
    next_s = math.inf
    counts_s = 0.34e-3
    """Measured on the simulated ATmega328P."""

    def __init__(
        self, driver: Omni3MD, config: Config, health: BoardStatus, advance: Callable[[float], None]
    ) -> None:
        self.driver = driver
        self.ever_found = False
        self._config, self._health, self._advance = config, health, advance

    # ---- presence and set-up

    def boot(self, now_s: float) -> None:
        """Stops the motor board and sets it up, if it answers."""
        if self.there(now_s):
            self.driver.fed = True
            self.driver.stop(now_s)
            self._set_up(now_s, None)

    def changed(self) -> bool:
        """Whether the motor board has disappeared or come back since the last look."""
        return self.driver.present == self._health.has_fault("motor_board")

    def there(self, now_s: float) -> bool:
        """Whether the motor board answers; if it has come back, it is stopped and set up first."""
        there, was_gone = self.driver.present, self._health.has_fault("motor_board")
        self._health.set_fault("motor_board", not there)
        if there and was_gone:
            self.driver.stop(now_s)
            self._set_up(now_s, None)
        elif not there and not was_gone:
            self.driver.touch(now_s)  # from now on its own time-out runs
            self._health.stopped(StopReason.MOTOR_BOARD)
        self.driver.fed = there
        self.ever_found = self.ever_found or there
        return there

    def run(self, now_s: float) -> None:
        """Does nothing: the motor board has a control loop of its own."""

    def halt(self, now_s: float, to_s: float) -> None:
        """Nobody talks to the motor board while the processor stands still."""
        self.driver.fed = False
        self._advance(to_s)
        self.driver.fed = True

    def release(self, now_s: float) -> None:
        """Nobody talks to the motor board until the sketch starts."""
        self.driver.fed = False
        self._advance(now_s)

    def refresh(self, now_s: float, parameter: Optional[str] = None) -> None:
        """Sends the settings that depend on a parameter, or all, if the motor board answers."""
        if self.there(now_s):
            self._set_up(now_s, parameter)

    def _set_up(self, now_s: float, changed: Optional[str]) -> None:
        config, driver = self._config, self.driver
        if changed is None or changed in BoardGeometry._fields:
            driver.set_geometry(now_s, BoardGeometry(*(config[name] for name in BoardGeometry._fields)))
        if changed in (None, "kp", "ki", "kd"):
            driver.set_gains(now_s, config["kp"], config["ki"], config["kd"])
        if changed in (None, "ramp_time", "ramp_gain"):
            driver.set_ramp(now_s, config["ramp_time"], config["ramp_gain"])
        if changed in (None, "motor_timeout"):
            driver.set_timeout(now_s, config["motor_timeout"])

    # ---- readings

    def counts(self, now_s: float) -> Optional[Counts]:
        """The three counters, or None if the motor board does not answer."""
        if not self.there(now_s):
            return None
        right, left, rear = (self.driver.encoder(number, now_s) for number in (3, 1, 2))
        return Counts(right, left, rear)

    def info(self, now_s: float) -> Info:
        """Temperature, version and battery voltage; zeros if the motor board does not answer."""
        if not self.there(now_s):
            return _NO_INFO
        temperature, battery = self.driver.temperature_c(now_s), self.driver.battery_v(now_s)
        return Info(round(temperature * 10.0) * 10, 172, round(battery * 10.0) * 10)

    def status(self) -> Tuple[int, ...]:
        """Nothing."""
        return ()

    # ---- requests

    def stop(self, now_s: float, reason: StopReason) -> None:
        """Sends the motor board's own stop command at once."""
        self._health.stopped(reason)
        if self.there(now_s):
            self.driver.stop(now_s)

    def _moves(self, now_s: float) -> bool:
        """Whether a move can be sent; notes that the motors turn."""
        there = self.there(now_s)
        there = not self._health.refuses_move() and there
        if there:
            self._health.turned()
        return there

    def move_speed(self, now_s: float, linear_mm_s: int, angular_mrad_s: int) -> bool:
        """Drives."""
        if moves := self._moves(now_s):
            self.driver.move_differential(now_s, linear_mm_s, angular_mrad_s)
        return moves

    def move_percent(self, now_s: float, left: int, right: int, controlled: bool) -> bool:
        """Turns motors 1 and 3."""
        if moves := self._moves(now_s):
            self.driver.move_percent(now_s, (left, 0, right), controlled)
        return moves

    def move_position(self, now_s: float, motor: int, percent: int, position: int) -> bool:
        """Turns a motor to a count and holds it there with torque."""
        if moves := self._moves(now_s):
            self.driver.move_to_position(now_s, motor, percent, position, hold=True)
        return moves

    def move_omni(self, now_s: float, speed: int, rotation: int, direction: int) -> bool:
        """Moves three omni wheels."""
        if moves := self._moves(now_s):
            self.driver.move_omni(now_s, speed, rotation, direction)
        return moves

    def calibrate(self, now_s: float) -> bool:
        """Lets the motor board find its working points."""
        if moves := self._moves(now_s):
            self.driver.calibrate(now_s)
        return moves

    def set_prescaler(self, now_s: float, encoder: int, value: int) -> bool:
        """Sets how many pulses make a count."""
        if there := self.there(now_s):
            self.driver.set_prescaler(now_s, encoder, value)
        return there

    def preset_encoder(self, now_s: float, encoder: int, count: int) -> bool:
        """Sets a counter."""
        if there := self.there(now_s):
            self.driver.preset_encoder(now_s, encoder, count)
        return there

    def reset_encoders(self, now_s: float) -> bool:
        """Sets all three counters to 0."""
        return all([self.preset_encoder(now_s, encoder, 0) for encoder in (1, 2, 3)])
