"""Calibrates the speed control of the motors.  It drives; `gains` and `bridge_gains` compute."""

import contextlib
from typing import Any, Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.robot.models import RobotModel

from . import bridge_gains, from_recording, gains, manoeuvres
from .bridge_gains import BridgeGains, DutyStep
from .gains import Gains, MotorModel, Response
from .manoeuvres import MOVE, MOVE_PID, Track

STEP_PERCENT, STEP_S = 40, 1.5  # steps of the duty and of the speed, with a motor board
BRIDGE_PERCENTS = (30, -50, 80)
"""Duties of the steps with an H-bridge board.  The signs alternate, so that the robot turns back."""
BRIDGE_STEP_S = 1.0
TARGET_SHARE = 0.5  # speed of the steps under control, as a share of the fitted full speed
CAPABILITY = "bridge"  # boards with this capability take the gains of `bridge_gains`
Report = Callable[[str], None]


class Steps(NamedTuple):
    """A step of each wheel: times since the step [s], and distances (right, left) since then [count]."""

    times_s: np.ndarray
    right: np.ndarray
    left: np.ndarray

    def of(self, wheel: str) -> np.ndarray:
        """Distance of one wheel, without its sign [count]."""
        return np.abs(self.left if wheel == "left" else self.right)

    def response(self, wheel: str, target_counts_s: Optional[float]) -> Response:
        """Figures of one wheel; without a target, the steady speed is that of the last quarter."""
        travelled = self.of(wheel)
        if target_counts_s is None:
            _, speed = gains.speeds(self.times_s, travelled)
            target_counts_s = float(speed[-max(1, len(speed) // 4) :].mean())
        return gains.describe(self.times_s, travelled, target_counts_s)


class Tuned(NamedTuple):
    """Result of the tuning; the gains are `Gains`, or `BridgeGains` of an H-bridge board."""

    motors: Tuple[Any, Any]  # right and left
    before: Any
    after: Any
    steps_before: Steps
    steps_after: Steps
    target_counts_s: Optional[float] = None  # speed of the two steps, if it is known

    def responses(self) -> Dict[str, Dict[str, Response]]:
        """Figures of both wheels before and after."""
        return {
            when: {wheel: steps.response(wheel, self.target_counts_s) for wheel in ("left", "right")}
            for when, steps in (("before", self.steps_before), ("after", self.steps_after))
        }


def counts_per_turn(model: RobotModel) -> float:
    """Counts of a wheel turn."""
    return model.board["gearbox"] * model.board["encoder_counts"] / 100


def tune(robot: Driver, model: RobotModel, track: Track, report: Report) -> Tuned:
    """Drive a step of the duty, compute gains, and drive steps of the speed with the old and the new gains.

    At the end the old gains and the ramp are in force again, even after an error.

    Raises:
        ConfigError: the steps give no motor, or no gains are good enough.
        BoardTimeout: telemetry ended, or the wheels keep turning.
    """
    present = Gains(*(model.board[name] for name in Gains._fields))
    if robot.parameters.can_save:
        present = Gains(**robot.parameters.read(*Gains._fields))

    def put(trial: Gains) -> None:
        robot.request(manoeuvres.SET_GAINS, *trial)
        robot.wait(0.1)

    with ramp_off(robot):
        report(f"step of the duty, {STEP_PERCENT} %")
        made = [(step(robot, track, MOVE, STEP_PERCENT), STEP_PERCENT, -STEP_PERCENT)]
        motors = _motors(made, _identify)
        wanted = gains.suggest(motors)
        measured = _compared(robot, track, present, wanted, put, lambda trial: STEP_PERCENT, STEP_S, report)
    return Tuned(motors, present, wanted, *measured)


def tune_bridge(robot: Driver, model: RobotModel, track: Track, report: Report) -> Tuned:
    """Tune an H-bridge board, as `tune` does, with steps of several duties."""
    present = BridgeGains(**robot.parameters.read(*BridgeGains._fields))
    a_turn, made = counts_per_turn(model), []
    with ramp_off(robot):
        for percent in BRIDGE_PERCENTS:
            report(f"step of the duty, {abs(percent)} %")
            made.append((step(robot, track, MOVE, percent, BRIDGE_STEP_S), percent, -percent))
        motors = _motors(made, bridge_gains.identify)
        wanted = bridge_gains.design(motors, a_turn)
        target_rpm = TARGET_SHARE * wanted.full_speed

        def percent_of(trial: BridgeGains) -> int:
            return min(100, max(1, round(100 * target_rpm / trial.full_speed)))

        def put(trial: BridgeGains) -> None:
            robot.parameters.write(trial._asdict())

        measured = _compared(robot, track, present, wanted, put, percent_of, BRIDGE_STEP_S, report)
    return Tuned(motors, present, wanted, *measured, target_rpm / 60 * a_turn)


def _compared(
    robot: Driver,
    track: Track,
    present: Any,
    wanted: Any,
    put: Callable[[Any], None],
    percent_of: Callable[[Any], int],
    seconds: float,
    report: Report,
) -> Tuple[Steps, Steps]:
    """Drive a step of the speed with the present and with the suggested gains; then the present ones are back."""
    measured = []
    try:
        for name, trial in (("present", present), ("suggested", wanted)):
            report(f"step of the speed, {name} gains: {listed(trial)}")
            put(trial)
            measured.append(step(robot, track, MOVE_PID, percent_of(trial), seconds))
    finally:
        robot.stop()
        put(present)
    return measured[0], measured[1]


def listed(values: Any) -> str:
    """The gains in one line."""
    return ", ".join(f"{name} {value}" for name, value in values._asdict().items())


def step(robot: Driver, track: Track, code: int, percent: int, seconds: float = STEP_S) -> Steps:
    """Turn in place from rest: left motor back, right motor forward."""
    manoeuvres.settle(robot)
    track.begin()
    manoeuvres.spin_motors(robot, code, -percent, percent, seconds)
    rows = track.end()
    manoeuvres.settle(robot)
    return _steps_of(rows)


def _steps_of(rows: np.ndarray) -> Steps:
    """Rows of a track that begins with the step."""
    if len(rows) < gains.LEAST_READINGS:
        raise ConfigError(f"a step has {len(rows)} readings, expected at least {gains.LEAST_READINGS}")
    return Steps(rows[:, 0] - rows[0, 0], rows[:, 1] - rows[0, 1], rows[:, 2] - rows[0, 2])


def _motors(
    made: Sequence[Tuple[Steps, int, int]], identify: Callable[[List[DutyStep]], Any]
) -> Tuple[Any, Any]:
    """Right and left motor from steps with the percents of the right and the left motor; an error names the motor."""
    found = []
    for wheel in ("right", "left"):
        steps = []
        for each, right, left in made:
            travel, percent = (each.right, right) if wheel == "right" else (each.left, left)
            steps.append(DutyStep(abs(percent) / 100, each.times_s, travel * (1 if percent > 0 else -1)))
        try:
            found.append(identify(steps))
        except ConfigError as error:
            raise ConfigError(f"{wheel} motor: {error}") from None
    return found[0], found[1]


def _identify(steps: List[DutyStep]) -> MotorModel:
    """The motor of the first step, with a motor board."""
    return gains.identify(steps[0].times_s, steps[0].travel, steps[0].duty)


@contextlib.contextmanager
def ramp_off(robot: Driver) -> Iterator[None]:
    """Without a ramp inside the block, if the board has a configuration; then with the former ramp again."""
    ramped = robot.parameters.can_save
    ramp = robot.parameters.read("ramp_time") if ramped else {}
    if ramped and not ramp["ramp_time"] and robot.model is not None:
        ramp = {"ramp_time": robot.model.board["ramp_time"]}  # a run that was killed left a ramp of 0
    try:
        if ramped:
            robot.parameters.write({"ramp_time": 0})
        yield
    finally:
        robot.stop()
        if ramped:
            robot.parameters.write(ramp)


def recorded(path: str, model: RobotModel) -> Tuple[Tuple[Any, Any], Any]:
    """Motors and gains from recorded steps of the duty that turn both motors; raise ConfigError without such steps."""
    steps = from_recording.motor_steps_of(from_recording.read(path, model), MOVE)
    both = [(_steps_of(rows), right, left) for rows, (left, right) in steps if left and right]
    if not both:
        raise ConfigError(f"{path}: no step turns both motors, expected a recording of mrl calibrate gains")
    if model.board.get("bridge"):
        motors = _motors(both, bridge_gains.identify)
        return motors, bridge_gains.design(motors, counts_per_turn(model))
    motors = _motors(both, _identify)
    return motors, gains.suggest(motors)
