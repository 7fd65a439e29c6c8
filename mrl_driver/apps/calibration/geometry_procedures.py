"""The calibrations of geometry: the runs to drive, their evaluation, and the new parameters of model and board."""

from typing import Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import Drive, RobotModel

from . import fit, manoeuvres, umbmark
from .calibration_files import Key
from .fit import AXLE, OFFSET, SCALE, SLIP, Measured
from .ground_truth import Ruler
from .manoeuvres import Speeds, Track
from .trial import LEFT, NEITHER, RIGHT, Trial, errors, require_plausible, require_sense, sense

STRAIGHT, TURN, UMBMARK = "straight", "turn", "umbmark"
_WHOLE_TURN = 2 * np.pi
NOT_MEASURED = Pose(np.nan, np.nan, np.nan)  # a pose that was not measured


class Leg(NamedTuple):
    """One run to drive."""

    name: str
    sense: str
    drive: Callable[[Driver], None]


class Outcome(NamedTuple):
    """The drive before and after, and the errors (R, 3) of the runs with each, columns x y yaw [m m rad]."""

    before: Drive
    after: Drive
    errors_before: np.ndarray
    errors_after: np.ndarray
    noise: Mapping[str, float]  # what was measured of the model's `Noise`, by its keys
    square: Optional[umbmark.UmbmarkResult] = None


def straight_legs(runs: int, distance_m: float, speeds: Speeds) -> List[Leg]:
    """Straight runs, alternately forward and back."""

    def leg(number: int) -> Leg:
        sign, direction = (1, "forward") if number % 2 == 0 else (-1, "back")
        name = f"run {number + 1} of {runs}, {distance_m:g} m {direction}"
        return Leg(name, NEITHER, lambda robot: manoeuvres.straight(robot, sign * distance_m, speeds))

    return [leg(number) for number in range(runs)]


def turn_legs(runs: int, turns: int, speeds: Speeds) -> List[Leg]:
    """Turns, alternately left and right; the first two are one whole turn each, to count the others safely."""

    def leg(number: int) -> Leg:
        sign, sense = (1, LEFT) if number % 2 == 0 else (-1, RIGHT)
        whole = 1 if number < 2 else turns
        name = f"run {number + 1} of {runs}, {whole} turn{'s' * (whole > 1)} {sense}"
        return Leg(name, sense, lambda robot: manoeuvres.turn(robot, sign * whole * _WHOLE_TURN, speeds))

    return [leg(number) for number in range(runs)]


def umbmark_legs(laps: int, side_m: float, speeds: Speeds) -> List[Leg]:
    """Squares: first all counter-clockwise laps, then all clockwise laps."""

    def leg(number: int, sense: str) -> Leg:
        name = f"lap {number + 1} of {laps} {sense}"
        return Leg(name, sense, lambda robot: manoeuvres.square(robot, side_m, sense == LEFT, speeds))

    return [leg(number, sense) for sense in (LEFT, RIGHT) for number in range(laps)]


def gather(
    robot: Driver,
    legs: Sequence[Leg],
    ruler: Ruler,
    keep: Callable[[Trial], None],
    track: Optional[Track] = None,
) -> None:
    """Drive the legs one after the other; `keep` gets each run as soon as it is measured.

    Raises:
        ConfigError: a run went in the wrong direction, its counts jumped, or its end is impossible and the ruler
            does not measure again; this run is not kept.
        WheelFault, BoardTimeout: the robot could not drive a run.
    """
    track = track or Track(robot)
    assert robot.model is not None
    drive = robot.model.differential
    for leg in legs:
        ruler.begin(leg.name)
        track.begin()
        leg.drive(robot)
        steps, name = manoeuvres.steps_of(track.end()), leg.name
        require_sense(drive, Trial(steps, NOT_MEASURED), leg.sense, name)
        end = ruler.end(name, lambda pose: require_plausible(drive, Trial(steps, pose), name))  # noqa: B023
        keep(Trial(steps, end))


def check_recorded(procedure: str, drive: Drive, run: Trial, name: str) -> None:
    """Raise ConfigError for a run of another procedure, or with an end too far from the end by the counts."""
    found = sense(drive, run)
    if (found == NEITHER) != (procedure == STRAIGHT):
        raise ConfigError(f"{name} went {found}, expected a run of mrl calibrate {procedure}")
    require_sense(drive, run, found, name)
    require_plausible(drive, run, name)


def free_numbers(procedure: str, tracks: bool) -> Tuple[str, ...]:
    """The parameters that a procedure fits; on tracks the slip replaces the wheelbase."""
    turning = SLIP if tracks else AXLE
    return {STRAIGHT: (SCALE, OFFSET), TURN: (turning,), UMBMARK: (OFFSET, turning)}[procedure]


def evaluate(
    procedure: str,
    runs: List[Trial],
    model: RobotModel,
    side_m: float = 1.0,
    measured: Measured = fit.BY_TAPE,
    others: Sequence[Trial] = (),
) -> Outcome:
    """Evaluate the runs of a procedure.

    Args:
        side_m: side of UMBmark's square.
        measured: accuracy of the ends.
        others: runs of other procedures, for the noise.

    Raises:
        ConfigError: there are too few runs, or one contradicts the others.
    """
    before, start, result = model.differential, model.differential, None
    free = free_numbers(procedure, model.body.tracks)
    found = errors(before, runs)
    if procedure == UMBMARK:
        result = _umbmark(runs, found, before, side_m)
        start = umbmark.corrected(before, result, model.body.tracks)
    elif len(runs) < 2:
        raise ConfigError(f"there is {len(runs)} run, expected at least 2")
    elif procedure == TURN:
        start = fit.fit(runs[:2], before, free, model.noise, measured).drive
    fitted = fit.fit(runs, start, free, model.noise, measured)
    _require_no_outlier(runs, fitted)
    together = [*runs, *others]
    noise = fit.scale_deviations(fitted, free)
    if len(together) >= fit.LEAST_RUNS_FOR_NOISE:
        whole = fit.GeometryFit(fitted.drive, errors(fitted.drive, together), ())
        random = fit.estimate_noise(together, whole, len(free) + (len(others) > 0), measured)
        noise.update(wheel_m2_per_m=random.wheel_m2_per_m, turn_rad2_per_rad=random.turn_rad2_per_rad)
    return Outcome(before, fitted.drive, found, fitted.errors, noise, result)


def _require_no_outlier(runs: List[Trial], fitted: fit.GeometryFit) -> None:
    odd = fit.outlier(runs, fitted)
    if odd >= 0:
        off_m = float(np.hypot(*fitted.errors[odd, :2]))
        raise ConfigError(
            f"run {odd + 1} of {len(runs)} ends {off_m:.3f} m from where the others predict: wrongly measured, "
            f"or a wheel slipped; drive it again with --again {odd + 1}"
        )


def _umbmark(runs: List[Trial], found: np.ndarray, drive: Drive, side_m: float) -> umbmark.UmbmarkResult:
    points: Dict[str, List[umbmark.Point]] = {LEFT: [], RIGHT: []}
    for run, row in zip(runs, found):
        turned = (run.steps[:, 0] - run.steps[:, 1]).sum()
        points[LEFT if turned > 0 else RIGHT].append((float(row[0]), float(row[1])))
    return umbmark.evaluate(points[LEFT], points[RIGHT], side_m, drive.turning_separation_m)


def values_for(model: RobotModel, outcome: Outcome) -> Dict[Key, float]:
    """Values of the robot's YAML file that change.

    The board gets radii that make commanded speeds correct; they grow with wheels and wheelbase.
    """
    before, after = outcome.before, outcome.after
    values: Dict[Key, float] = {
        ("drive", name): getattr(after, name)
        for name in Drive._fields
        if getattr(after, name) != getattr(before, name)
    }
    wheel = model.board["wheel_radius"] * after.metres_per_count / before.metres_per_count
    axis = model.board["axis_radius"] * after.turning_separation_m / before.turning_separation_m
    for name, value in (("wheel_radius", wheel), ("axis_radius", axis)):
        if round(value) != model.board[name]:
            values["board", name] = round(value)
    values.update({("noise", name): value for name, value in outcome.noise.items()})
    return values
