"""The firmware's side of the motor board: finds it, sets it up, stops it, reads its counts."""

from typing import Optional, Tuple

from sim_arduino.hardware.omni3md import BoardGeometry, Omni3MD

from .board_status import BoardStatus
from .parameter_store import Config


class MotorControl:
    """The motor board, as the firmware sees it from one start to the next.  Times are the board's [s].

    Attributes:
        driver: The motor board itself.
        ever_found: The motor board has answered since the start.
    """

    def __init__(self, driver: Omni3MD, config: Config, health: BoardStatus) -> None:
        self.driver = driver
        self.ever_found = False
        self._config, self._health = config, health

    def changed(self) -> bool:
        """Whether the motor board has disappeared or come back since the last look."""
        return self.driver.present == self._health.has_fault("motor_board")

    def there(self, now_s: float) -> bool:
        """Whether the motor board answers; if it has come back, it is stopped and set up first."""
        there, was_gone = self.driver.present, self._health.has_fault("motor_board")
        self._health.set_fault("motor_board", not there)
        if there and was_gone:
            self.driver.stop(now_s)
            self.set_up(now_s)
        elif not there and not was_gone:
            self._health.stopped("motor_board")
        self.ever_found = self.ever_found or there
        return there

    def set_up(self, now_s: float, changed: Optional[str] = None) -> None:
        """Sends all settings to the motor board, or only those that depend on the parameter `changed`."""
        config, driver = self._config, self.driver
        if changed is None or changed in BoardGeometry._fields:
            driver.set_geometry(now_s, BoardGeometry(*(config[name] for name in BoardGeometry._fields)))
        if changed in (None, "kp", "ki", "kd"):
            driver.set_gains(now_s, config["kp"], config["ki"], config["kd"])
        if changed in (None, "ramp_time", "ramp_gain"):
            driver.set_ramp(now_s, config["ramp_time"], config["ramp_gain"])
        if changed in (None, "motor_timeout"):
            driver.set_timeout(now_s, config["motor_timeout"])

    def stop(self, now_s: float, reason: str) -> None:
        """Sends the motor board's own stop command at once."""
        self._health.stopped(reason)
        if self.there(now_s):
            self.driver.stop(now_s)

    def encoders(self, now_s: float) -> Optional[Tuple[int, int]]:
        """Right and left count, or None if the motor board does not answer."""
        if not self.there(now_s):
            return None
        return self.driver.encoder(3, now_s), self.driver.encoder(1, now_s)
