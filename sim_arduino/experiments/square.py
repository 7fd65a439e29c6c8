"""Drives a square of 1 m by odometry alone, and measures the error at its end, before and after UMBmark."""

import math
import random
from typing import Dict, List, NamedTuple, Sequence, Tuple

from mrl_driver.calibration import manoeuvres
from mrl_driver.calibration.geometry_procedures import UMBMARK, evaluate, gather, umbmark_legs
from mrl_driver.calibration.ground_truth import Truth
from mrl_driver.calibration.trial import LEFT, RIGHT, Trial, errors, sense
from mrl_driver.geometry import Pose
from mrl_driver.robot.models import Drive

from . import plot_style
from .experiment_report import Figure, Result
from .experiment_robot import ExperimentRobot, Setting, open_robot, require_emulated

SIDE_M = 1.0
LAPS = 2
"""Laps in each direction, for the calibration."""
TEAM = 20
PUBLISHED = {LEFT: (9.67, -4.93), RIGHT: (7.71, 2.13)}
"""Distance [cm] and angle [deg] from the start after one lap (thesis 2012)."""
LIKE_PUBLISHED = {"wheel_ratio": 0.9989, "axle": 1.0099}
"""Errors of a robot whose odometry closes with the published angles: half their sum over four sides, and half their
difference over four corners.
"""
DEVIATION, MAX_SLIP = 0.005, 0.02
"""Hidden errors of the other robots, for errors of about 8 to 10 cm: standard deviation of wheel ratio and axle, and
largest slip.
"""
SPEEDS = manoeuvres.Speeds()


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
    """A robot's laps before and after the calibration, counter-clockwise and clockwise."""

    before: Sequence[Lap]
    after: Sequence[Lap]


def run(setting: Setting) -> Result:
    """Drives, calibrates and drives again, with a robot like the published one and with twenty others."""
    require_emulated(setting, "square")
    like = _robot(setting, **LIKE_PUBLISHED)
    rng = random.Random(f"square {setting.seed}")
    others = [_robot(setting, **_errors(rng)) for _ in range(TEAM)]
    rows = [row for lap in like.before for row in _rows(lap, "before")]
    rows += [row for lap in like.after for row in _rows(lap, "after")]
    before = sorted(lap.error_cm for robot in others for lap in robot.before)
    after = [lap for robot in others for lap in robot.after]
    rows += [
        Figure("others_before_cm", f"{TEAM} robots drawn at random, median", before[len(before) // 2], "cm"),
        Figure(
            "others_after_cm",
            "their worst lap after the calibration",
            max(lap.error_cm for lap in after),
            "cm",
        ),
        Figure("others_after_deg", "", max(abs(lap.error_deg) for lap in after), "deg"),
    ]
    remark = (
        "An error is the true end of a lap minus the end by odometry. UMBmark: two laps in each direction."
    )
    return Result("square", "Square of 1 m by odometry alone", rows, [_draw(setting, like, others)], remark)


def _errors(rng: random.Random) -> Dict[str, float]:
    ratio, axle = rng.gauss(1.0, DEVIATION), rng.gauss(1.0, DEVIATION)
    return {"wheel_ratio": ratio, "axle": axle, "slip": rng.uniform(0.0, MAX_SLIP)}


def _rows(lap: Lap, when: str) -> List[Figure]:
    cm, deg = PUBLISHED[lap.sense]
    direction = lap.sense.replace("-", "_")
    published = ("", "") if when == "after" else (f"{cm} cm", f"{deg} deg")
    return [
        Figure(
            f"{direction}_{when}_cm", f"{lap.sense}, {when} calibration", lap.error_cm, "cm", published[0]
        ),
        Figure(f"{direction}_{when}_deg", "", lap.error_deg, "deg", published[1]),
    ]


def _robot(setting: Setting, **hidden: float) -> RobotLaps:
    """Drives laps with hidden errors, calibrates, and drives laps with the calibrated drive."""
    error_option = ",".join(f"{key}={value:.5f}" for key, value in hidden.items())
    with open_robot(setting, error=error_option) as robot:
        model = robot.driver.model
        assert model is not None
        laps = _laps(robot, LAPS)
        found = evaluate(UMBMARK, [each for each, _ in laps], model).after
        before = [_lap(model.differential, *each) for each in laps]
    with open_robot(setting, error=error_option, drive=found) as robot:
        after = [_lap(found, *each) for each in _laps(robot, 1)]
    return RobotLaps([before[0], before[LAPS]], after)


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


def _lap(drive: Drive, driven: Trial, true: List[Pose]) -> Lap:
    return Lap(sense(drive, driven), Pose(*errors(drive, [driven])[0]), true)


def _draw(setting: Setting, like: RobotLaps, others: Sequence[RobotLaps]) -> str:
    made, (floor, ends) = plot_style.figure(2, 9.5, 5.6)
    for lap_before, lap_after, colour in zip(like.before, like.after, (plot_style.BLUE, plot_style.ORANGE)):
        plot_style.path(floor, lap_before.true, colour, f"{lap_before.sense}, before", "--")
        plot_style.path(floor, lap_after.true, colour, f"{lap_after.sense}, after")
    plot_style.floor(floor, "true paths of a robot like the published one")
    floor.legend(loc="upper center", bbox_to_anchor=(0.5, -0.1), fontsize="small")
    marks = (("before", plot_style.ORANGE, "x"), ("after", plot_style.BLUE, "o"))
    for when, colour, mark in marks:
        laps = [each for robot in others for each in getattr(robot, when)]
        x, y = ([100 * getattr(each.error, axis) for each in laps] for axis in ("x_m", "y_m"))
        ends.plot(x, y, mark, color=colour, label=f"{when} calibration", fillstyle="none")
    for cm, _ in PUBLISHED.values():
        ends.add_patch(plot_style.circle(cm, plot_style.GREY, "published distances" if cm > 9 else None))
    ends.set(
        xlabel="error in x [cm]",
        ylabel="error in y [cm]",
        aspect="equal",
        title=f"ends of {TEAM} robots' laps",
    )
    ends.legend(loc="upper right", fontsize="small")
    return plot_style.save(made, setting.folder, "square")
