"""Drives a square of 1 m by odometry alone, and measures the error at its end, before and after UMBmark."""

import math
import random
from functools import partial
from typing import List, Mapping, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.apps.calibration import fit, manoeuvres
from mrl_driver.apps.calibration.geometry_procedures import UMBMARK, evaluate, gather, umbmark_legs
from mrl_driver.apps.calibration.ground_truth import Truth
from mrl_driver.apps.calibration.trial import LEFT, RIGHT, Trial, errors, sense
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import ON_TRACKS, Drive

from . import disturbances, plot_style
from .experiment_report import Figure, Measure, Result, figures, over_seeds
from .experiment_robot import ExperimentRobot, Setting, open_robot

SIDE_M = 1.0
LAPS = 5  # laps in each direction for the calibration, as by default in `mrl calibrate umbmark`
UNSEEN = 500
"""Added to the seed of laps that show a calibration, so that their random errors are not those of the calibration."""
PUBLISHED = {LEFT: (9.67, -4.93), RIGHT: (7.71, 2.13)}
"""Distance [cm] and angle [deg] from the start after one lap (Araujo 2012)."""
LIKE_PUBLISHED = {"wheel_ratio": 0.9989, "wheel_size": 1.0, "axle": 1.0099, "slip": 0.0}
"""Errors of a robot whose odometry closes with the published angles: half their sum over four sides, and half their
difference over four corners."""
SPEEDS = manoeuvres.Speeds()


class Case(NamedTuple):
    """Robots, one for each seed; `given` are their errors that are not drawn."""

    key: str
    text: str
    given: Mapping[str, float]


ROUGH = {"noise": ON_TRACKS.wheel_m2_per_m, "turn_noise": ON_TRACKS.turn_rad2_per_rad}
"""Random errors as large as the model of a tracked robot assumes."""
CASES = (
    Case("like", "robots like the published one", LIKE_PUBLISHED),
    Case("drawn", "robots with drawn errors", {}),
    Case("rough", "the same robots with the random errors of a track's model", ROUGH),
)
"""The first has figures and a picture of its own."""


class Lap(NamedTuple):
    """One lap; `error` is the true end minus the end by odometry, in the frame of its start."""

    sense: str
    error: Pose
    true: List[Pose]

    @property
    def error_cm(self) -> float:
        """Distance between the two ends."""
        return 100 * math.hypot(self.error.x_m, self.error.y_m)

    @property
    def error_deg(self) -> float:
        """Angle between the two headings."""
        return math.degrees(self.error.yaw_rad)


class RobotLaps(NamedTuple):
    """A robot's laps with the model's drive and with the calibrated one, counter-clockwise and clockwise."""

    before: Sequence[Lap]
    after: Sequence[Lap]


def run(setting: Setting, live: Optional[Pose] = None) -> Result:
    """Calibrates each robot, drives the same laps without and with that; `live` is the error of one lap through ROS."""
    like = _robots(setting, CASES[0])
    rows = [row for number in range(2) for row in _direction_rows(like, number)]
    rows += [row for case in CASES[1:] for row in _case_rows(case, _robots(setting, case))]
    rows += _live_rows(Lap(LEFT, live, [])) if live else []
    remark = (
        "An error is the true end of a lap minus the end by odometry. UMBmark: "
        f"{LAPS} laps in each direction, whose ends are measured by tape. The laps of the figures are others. Control: "
        "the same laps without the calibration. Robots like the published one have the wheel ratio and the wheelbase "
        "that give the published angles; the distances are not put in. Of other robots, the worse of both directions "
        f"counts. Random errors: {disturbances.WANDER}; as in a track's model: {disturbances.option(**ROUGH)}."
    )
    remark += " The lap through ROS is in real time and not calibrated." if live else ""
    return Result("square", "Square of 1 m by odometry alone", rows, [_draw(setting, like)], remark)


def _robots(setting: Setting, case: Case) -> List[RobotLaps]:
    return over_seeds(lambda each: _robot(each, case), setting)


def _rows(
    key: str, text: str, laps: Sequence[Sequence[Lap]], control: Sequence[Sequence[Lap]], cm: str = ""
) -> List[Figure]:
    """Distance and angle of the worst of each robot's laps; the control are its laps without the calibration."""
    measures = (
        Measure(f"{key}_cm", text, "cm", lambda some: max(lap.error_cm for lap in some), published=cm),
        Measure(f"{key}_deg", "", "deg", lambda some: max(abs(lap.error_deg) for lap in some)),
    )
    return figures(measures, laps, control)


def _direction_rows(robots: Sequence[RobotLaps], number: int) -> List[Figure]:
    """Figures of the laps in one direction; published angles have signs."""
    before, after = ([laps[i][number : number + 1] for laps in robots] for i in range(2))
    turn = before[0][0].sense
    (cm, deg), key = PUBLISHED[turn], turn.replace("-", "_")
    farthest = partial(max, key=abs)
    angle = Measure(
        f"{key}_before_deg", "", "deg", lambda laps: laps[0].error_deg, farthest, f"{deg} deg", True
    )
    return [
        _rows(f"{key}_before", f"{CASES[0].text}, {turn}", before, [], f"{cm} cm")[0],
        angle.figure(before),
        *_rows(f"{key}_after", "after the calibration", after, before),
    ]


def _case_rows(case: Case, robots: Sequence[RobotLaps]) -> List[Figure]:
    """Figures of the worse lap of each robot."""
    before, after = ([laps[i] for laps in robots] for i in range(2))
    return _rows(f"{case.key}_after", f"{case.text}, after the calibration", after, before)


def _live_rows(lap: Lap) -> List[Figure]:
    cm, deg = PUBLISHED[lap.sense]
    text = f"a robot like the published one, through ROS, {lap.sense}"
    return [
        Figure("ros_before_cm", text, lap.error_cm, "cm", f"{cm} cm"),
        Figure("ros_before_deg", "", lap.error_deg, "deg", f"{deg} deg", put_in=True),
    ]


def _robot(setting: Setting, case: Case) -> RobotLaps:
    """Calibrates a robot, and drives other laps without and with the calibration."""
    error = disturbances.error(setting.seed, "square", **case.given)
    found = calibrated(setting, error)
    unseen = setting._replace(seed=setting.seed + UNSEEN)
    before, after = (_shown_laps(unseen, error, drive) for drive in (None, found))
    return RobotLaps(before, after)


def calibrated(setting: Setting, error: str) -> Drive:
    """The drive that UMBmark finds for a robot with these errors."""
    rng = random.Random(f"tape {setting.seed}")
    with open_robot(setting, error=error) as robot:
        runs = [each._replace(end=disturbances.measured(each.end, rng)) for each, _ in _laps(robot, LAPS)]
        found = evaluate(UMBMARK, runs, robot.model, fit.BY_TAPE).after
    assert isinstance(found, Drive)
    return found


def _shown_laps(setting: Setting, error: str, drive: Optional[Drive]) -> List[Lap]:
    """One lap in each direction, with a drive in place of the model's if it is not None."""
    with open_robot(setting, error=error, drive=drive) as robot:
        used = robot.model.differential
        return [Lap(sense(used, run), Pose(*errors(used, [run])[0]), true) for run, true in _laps(robot, 1)]


def _laps(robot: ExperimentRobot, count: int) -> List[Tuple[Trial, List[Pose]]]:
    """Drives `count` laps in each direction; returns the runs, and the true paths in the frame of their starts."""
    runs: List[Trial] = []
    paths: List[List[Pose]] = [[]]
    truth = Truth(lambda: robot.true_pose)
    robot.driver.on_telemetry(lambda _: paths[-1].append(truth.end("", lambda _: None)))

    def keep(driven: Trial) -> None:
        runs.append(driven)
        paths.append([])

    gather(robot.driver, umbmark_legs(count, SIDE_M, SPEEDS), truth, keep)
    return list(zip(runs, paths))


def _draw(setting: Setting, robots: Sequence[RobotLaps]) -> str:
    from matplotlib.patches import Circle

    made, (floor, ends) = plot_style.figure(2, 9.5, 5.6)
    for lap_before, lap_after, colour in zip(
        robots[0].before, robots[0].after, (plot_style.BLUE, plot_style.ORANGE)
    ):
        plot_style.path(floor, lap_before.true, colour, f"{lap_before.sense}, before", "--")
        plot_style.path(floor, lap_after.true, colour, f"{lap_after.sense}, after")
    plot_style.floor(floor, "true paths of a robot like the published one")
    floor.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), fontsize="small")
    marks = (("before", plot_style.ORANGE, "x"), ("after", plot_style.BLUE, "o"))
    for when, colour, mark in marks:
        laps = [each for robot in robots for each in getattr(robot, when)]
        x, y = ([100 * getattr(each.error, axis) for each in laps] for axis in ("x_m", "y_m"))
        ends.plot(x, y, mark, color=colour, label=f"{when} calibration", fillstyle="none")
    for cm, _ in PUBLISHED.values():
        label = "published distances" if cm > 9 else ""
        ends.add_patch(Circle((0.0, 0.0), cm, fill=False, linestyle="--", color=plot_style.GREY, label=label))
    title = f"ends of {len(robots)} robots' laps"
    ends.set(xlabel="error in x [cm]", ylabel="error in y [cm]", aspect="equal", title=title)
    ends.legend(loc="upper right", fontsize="small")
    return plot_style.save(made, setting.folder, "square")
