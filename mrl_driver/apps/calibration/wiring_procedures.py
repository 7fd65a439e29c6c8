"""`mrl calibrate wiring`: with a motor board, names wires to exchange; with an H-bridge, stores how they are.

It turns the motors slowly; `wiring_check` computes.
"""

import contextlib
from typing import Any, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import click

from mrl_driver.cli.commands.shared import warn
from mrl_driver.driver import Driver
from mrl_driver.errors import BoardRefused, ConfigError, MrlError, WheelFault
from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import BRIDGES
from mrl_driver.robot.models import RobotModel

from . import from_recording, manoeuvres, wiring_check
from .commands import calibrate_job
from .commands.calibrate_job import Job, job_options, recording_option
from .gain_procedures import CAPABILITY, counts_per_turn, ramp_off
from .ground_truth import NOT_MEASURED, Ruler, Truth, require_terminal, ruler_for, tell
from .manoeuvres import MOVE, Track
from .wiring_check import LEAST_RAD, LEFT, OTHER, RIGHT, SET, SINGLE_CHANNEL, Trial, seen_in

CHIPS = BRIDGES[1:]
DUTY_PERCENT, WIRING_S = 35, 0.5  # moves with a motor board
SLOW_PERCENT, SLOW_S = 20, 0.3
"""Share of full speed and duration of each move with an H-bridge [s]: a wheel of 170 1/min turns by a sixth."""


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
        """Return whether the left wheel turned forward and the right one backward."""
        return self._ask("Did the left wheel turn forward, and the right one back", ["yes", "no"]) == "yes"

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
        """Counts of a wheel turn."""
        assert self.robot.model is not None
        return counts_per_turn(self.robot.model)


def check(scene: Scene) -> List[str]:
    """Turn each motor of a motor board forward alone, without speed control; return the faults of the wires."""
    trials = []
    for motor, percents in ((LEFT, (DUTY_PERCENT, 0)), (RIGHT, (0, DUTY_PERCENT))):
        right, left, moved = _move(scene, f"{motor} motor alone", *percents, WIRING_S)
        trials.append(Trial(motor, right, left, *scene.witness.turned(motor, None, moved)))
    return wiring_check.diagnose(trials)


@contextlib.contextmanager
def uncorrected(robot: Driver, bridge: int, single_channel: bool) -> Iterator[None]:
    """For the block, the board drives this bridge and corrects nothing; BoardRefused if it refuses that, or its pins.

    The board keeps what the block has set.  After an error or an interruption it gets back what was in force before:
    a board that was not set refuses to move again.  Nothing is saved to the EEPROM here.
    """
    before = robot.parameters.read("bridge", "wiring")
    try:
        robot.parameters.write({"bridge": bridge, "wiring": SET | (SINGLE_CHANNEL if single_channel else 0)})
        problem = robot.parameters.wiring_problem(robot.model)
        if problem:
            raise BoardRefused(f"{problem}; store the pins of the robot's file with: mrl flash --robot FILE")
        yield
    except BaseException:
        with contextlib.suppress(MrlError):
            robot.stop()
        with contextlib.suppress(MrlError):
            robot.parameters.write(before)
        raise


def find_wiring(scene: Scene, single_channel: bool) -> int:
    """Turn each output of an H-bridge forward alone, slowly; return the sum to store, or raise WheelFault."""
    trials: List[Trial] = []
    for output, percents in ((LEFT, (SLOW_PERCENT, 0)), (RIGHT, (0, SLOW_PERCENT))):
        right, left, moved = _move(scene, f"{output} motor output, forward", *percents, SLOW_S)
        expected = OTHER[str(trials[0].seen)] if trials else None
        seen, direction = scene.witness.turned(output, expected, moved)
        if not direction:
            raise WheelFault(
                f"no wheel turned when the {output} motor output was driven, expected one: check the battery, the "
                "motor's wires, and that --bridge names the right chip"
            )
        trials.append(Trial(output, right, left, seen, direction))
    return wiring_check.wiring_of(trials, scene.counts_per_turn, single_channel)


def prove(scene: Scene) -> None:
    """Turn slowly to the right with the new wiring; raise WheelFault unless each wheel and counter does its part."""
    right, left, moved = _move(scene, "a slow turn to the right", SLOW_PERCENT, -SLOW_PERCENT, SLOW_S)
    wiring_check.require_proof(right, left, scene.counts_per_turn)
    if not scene.witness.turned_right(moved):
        raise WheelFault(
            "the wheels did not turn the robot to the right, so the answers do not fit together; run mrl calibrate "
            "wiring again, and look at the wheels"
        )


def _move(
    scene: Scene, name: str, left_percent: int, right_percent: int, seconds: float
) -> Tuple[int, int, Pose]:
    """Turn the motors without speed control; return the counts, right and left, and the measured motion."""
    robot, track, ruler, _ = scene
    manoeuvres.settle(robot)
    ruler.begin(name)
    track.begin()
    manoeuvres.spin_motors(robot, MOVE, left_percent, right_percent, seconds)
    manoeuvres.settle(robot)
    rows = track.rows()
    right, left = (int(value) for value in rows[-1, 1:3] - rows[0, 1:3])
    return right, left, ruler.end(name, lambda _: None)


def recorded(path: str, model: RobotModel) -> List[str]:
    """Faults of the wires, from a recording of `check`; it does not show which wheel turned."""
    steps = from_recording.motor_steps(path, model)
    alone = {LEFT if left else RIGHT: rows[-1] - rows[0] for rows, (left, right) in steps if not left * right}
    trials = [Trial(motor, int(moved[1]), int(moved[2])) for motor, moved in alone.items()]
    if not trials:
        raise ConfigError(f"{path}: no motor was turned alone, expected a recording of mrl calibrate wiring")
    return wiring_check.diagnose(trials)


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
    direction.  A slow turn to the right proves the result.  After Ctrl-C the board is as before.

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
    with calibrate_job.connect(job) as driver:
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


def _report(found: List[str], job: Job) -> None:
    """Print the faults of a motor board's wires; raise WheelFault if there is one."""
    if job.run.as_json or not found:
        job.run.print({"findings": found}, "the wiring of motors and encoders is right")
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
    scene, number = _scene(driver, job, Witness(answers)), _bridge_of(driver, bridge)
    job.confirm_drive(
        f"Each wheel turns slowly for {SLOW_S} s, driven by a {BRIDGES[number].upper()}. "
        "Are the wheels off the ground?"
    )
    with uncorrected(driver, number, single_channel):
        with ramp_off(driver):  # a slow ramp would not reach 20 % in 0.3 s
            found = find_wiring(scene, single_channel)
            driver.parameters.write({"wiring": found})
            prove(scene)
        if job.eeprom is not False:
            driver.parameters.save()
    words = wiring_check.in_words(found)
    facts = {"bridge": BRIDGES[number], "wiring": found, "differences": words}
    kept = "in force until the board restarts" if job.eeprom is False else "stored in the board's EEPROM"
    job.run.print(facts, f"{', '.join(words) or 'the wires are as in HARDWARE.md'}: wiring {found}, {kept}")


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
