"""`mrl calibrate wiring`: with a motor board, names wires to exchange; with an H-bridge, stores how they are.

It turns the motors slowly; `wiring_check` computes.
"""

import contextlib
from typing import Any, Dict, Iterable, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import click
import numpy as np

from mrl_driver.cli.commands.shared import print_message, warn
from mrl_driver.driver import Driver
from mrl_driver.errors import BoardRefused, ConfigError, MrlError, WheelFault
from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import BRIDGES, BY_NAME, NOT_CONNECTED, WHEELS
from mrl_driver.robot.chips import CHIPS as BOARDS
from mrl_driver.robot.models import RobotModel, kind_of
from mrl_driver.robot.models.drives import FOUR_WHEELS
from mrl_driver.robot.wiring import ENCODERS, FRONT, OUTPUTS, short

from . import from_recording, manoeuvres, wiring_check
from .calibration_files import Key
from .commands import calibrate_job
from .commands.calibrate_job import Job, job_options, recording_option
from .gain_procedures import CAPABILITY, counts_per_turn, ramp_off
from .ground_truth import NOT_MEASURED, Ruler, Truth, require_terminal, ruler_for, tell
from .manoeuvres import FIRST_WHEEL, MOVE, Track
from .wiring_check import LEAST_RAD, LEFT, RIGHT, SET, SINGLE_CHANNEL, Trial, seen_in

MOVE_WHEELS = BY_NAME["move_wheels"].code
CHIPS = BRIDGES[1:]
DUTY_PERCENT, WIRING_S = 35, 0.5  # moves with a motor board
SLOW_PERCENT, SLOW_S = 20, 0.3
"""Share of full speed and duration of each move with an H-bridge [s]: a wheel of 170 1/min turns by a sixth."""


_NO_WHEEL = (
    "no wheel turned when the {} was driven, expected one: check the battery, the motor's wires, and that "
    "--bridge names the right chip"
)


class Witness:
    """Sees the wheels: a user at the terminal, or words given before as `answers`; `more` are words for a wheel."""

    def __init__(self, answers: Optional[str] = None, more: Sequence[str] = ()) -> None:
        self._answers = None if answers is None else [word.strip() for word in answers.split(",")]
        self._more = more

    def turned(self, motor: str, expected: Optional[str], moved: Pose) -> Tuple[Optional[str], int]:
        """Return the wheel that turned alone, None if it was not observed; and +1 forward, -1 backward, 0 if none did.

        `expected` is the wheel that must have turned, None if both are possible; `moved` the measured motion, or NaN.
        """
        wheel = expected or self._ask("Which wheel turned", ["left", "right", "none", *self._more])
        if wheel == "none":
            return motor, 0
        if wheel == "unseen":
            return None, 0
        words = f"In which direction did the {wheel} wheel turn"
        direction = self._ask(words, ["forward", "back", "none"])
        return wheel, {"forward": 1, "back": -1, "none": 0}[direction]

    def turned_right(self, moved: Pose) -> bool:
        """Return whether the left wheels turned forward and the right ones backward."""
        return self._ask("Did the left side turn forward, and the right side back", ["yes", "no"]) == "yes"

    def _ask(self, question: str, choices: Sequence[str]) -> str:
        if self._answers is None:
            return str(click.prompt(question, type=click.Choice(choices), err=True))
        answer = self._answers.pop(0) if self._answers else "nothing"
        if answer not in choices:
            raise ConfigError(
                f"--answers has {answer} for the question: {question}? expected {', '.join(choices)}"
            )
        return answer


class SeenByTruth(Witness):
    """The witness of an emulated robot: its true motion."""

    def turned(self, motor: str, expected: Optional[str], moved: Pose) -> Tuple[Optional[str], int]:
        """Return the wheel that explains the motion, and its direction."""
        return seen_in(moved.x_m, moved.yaw_rad)

    def turned_right(self, moved: Pose) -> bool:
        """Return whether the robot turned to the right."""
        return moved.yaw_rad < -LEAST_RAD


class Scene(NamedTuple):
    """A robot and what observes it."""

    robot: Driver
    track: Track
    ruler: Ruler
    witness: Witness

    @property
    def counts_per_turn(self) -> float:
        """Counts of a wheel turn; 0 without encoders."""
        assert self.robot.model is not None
        return counts_per_turn(self.robot.model) if self.robot.model.has_odometry else 0.0


def check(scene: Scene) -> List[Trial]:
    """Turn each motor of a motor board forward alone, without speed control; return what was seen."""
    trials = []
    for motor, percents in ((LEFT, (DUTY_PERCENT, 0)), (RIGHT, (0, DUTY_PERCENT))):
        counts, moved = _move(scene, f"{motor} motor alone", percents, WIRING_S)
        trials.append(Trial(motor, counts, *scene.witness.turned(motor, None, moved)))
    return trials


@contextlib.contextmanager
def uncorrected(robot: Driver, bridge: int, single_channel: bool, kept: Iterable[str] = ()) -> Iterator[None]:
    """For the block, the board drives this bridge and corrects nothing; BoardRefused if it refuses that, or its pins.

    The board keeps what the block has set.  After an error or an interruption it gets back what was in force before,
    with the `kept` parameters: a board that was not set refuses to move again.  Nothing is saved to the EEPROM here.
    """
    before = robot.parameters.read("bridge", "wiring", *kept)
    try:
        robot.parameters.write({"bridge": bridge, "wiring": SET | (SINGLE_CHANNEL if single_channel else 0)})
        problem = robot.parameters.wiring_problem()
        if problem:
            raise BoardRefused(
                f"{problem}; store the robot's file with: mrl flash --robot FILE --port PORT, "
                "and mrl set-id ID --robot FILE --port PORT"
            )
        yield
    except BaseException:
        with contextlib.suppress(MrlError):
            robot.stop()
        with contextlib.suppress(MrlError):
            robot.parameters.write(before)
        raise


def find(scene: Scene, wheels: Sequence[str]) -> List[Trial]:
    """Turn each output of the H-bridges forward alone, slowly; return what was seen, or raise WheelFault."""
    trials: List[Trial] = []
    for output in wheels:
        name = f"{wiring_check.words(output)} motor output"
        counts, moved = _move(scene, f"{name}, forward", [SLOW_PERCENT * (each == output) for each in wheels])
        left = [wheel for wheel in wheels if wheel not in {each.seen for each in trials}]
        seen, direction = scene.witness.turned(output, left[0] if len(left) == 1 else None, moved)
        if not direction:
            raise WheelFault(_NO_WHEEL.format(name))
        trials.append(Trial(output, counts, seen, direction))
    return trials


def prove(scene: Scene, wheels: Sequence[str]) -> None:
    """Turn slowly to the right with the new wiring; raise WheelFault unless each wheel and counter does its part."""
    percents = [-SLOW_PERCENT if RIGHT in wheel else SLOW_PERCENT for wheel in wheels]
    counts, moved = _move(scene, "a slow turn to the right", percents)
    wiring_check.require_right_turn(counts, scene.counts_per_turn)
    if not scene.witness.turned_right(moved):
        raise WheelFault(
            "the wheels did not turn the robot to the right, so the answers do not fit together; run mrl calibrate "
            "wiring again, and look at the wheels"
        )


def _move(
    scene: Scene, name: str, percents: Sequence[int], seconds: float = SLOW_S
) -> Tuple[Dict[str, int], Pose]:
    """Turn two or four motors without speed control; return the counts by encoder, and the measured motion."""
    robot, track, ruler, _ = scene
    ruler.begin(name)
    manoeuvres.step(robot, track, MOVE if len(percents) == FRONT else MOVE_WHEELS, percents, seconds)
    manoeuvres.settle(robot)
    rows = track.rows()
    assert robot.telemetry is not None
    turned = np.nan_to_num((rows[-1] - rows[0])[FIRST_WHEEL:])  # motors without encoders count nothing
    counts = dict(zip(robot.telemetry.counts._fields, map(int, turned)))
    return counts, ruler.end(name, lambda _: None)


def recorded(path: str, model: RobotModel) -> List[Trial]:
    """What a recording of `check` shows, but for which wheel turned; ConfigError unless each motor turned alone."""
    steps = from_recording.motor_steps(path, model)
    alone = {LEFT if left else RIGHT: rows[-1] - rows[0] for rows, (left, right) in steps if not left * right}
    trials = [
        Trial(motor, {LEFT: int(left), RIGHT: int(right)}) for motor, (_, right, left, *_) in alone.items()
    ]
    if len(trials) < 2:
        which = f"only the {trials[0].motor}" if trials else "no"
        raise ConfigError(
            f"{path}: {which} motor was turned alone, expected both in turn; record mrl calibrate wiring"
        )
    return trials


# -- the command


@click.command()
@job_options
@click.option("--unseen", is_flag=True, help="Do not ask which wheel turned; finds fewer faults.")
@click.option(
    "--bridge",
    type=click.Choice(CHIPS, case_sensitive=False),
    help="Chip of the H-bridge; default: that of the board or model.",
)
@click.option(
    "--single-channel", is_flag=True, help="The encoders of the H-bridge board have channel A only."
)
@click.option("--answers", metavar="WORDS", help="Answers for scripts, such as left,forward,back,yes.")
@recording_option
def wiring(job: Job, unseen: bool, recording: Optional[str], answers: Optional[str], **bridge: Any) -> None:
    """Find swapped or reversed wires of motors and encoders.

    With a motor board, it asks, turns each wheel forward for half a second, and names the wires to exchange.  Put the
    robot on a box, or clear half a metre in front of it.

    With an H-bridge board, no wire needs to be exchanged: the board stores how they are.  Lift the wheels off the
    ground.  Each motor output turns its wheel for 0.3 s at 20 % duty, and you say which wheel turned, and in which
    direction.  A slow turn to the right proves the result.  After Ctrl-C the board is as before.  With four wheels,
    left and right are those in front; pins that must be exchanged are written to the robot's file too.

    \b
    Examples:
      mrl calibrate wiring --port /dev/ttyACM0
      mrl calibrate wiring --robot kit --bridge l298n
    """
    if recording is not None:
        model = job.recorded_model()
        if model.board.get("bridge"):
            raise ConfigError(
                "--recording does not show which wheel turned, which the wiring of an H-bridge board needs; run "
                "mrl calibrate wiring with the robot"
            )
        _report(recorded(recording, model), job)
        return
    if job.truth is None and not unseen and answers is None:
        require_terminal(
            "--unseen to skip the question which wheel turned, or --answers with an H-bridge board"
        )
    with calibrate_job.connect(job, finds_wiring=True) as driver:
        if CAPABILITY in driver.board.capabilities:
            _store(driver, job, unseen, answers, **bridge)
            return
        warn(driver)
        scene = _scene(driver, job, Witness("unseen,unseen" if unseen else answers, ["unseen"]), unseen)
        job.confirm_drive(
            "Each wheel turns forward for half a second. Is the robot on a box, or its path free?"
        )
        _report(check(scene), job)


def _scene(driver: Driver, job: Job, user: Witness, unseen: bool = False) -> Scene:
    """The robot, seen by its true pose if that is known, else by the user."""
    ruler = Truth(lambda: NOT_MEASURED, tell) if job.truth is None else ruler_for(job.truth)
    return Scene(driver, Track(driver), ruler, user if unseen or job.truth is None else SeenByTruth())


def _report(trials: List[Trial], job: Job) -> None:
    """Print the faults of a motor board's wires; raise WheelFault if there is one."""
    found, right = wiring_check.diagnose(trials), "the wiring of motors and encoders is right"
    if any(trial.seen is None for trial in trials):
        right = "the counters fit the commands; nobody saw which wheel turned, or in which direction"
    if job.run.as_json or not found:
        job.run.print({"findings": found}, right)
    if found:
        raise WheelFault("; ".join(found))


def _store(
    driver: Driver,
    job: Job,
    unseen: bool,
    answers: Optional[str],
    bridge: Optional[str],
    single_channel: bool,
) -> None:
    """Find the wiring of an H-bridge board, prove it, and save it in the EEPROM."""
    if unseen:
        raise ConfigError(
            "--unseen is given, but the encoders of an H-bridge board do not show which wheel turned; leave it out, or "
            "give --answers"
        )
    assert driver.model is not None
    four = kind_of(driver.model.drive) in FOUR_WHEELS
    wheels = WHEELS if four else WHEELS[:FRONT]
    pins = [name for rows in (OUTPUTS, ENCODERS) for names in rows for name in names] if four else []
    before = driver.parameters.read(*pins)
    if four:
        job.require_file(_keys({name: driver.model.board[name] for name in pins}), "wiring", driver)
    witness = Witness(answers, WHEELS[FRONT:] if four else ())
    scene, number = _scene(driver, job, witness, unseen=four), _bridge_of(driver, bridge)
    job.confirm_drive(
        f"Each wheel turns slowly for {SLOW_S} s, driven by a {BRIDGES[number].upper()}. "
        "Are the wheels off the ground?"
    )
    with uncorrected(driver, number, single_channel, pins):
        found = _found(scene, wheels, single_channel, before)
        moved = {name: found[name] for name in pins if found[name] != driver.model.board[name]}
        words = wiring_check.in_words(found["wiring"])
        words += [f"{short(name)} on {pin}" for name, pin in moved.items()]
        _keep(driver, job, {"bridge": number, **found}, moved)
    facts = {"bridge": BRIDGES[number], "wiring": found["wiring"], "differences": words}
    kept = "in force until the board restarts" if job.eeprom is False else "stored in the board's EEPROM"
    listed = ", ".join(words) or "the wires are as in the robot's file"
    job.run.print(facts, f"{listed}: wiring {found['wiring']}, {kept}")


def _found(
    scene: Scene, wheels: Sequence[str], single_channel: bool, before: Mapping[str, int]
) -> Dict[str, int]:
    """Turn the motors; return the wiring that follows, which is in force and proved."""
    driver = scene.robot
    assert driver.model is not None
    with ramp_off(driver):  # a slow ramp would not reach 20 % in 0.3 s
        seen = find(scene, wheels), scene.counts_per_turn, single_channel
        if len(wheels) > FRONT:
            found = wiring_check.parameters_of(before, *seen)
        else:
            found = {"wiring": wiring_check.wiring_of(_places(driver.model), *seen)}
        driver.parameters.write(found)
        prove(scene, wheels)
    return found


def _keep(driver: Driver, job: Job, found: Mapping[str, int], moved: Mapping[str, int]) -> None:
    """Write the pins that moved to the robot's file, then the board's EEPROM.

    If only the first is done, the next calibration finds the same pins, and does the second.
    """
    if moved:
        tell("found: " + ", ".join(f"{short(name)} on {pin}" for name, pin in moved.items()))
        job.write(_keys(moved), "wiring", driver)
    if job.eeprom is False:
        return
    try:
        driver.parameters.replace(found)
    except (MrlError, KeyboardInterrupt):
        if moved:
            print_message(
                "the robot's file has the new pins, and the board may not; run mrl calibrate wiring again"
            )
        raise


def _keys(pins: Mapping[str, int]) -> Dict[Key, float]:
    return {("wiring", short(name)): pin for name, pin in pins.items()}


def _places(model: RobotModel) -> Dict[str, str]:
    """The pins of the encoders of two wheels, in words."""
    chip = BOARDS[model.chip]
    pins = ([model.board.get(name, NOT_CONNECTED) for name in names] for names in ENCODERS[:FRONT])
    words = (" and ".join(chip.label(pin) for pin in each if pin != NOT_CONNECTED) for each in pins)
    return dict(zip(WHEELS, words))


def _bridge_of(driver: Driver, wanted: Optional[str]) -> int:
    """Return the number of the bridge: as given, or that of the board, or that of the model."""
    assert driver.model is not None
    if wanted is not None:
        return BRIDGES.index(wanted.lower())
    found = driver.parameters.read("bridge")["bridge"] or driver.model.board.get("bridge", 0)
    if not found:
        raise ConfigError(
            f"neither the board nor the model names its bridge; give --bridge with one of {', '.join(CHIPS)}"
        )
    return found
