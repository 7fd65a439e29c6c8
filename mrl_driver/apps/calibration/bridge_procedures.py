"""Calibrates the speed control of an H-bridge board.  It drives; `bridge_gains` computes."""

from typing import Callable, List, NamedTuple, Sequence, Tuple

import numpy as np

from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.robot.models import RobotModel

from . import bridge_gains, from_recording, gains
from .bridge_gains import BridgeGains, DutyStep, MotorFit
from .gains import Response
from .manoeuvres import MOVE, MOVE_PID, Track
from .part_procedures import Steps, ramp_off, step, steps_of_rows

STEP_PERCENTS = (30, -50, 80)  # duties of the steps.  The signs alternate, so that the robot turns back.
STEP_S = 1.0
TARGET_SHARE = 0.5  # speed of the steps under control, as a share of the fitted full speed
CAPABILITY = "bridge"  # boards with this capability take the gains of this module


class TunedBridge(NamedTuple):
    """Result of the tuning."""

    motors: Tuple[MotorFit, MotorFit]  # right and left
    before: BridgeGains
    after: BridgeGains
    steps_before: Steps
    steps_after: Steps
    target_counts_s: float  # speed of the two steps

    def response(self, steps: Steps, left: bool) -> Response:
        """Figures of one wheel."""
        return gains.describe(
            steps.times_s, np.abs(steps.left if left else steps.right), self.target_counts_s
        )


def counts_per_turn(model: RobotModel) -> float:
    """Counts of a wheel turn."""
    return model.board["gearbox"] * model.board["encoder_counts"] / 100


def tune(robot: Driver, model: RobotModel, track: Track, report: Callable[[str], None]) -> TunedBridge:
    """Drive steps of the duty, compute gains, and drive a step of the speed with the old and the new gains.

    At the end the old gains and the ramp are in force again, even after an error.

    Raises:
        ConfigError: the steps give no motor, or no gains in the range of the parameters.
        BoardTimeout: telemetry ended, or the wheels keep turning.
    """
    present = BridgeGains(**robot.parameters.read(*BridgeGains._fields))
    a_turn = counts_per_turn(model)
    with ramp_off(robot):
        made = []
        for percent in STEP_PERCENTS:
            report(f"step of the duty, {abs(percent)} %")
            made.append((step(robot, track, MOVE, percent, STEP_S), percent, -percent))
        motors = motors_of(made)
        wanted = bridge_gains.design(motors, a_turn)
        target_rpm = TARGET_SHARE * wanted.full_speed
        measured = []
        try:
            for name, trial in (("present", present), ("suggested", wanted)):
                report(f"step of the speed, {name} gains: {listed(trial)}")
                robot.parameters.write(trial._asdict())
                percent = min(100, max(1, round(100 * target_rpm / trial.full_speed)))
                measured.append(step(robot, track, MOVE_PID, percent, STEP_S))
        finally:
            robot.stop()
            robot.parameters.write(present._asdict())
    return TunedBridge(motors, present, wanted, measured[0], measured[1], target_rpm / 60 * a_turn)


def listed(values: BridgeGains) -> str:
    """The gains in one line."""
    return ", ".join(f"{name} {value}" for name, value in values._asdict().items())


def motors_of(made: Sequence[Tuple[Steps, int, int]]) -> Tuple[MotorFit, MotorFit]:
    """Right and left motor from steps with the percents of the right and the left motor.

    Raises:
        ConfigError: a wheel did not turn as commanded; the error names it.
    """
    return (
        _motor("right", [_duty_step(steps.times_s, steps.right, right) for steps, right, _ in made]),
        _motor("left", [_duty_step(steps.times_s, steps.left, left) for steps, _, left in made]),
    )


def _motor(name: str, steps: List[DutyStep]) -> MotorFit:
    try:
        return bridge_gains.identify(steps)
    except ConfigError as error:
        raise ConfigError(f"{name} motor: {error}") from None


def _duty_step(times_s: np.ndarray, travel: np.ndarray, percent: int) -> DutyStep:
    return DutyStep(abs(percent) / 100, times_s, travel * (1 if percent > 0 else -1))


def recorded(path: str, model: RobotModel) -> Tuple[Tuple[MotorFit, MotorFit], BridgeGains]:
    """Motors and gains from the recorded steps of the duty that turn both motors.

    Raises:
        ConfigError: the recording has no such steps, or they give no motor.
    """
    made = [
        (steps_of_rows(rows), right, left)
        for rows, (left, right) in from_recording.motor_steps_of(from_recording.read(path, model), MOVE)
        if left and right
    ]
    if not made:
        raise ConfigError(f"{path}: no step turns both motors, expected a recording of mrl calibrate gains")
    motors = motors_of(made)
    return motors, bridge_gains.design(motors, counts_per_turn(model))
