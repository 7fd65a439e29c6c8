"""`mrl calibrate gains`: drives steps of the motors; `gains` computes."""

import contextlib
from functools import partial
from typing import Any, Callable, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import click
import numpy as np

from mrl_driver import figures
from mrl_driver.cli.commands.shared import print_message
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.robot.models import RobotModel, beyond_control, full_speeds
from mrl_driver.robot.models.kit import CEILING_SHARE

from . import from_recording, manoeuvres, open_loop
from .calibration_files import Key
from .commands.calibrate_job import Job, Result, job_options, recording_option
from .gains import (
    LINEAR_WITHIN,
    BridgeGains,
    DutyStep,
    Gains,
    Motor,
    Response,
    describe,
    design,
    identify,
    identify_bridge,
    least_counts,
    speeds,
    suggest,
)
from .ground_truth import ruler_for, tell
from .manoeuvres import MOVE, MOVE_PID, Track

STEP_PERCENT = 40  # speed of the steps under control with a motor board
TARGET_SHARE = 0.5  # the same with an H-bridge board, as a share of the fitted full speed
LEAST_READINGS = 10  # of a step
MOST_SHARE = (1 + CEILING_SHARE) / 2  # of full speed that a ceiling may have: half the usual reserve is left
WHEELS = ("right", "left")
CAPABILITY = "bridge"  # boards with this capability take `BridgeGains`


class Board(NamedTuple):
    """A kind of board, and how its speed control is tuned."""

    percents: Sequence[int]  # duties of the steps; the signs alternate, so that the robot turns back
    step_s: float
    gains: Callable[..., Any]
    identify: Callable[[List[DutyStep], float], Motor]
    suggest: Callable[[Sequence[Motor], RobotModel], Any]


def _of_bridge(motors: Sequence[Motor], model: RobotModel) -> BridgeGains:
    """Return the gains; ConfigError if the board would refuse all moves with them."""
    found = design(motors, counts_per_turn(model))
    why = beyond_control({**model.board, **found._asdict()})
    if why:
        raise ConfigError(f"{why}; nothing was changed")
    return found


MOTOR_BOARD = Board(
    (STEP_PERCENT,),
    1.5,
    Gains,
    lambda steps, least: identify(steps[0]),
    lambda motors, model: suggest(motors),
)
BRIDGE_BOARD = Board(
    (30, -50, 80),
    1.0,
    BridgeGains,
    identify_bridge,
    _of_bridge,
)


Steps = Dict[str, DutyStep]  # a step of the left and of the right wheel


class Tuned(NamedTuple):
    """Result of the tuning; the gains are those of the board's kind."""

    motors: List[Motor]  # as `WHEELS`
    before: Any
    after: Any
    steps_before: Steps
    steps_after: Steps
    target_counts_s: Optional[float]  # speed of the two steps, if it is known

    def response(self, step: DutyStep) -> Response:
        """Figures of a step of the speed; without a target, the steady speed is that of the last quarter."""
        target_counts_s = self.target_counts_s
        if target_counts_s is None:
            _, speed = speeds(step.times_s, step.travel)
            target_counts_s = float(speed[-max(1, len(speed) // 4) :].mean())
        return describe(step.times_s, step.travel, target_counts_s)


def counts_per_turn(model: RobotModel) -> float:
    """Counts of a wheel turn."""
    return model.board["gearbox"] * model.board["encoder_counts"] / 100


def tune(robot: Driver, model: RobotModel, board: Board) -> Tuned:
    """Drive steps of the duty, compute gains, and drive steps of the speed with the old and the new gains.

    At the end the old gains and the ramp are in force again, even after an error.  ConfigError if the steps give no
    motor, no gains are good enough, or a wheel does not turn with the suggested ones; BoardTimeout if telemetry
    ended, or the wheels keep turning.
    """
    names, track, made = board.gains._fields, Track(robot), []  # type: ignore[attr-defined]
    stored = robot.parameters.read(*names) if robot.parameters.can_save else model.board
    present = board.gains(*(stored[name] for name in names))
    with ramp_off(robot):
        for percent in board.percents:
            tell(f"step of the duty, {abs(percent)} %")
            made.append(step(robot, track, MOVE, percent, board.step_s))
        motors = _motors(made, board, model)
        wanted = board.suggest(motors, model)
        full_rpm = wanted.full_speed if board is BRIDGE_BOARD else None
        measured = []
        try:
            for name, trial in (("present", present), ("suggested", wanted)):
                tell(f"step of the speed, {name} gains: {listed(trial)}")
                _put(robot, trial)
                percent = STEP_PERCENT
                if full_rpm is not None:
                    percent = min(100, max(1, round(100 * TARGET_SHARE * full_rpm / trial.full_speed)))
                measured.append(step(robot, track, MOVE_PID, percent, board.step_s))
        finally:
            robot.stop()
            _put(robot, present)
    _require_turned(measured[1], least_counts(counts_per_turn(model)))
    target = None if full_rpm is None else TARGET_SHARE * full_rpm / 60 * counts_per_turn(model)
    return Tuned(motors, present, wanted, measured[0], measured[1], target)


def _require_turned(proof: Steps, least: float) -> None:
    """Raise ConfigError if a wheel hardly turned in the step with the suggested gains."""
    for wheel in WHEELS:
        counts = int(proof[wheel].travel[-1])
        if counts < least:
            raise ConfigError(
                f"the {wheel} wheel made {counts} counts with the suggested gains, expected at least {least:.0f}: "
                "see that it turns freely, and measure again"
            )


def _put(robot: Driver, wanted: Any) -> None:
    """Put gains in force, without saving them."""
    if isinstance(wanted, BridgeGains):
        robot.parameters.write(wanted._asdict())
    else:
        robot.request(manoeuvres.SET_GAINS, *wanted)
        robot.wait(0.1)


def listed(values: Any) -> str:
    """The gains in one line."""
    return ", ".join(f"{name} {value}" for name, value in values._asdict().items())


def step(robot: Driver, track: Track, code: int, percent: int, seconds: float) -> Steps:
    """Turn in place from rest: left motor back, right motor forward."""
    manoeuvres.step(robot, track, code, (-percent, percent), seconds)
    rows = track.rows()
    manoeuvres.settle(robot)
    return _steps_of(rows, -percent, percent)


def _steps_of(rows: np.ndarray, left_percent: int, right_percent: int) -> Steps:
    """The steps in the rows of a track that begins with them."""
    if len(rows) < LEAST_READINGS:
        raise ConfigError(f"a step has {len(rows)} readings, expected at least {LEAST_READINGS}")
    times_s, right, left, *_ = (rows - rows[0]).T
    return {
        wheel: DutyStep(abs(percent) / 100, times_s, np.sign(percent) * travel)
        for wheel, percent, travel in (("left", left_percent, left), ("right", right_percent, right))
    }


def _motors(made: Sequence[Steps], board: Board, model: RobotModel) -> List[Motor]:
    """Right and left motor; an error names the motor."""
    found, least = [], least_counts(counts_per_turn(model))
    for wheel in WHEELS:
        try:
            found.append(board.identify([steps[wheel] for steps in made], least))
        except ConfigError as error:
            raise ConfigError(f"{wheel} motor: {error}") from None
    return found


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


def recorded(path: str, model: RobotModel) -> Tuple[List[Motor], Any]:
    """Motors and gains from recorded steps of the duty that turn both motors; raise ConfigError without such steps."""
    steps = from_recording.motor_steps(path, model)
    both = [_steps_of(rows, left, right) for rows, (left, right) in steps if left and right]
    if not both:
        raise ConfigError(f"{path}: no step turns both motors, expected a recording of mrl calibrate gains")
    board = BRIDGE_BOARD if model.board.get("bridge") else MOTOR_BOARD
    motors = _motors(both, board, model)
    return motors, board.suggest(motors, model)


# -- the command


@click.command()
@job_options
@recording_option
def gains(job: Job, recording: Optional[str]) -> None:
    """Measure the gains of the motors' speed control.

    Asks, then turns the robot in place, for 1 to 1.5 s each: three times, or five times with an H-bridge board.  It
    evaluates how the wheels speed up.  The floor around the robot must be free.  At the end the board has its former
    gains again.  Takes 10 to 15 s; after Ctrl-C it starts from the beginning.

    With an H-bridge board it also measures full_speed and friction_duty, suggests kp and ki by lambda tuning, and
    lowers the file's ceilings and limits if the motors hardly reach them.  Charge the battery first: full_speed is
    that of the present voltage.  Without encoders it drives forward, back and forward again, and asks how far: that
    gives full_speed and friction_duty.

    \b
    Example:
      mrl calibrate gains --port /dev/ttyACM0 --plot gains.png
    """
    if recording is not None:
        model, output = job.recorded_robot()
        motors, wanted = recorded(recording, model)
        lines, facts = _motor_lines(motors, wanted, model), {"gains_after": wanted._asdict()}
        job.finish(Result("gains", model, output, values_of(wanted._asdict(), model), lines, facts))
        return
    with job.robot(odometry=False) as (driver, model, output):
        measure = _by_encoders if model.has_odometry else _by_tape
        result = measure(job, driver, model, output)
        job.finish(result)
        job.offer_eeprom(driver, result)


def _by_encoders(job: Job, driver: Driver, model: RobotModel, output: str) -> Result:
    board = BRIDGE_BOARD if CAPABILITY in driver.board.capabilities else MOTOR_BOARD
    times = "five" if board is BRIDGE_BOARD else "three"
    job.confirm_drive(f"The robot turns in place {times} times, quickly. Is the floor around it free?")
    return _result(tune(driver, model, board), model, output)


def _by_tape(job: Job, driver: Driver, model: RobotModel, output: str) -> Result:
    ruler = ruler_for(job.truth)
    job.confirm_drive(
        "The robot drives forward, back and forward again, up to 2 m, quickly. Is its path free?"
    )
    with ramp_off(driver):
        found = open_loop.measure(driver, model, ruler)
    if not found["friction_duty"]:
        print_message(
            "warning: at low duties the motors turn faster than in proportion, as with a bridge that coasts between "
            "the pulses: nothing measures the speed, so the robot drives slow commands too fast"
        )
    values = values_of(found, model)
    words = f"turns from {found['friction_duty'] / 10:g} % duty, {found['full_speed']} 1/min at full duty"
    return Result("gains", model, output, values, [f"motors: {words}"], found)


def _result(tuned: Tuned, model: RobotModel, output: str) -> Result:
    lines = _motor_lines(tuned.motors, tuned.after, model)
    facts = {"gains_before": tuned.before._asdict(), "gains_after": tuned.after._asdict()}
    for when, steps in (("before", tuned.steps_before), ("after", tuned.steps_after)):
        figures_of = {wheel: tuned.response(each) for wheel, each in steps.items()}
        lines += [
            f"{when}, {wheel} wheel: rises in {each.rise_s * 1000:.0f} ms, overshoots {each.overshoot:.1%}, "
            f"settles after {each.settle_s * 1000:.0f} ms, mean error {each.offset:.1%}"
            for wheel, each in figures_of.items()
        ]
        facts[when] = {wheel: each._asdict() for wheel, each in figures_of.items()}
    return Result(
        "gains", model, output, values_of(tuned.after._asdict(), model), lines, facts, partial(_draw, tuned)
    )


def values_of(found: Mapping[str, int], model: RobotModel) -> Dict[Key, float]:
    """Return the numbers for the robot's file: those of the board that were found, and what follows from full speed.

    Ceilings and limits that the motors hardly reach are lowered, so that planners count on speeds that the robot has.
    """
    values: Dict[Key, float] = {("board", name): value for name, value in found.items()}
    if "full_speed" not in found:
        return values
    straight_mm_s, turning_mrad_s = full_speeds({**model.board, **found})
    if hasattr(model.base, "full_speed_m_s"):
        values["drive", "full_speed_m_s"] = straight_mm_s / 1000
    for ceiling, limit, full in (
        ("linear_ceiling", "linear_m_s", straight_mm_s),
        ("angular_ceiling", "angular_rad_s", turning_mrad_s),
    ):
        if model.board[ceiling] > MOST_SHARE * full:
            most = values["board", ceiling] = round(CEILING_SHARE * full)
            values["limits", limit] = min(getattr(model.limits, limit), most / 1000)
    return values


def _motor_lines(motors: Sequence[Motor], wanted: Any, model: RobotModel) -> List[str]:
    """Return lines about the motors; warn if their speed is not a line over the duty."""
    lines = []
    for name, motor in zip(WHEELS, motors):
        words = f"{motor.full_counts_s:.0f} count/s at full duty"
        if isinstance(wanted, BridgeGains):
            full_rpm = motor.full_counts_s * 60 / counts_per_turn(model)
            words = f"turns from {motor.dead_band:.1%} duty, {full_rpm:.0f} 1/min at full duty"
        if motor.off_line > LINEAR_WITHIN:
            print_message(
                f"warning: the speed of the {name} motor is up to {motor.off_line:.0%} of full speed off a line "
                "over the duty; check the battery, the bridge and the gearbox"
            )
        lines.append(f"{name} motor: {words}, time constant {motor.time_constant_s * 1000:.0f} ms")
    return lines


def _draw(tuned: Tuned, path: str) -> None:
    """Plot the steps of both wheels with the old and the new gains, and the target if it is known."""
    figure = figures.figure(7.0, 5.6)
    pair = figure.subplots(2, 1, sharex=True)
    for axes, name in zip(pair, ("left", "right")):
        for steps, used, colour, style in (
            (tuned.steps_before, tuned.before, figures.GREY, "--"),
            (tuned.steps_after, tuned.after, figures.BLUE, "-"),
        ):
            times_s, speed = speeds(steps[name].times_s, steps[name].travel)
            axes.plot(times_s, speed, style, color=colour, label=listed(used))
        if tuned.target_counts_s is not None:
            axes.axhline(tuned.target_counts_s, color=figures.ORANGE, linewidth=0.8, label="target")
        axes.set(ylabel=f"{name} wheel [count/s]")
        axes.legend(fontsize="small", loc="lower right")
    pair[0].set(title="Step response of the speed")
    pair[1].set(xlabel="time since the step [s]")
    figures.save(figure, path)
