"""Finds how motors and encoders are wired, by slow moves.  It drives; `wiring_check` computes."""

import contextlib
from typing import Dict, Iterator, List, NamedTuple, Optional, Tuple

import numpy as np

from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError, MrlError, WheelFault
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import RobotModel

from . import from_recording, manoeuvres, wiring_check
from .gain_procedures import counts_per_turn
from .ground_truth import Ruler
from .manoeuvres import MOVE, Track
from .wiring_check import LEFT, OTHER, RIGHT, SET, SINGLE_CHANNEL, Trial

DUTY_PERCENT, WIRING_S = 35, 0.5  # moves with a motor board
SLOW_PERCENT, SLOW_S = 20, 0.3
"""Share of full speed and duration of each move with an H-bridge [s]: a wheel of 170 1/min turns by a sixth."""


class Witness:
    """Sees the wheels: a user, or the true pose of an emulated robot.  This one sees nothing."""

    def turned(self, motor: str, expected: Optional[str], moved: Pose) -> Tuple[Optional[str], int]:
        """Return the wheel that turned alone, None if it was not observed; and +1 forward, -1 backward, 0 if none did.

        `expected` is the wheel that must have turned, None if both are possible; `moved` the measured motion, or NaN.
        """
        return None, 0

    def turned_right(self, moved: Pose) -> bool:
        """Return whether the left wheel turned forward and the right one backward."""
        return False


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
    """For the block, the board drives this bridge and corrects nothing.

    The board keeps what the block has set.  After an error or an interruption it gets back what was in force before:
    a board that was not set refuses to move again.  Nothing is saved to the EEPROM here.

    Raises:
        BoardRefused: the board refused a parameter.
    """
    before = robot.parameters.read("bridge", "wiring")
    try:
        robot.parameters.write({"bridge": bridge, "wiring": SET | (SINGLE_CHANNEL if single_channel else 0)})
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
    rows = track.end()
    right, left = (int(value) for value in rows[-1, 1:3] - rows[0, 1:3])
    return right, left, ruler.end(name, lambda _: None)


def recorded(path: str, model: RobotModel) -> List[str]:
    """Faults of the wires, from a recording of `check`; it does not show which wheel turned."""
    replayed = from_recording.read(path, model)
    times_s = replayed.rows[:, 0]
    found: Dict[str, Tuple[float, float]] = {}
    for time_s, frame in replayed.requests:
        if frame.code == MOVE and (frame.args[0] > 0) != (frame.args[1] > 0):
            motor = LEFT if frame.args[0] > 0 else RIGHT
            found[motor] = (found.get(motor, (time_s,))[0], time_s)
    trials = []
    for motor, (begin_s, last_s) in found.items():
        first, last = np.searchsorted(times_s, (begin_s, last_s + manoeuvres.SETTLED_S))
        moved = replayed.rows[min(last, len(times_s) - 1)] - replayed.rows[max(0, first - 1)]
        trials.append(Trial(motor, int(moved[1]), int(moved[2])))
    if not trials:
        raise ConfigError(f"{path}: no motor was turned alone, expected a recording of mrl calibrate wiring")
    return wiring_check.diagnose(trials)
