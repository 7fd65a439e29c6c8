"""Finds the wiring of an H-bridge board with slow moves, and stores it.  It drives; `bridge_wiring` computes."""

import contextlib
from typing import Iterator, List, NamedTuple, Optional, Protocol, Tuple

from mrl_driver.driver import Driver
from mrl_driver.errors import MrlError, WheelFault
from mrl_driver.geometry import Pose

from . import bridge_wiring, manoeuvres
from .bridge_procedures import counts_per_turn
from .bridge_wiring import OTHER, SET, SINGLE_CHANNEL
from .ground_truth import Ruler
from .manoeuvres import MOVE, Track
from .wiring_check import LEFT, RIGHT, Trial

SLOW_PERCENT, SLOW_S = 20, 0.3
"""Share of full speed and duration of each move [s]: a wheel of 170 1/min turns by a sixth."""


class Witness(Protocol):
    """Sees the wheels: a user, or the true pose of an emulated robot."""

    def turned(self, output: str, expected: Optional[str], moved: Pose) -> Tuple[str, int]:
        """Return the wheel that turned alone, and +1 forward or -1 backward.

        Args:
            output: the motor output that was driven.
            expected: the wheel that must have turned; None if both are possible.
            moved: the measured motion; NaN if it was not measured.

        Raises:
            WheelFault: no wheel turned.
        """

    def turned_right(self, moved: Pose) -> bool:
        """Return whether the left wheel turned forward and the right one backward."""


class Scene(NamedTuple):
    """A robot and what observes it."""

    robot: Driver
    track: Track
    ruler: Ruler
    witness: Witness


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
    """Turn each motor output forward alone, slowly; return the sum to store.

    Raises:
        WheelFault: a wheel or an encoder did not do its part.
    """
    trials: List[Trial] = []
    for output, percents in ((LEFT, (SLOW_PERCENT, 0)), (RIGHT, (0, SLOW_PERCENT))):
        right, left, moved = _move(scene, f"{output} motor output, forward", *percents)
        expected = OTHER[str(trials[0].seen)] if trials else None
        seen, direction = scene.witness.turned(output, expected, moved)
        trials.append(Trial(output, right, left, seen, direction))
    assert scene.robot.model is not None
    return bridge_wiring.wiring_of(trials, counts_per_turn(scene.robot.model), single_channel)


def prove(scene: Scene) -> None:
    """Turn slowly to the right with the wiring in force, and check that each wheel and counter does its part.

    Raises:
        WheelFault: one does not.
    """
    right, left, moved = _move(scene, "a slow turn to the right", SLOW_PERCENT, -SLOW_PERCENT)
    assert scene.robot.model is not None
    bridge_wiring.require_proof(right, left, counts_per_turn(scene.robot.model))
    if not scene.witness.turned_right(moved):
        raise WheelFault(
            "the wheels did not turn the robot to the right, so the answers do not fit together; run mrl calibrate "
            "wiring again, and look at the wheels"
        )


def _move(scene: Scene, name: str, left_percent: int, right_percent: int) -> Tuple[int, int, Pose]:
    """Turn the motors slowly without speed control; return the counts, right and left, and the measured motion."""
    robot, track, ruler, _ = scene
    manoeuvres.settle(robot)
    ruler.begin(name)
    track.begin()
    manoeuvres.spin_motors(robot, MOVE, left_percent, right_percent, SLOW_S)
    manoeuvres.settle(robot)
    rows = track.end()
    right, left = (int(value) for value in rows[-1, 1:3] - rows[0, 1:3])
    return right, left, ruler.end(name, lambda _: None)
