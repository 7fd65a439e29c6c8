"""The motor back end of boards with an OMNI-3MD: finds it, sets it up, stops it, sends it moves, reads its counts."""

from typing import Callable, Dict, Optional, Tuple

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import Command
from sim_arduino.hardware.omni3md import BoardGeometry, Omni3MD

from .board_status import BoardStatus
from .motors import Counts, Motors
from .parameter_store import Config


class MotorControl(Motors):
    """The motor board, as the firmware sees it from one start to the next; `advance` runs the robot to a time [s]."""

    capabilities = ("omni",)
    counts_s = 0.34e-3  # measured on the simulated ATmega328P

    def __init__(
        self, driver: Omni3MD, config: Config, health: BoardStatus, advance: Callable[[float], None]
    ) -> None:
        self.driver = driver
        self.ever_found = False
        self._prescalers = {1: 0, 2: 0, 3: 0}
        self._config, self._health, self._advance = config, health, advance

    # ---- presence and set-up

    def boot(self, now_s: float) -> None:
        if self.there(now_s):
            self.driver.fed = True
            self.driver.stop(now_s)
            self._set_up(now_s, None)

    def changed(self) -> bool:
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

    def halt(self, now_s: float, to_s: float) -> None:
        self.driver.fed = False
        self._advance(to_s)
        self.driver.fed = True

    def release(self, now_s: float) -> None:
        self.driver.fed = False
        self._advance(now_s)

    def refresh(self, now_s: float, parameter: Optional[str] = None) -> None:
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
        for encoder, value in self._prescalers.items() if changed is None else ():
            driver.set_prescaler(now_s, encoder, value)

    # ---- readings

    def counts(self, now_s: float) -> Optional[Counts]:
        if not self.there(now_s):
            return None
        self.driver.touch(now_s)
        left, rear, right = self.driver.counts()
        return Counts(right, left, rear)

    def info(self, now_s: float) -> Tuple[int, int, int]:
        if not self.there(now_s):
            return 0, 0, 0
        temperature, battery = self.driver.temperature_c(now_s), self.driver.battery_v(now_s)
        return round(temperature * 10.0) * 10, 172, round(battery * 10.0) * 10

    # ---- requests

    def stop(self, now_s: float, reason: StopReason) -> None:
        self._health.stopped(reason)
        if self.there(now_s):
            self.driver.stop(now_s)

    def set_prescaler(self, now_s: float, encoder: int, value: int) -> bool:
        if self._prescalers[encoder] != value and self.there(now_s):
            self.driver.set_prescaler(now_s, encoder, value)
        self._prescalers[encoder] = value
        return True

    def carry_out(self, now_s: float, row: Command, *values: int) -> bool:
        there = self.there(now_s)
        if row.turns:
            there = not self._health.refuses_move() and there
        if there and row.turns:
            self._health.turned()
        if there:
            _REQUESTS[row.name](self.driver, now_s, *values)
        return there


def _reset_encoders(driver: Omni3MD, now_s: float) -> None:
    for encoder in (1, 2, 3):
        driver.preset_encoder(now_s, encoder, 0)


_REQUESTS: Dict[str, Callable[..., None]] = {
    "calibrate": Omni3MD.calibrate,
    "preset_encoder": Omni3MD.preset_encoder,
    "reset_encoders": _reset_encoders,
    "move_motors_pid": lambda driver, now_s, left, right: driver.move_percent(now_s, (left, 0, right), True),
    "move_motors": lambda driver, now_s, left, right: driver.move_percent(now_s, (left, 0, right), False),
    "move_differential": Omni3MD.move_differential,
    "move_to_position": lambda driver, now_s, *values: driver.move_to_position(now_s, *values, hold=True),
    "move_omni": Omni3MD.move_omni,
}
"""What the motor board does for each request."""
