"""Heading with and without a gyro, on a robot whose model does not know its slip in turns; and how well the covariance
of the pose describes its errors.
"""

import math
import random
from functools import partial
from operator import itemgetter
from typing import Any, ContextManager, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.apps.calibration import fit, imu_procedures, manoeuvres
from mrl_driver.apps.calibration.geometry_procedures import turn_legs
from mrl_driver.apps.calibration.ground_truth import Truth
from mrl_driver.apps.calibration.trial import error_squared
from mrl_driver.driver import Telemetry
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.navigation.line_follower import Course
from mrl_driver.protocol.frames import to_int16
from mrl_driver.robot.models import ImuMount, Noise, load
from mrl_driver.robot.odometry import Odometry
from mrl_driver.robot.robot_state import odometry_of
from sim_arduino.hardware.imu import ImuErrors
from sim_arduino.world import world_file

from . import disturbances, l_course, plot_style
from .experiment_report import Figure, Measure, Result, figures, over_seeds
from .experiment_robot import ExperimentRobot, Setting, follow, open_robot

SEEDS, RUNS = 20, 100
TURNS, SLIP = 10, 0.1
PERIOD_MS = 20
STAND_S = 2.0
SPEEDS = manoeuvres.Speeds()
COURSE = "l-course"
CALIBRATION_LEGS, CALIBRATION_TURNS = 3, 5  # legs of `mrl calibrate imu`: two of one turn, and one of five
DRIVE = (
    *((0.25, 0.0, 4.0), (0.0, 0.8, 2.0), (0.25, 0.0, 3.0)),
    *((0.0, -0.8, 4.0), (0.2, 0.4, 3.0), (0.25, 0.0, 3.0)),
)
"""Speeds [m/s, rad/s] of a drive for the covariance, and how long [s]; about 3.4 m and 7 rad."""
WITHIN = (0.216, 9.348)
"""95 % of the normalised errors squared (NEES) of a pose with a right covariance: chi squared, 3 degrees of freedom."""


class Case(NamedTuple):
    """Robots of one model, all with the same slip, or with turns drawn from the model's noise if it is None."""

    key: str
    text: str
    robot: str
    slip: Optional[float]


CASES = (
    Case("tracks", "tracks with drawn slip", "traxbot", None),
    Case("tracks_no_slip", "tracks without slip", "traxbot", 0.0),
    Case("tracks_slip", f"tracks with {100 * SLIP:g} % slip", "traxbot", SLIP),
    Case("wheels", "wheels", "stingbot", None),
)
SOURCES = {"gyro": "gyro and wheels", "wheels": "wheels alone"}


def run(setting: Setting) -> Result:
    """Drives with and without the gyro, and compares the poses with the true ones."""
    with_gyro = over_seeds(lambda each: _errors(each, _calibrated(each)), setting, SEEDS)
    without = [_errors(setting, None)]  # nothing in it is drawn
    text = f"error of the heading after {TURNS} turns of 90 deg, {SOURCES['gyro']}"
    position = Measure("gyro_position_cm", "error of the position after the L-course", "cm", itemgetter(1))
    measures = (Measure("gyro_heading_deg", text, "deg", itemgetter(0)), position)
    rows = figures(measures, with_gyro, without)
    found: Dict[str, Sequence[float]] = {}
    for case in CASES:
        for source, squared in zip(SOURCES, zip(*_consistency(setting, case))):
            found[f"{SOURCES[source]}, {case.text}"] = squared
            rows += _nees_rows(source, case, squared)
    remark = (
        f"Emulated {setting.robot} with {100 * SLIP:g} % slip that its model does not know; this is put in. Control: "
        "the wheels alone. The seeds draw the errors of the IMU from its data sheet. The scale of the gyro is "
        f"calibrated by {CALIBRATION_LEGS} legs of up to {CALIBRATION_TURNS} turns to a mark, whose direction is "
        f"measured to {math.degrees(fit.BY_TAPE.heading_rad):.1f} deg. NEES: wheels and noise are drawn from the "
        "model's `noise`, and nothing is calibrated; poses with a right covariance have a mean of 3, and 95 % within "
        "the bounds."
    )
    picture = _draw(setting, with_gyro, without, found)
    return Result("gyro", "Heading by gyro and wheels", rows, [picture], remark)


def _nees_rows(source: str, case: Case, squared: Sequence[float]) -> List[Figure]:
    key, count = f"nees_{case.key}_{source}", len(squared)
    inside = 100 * sum(WITHIN[0] <= each <= WITHIN[1] for each in squared) / count
    text = f"NEES, {SOURCES[source]}, {case.text}: mean of {count} drives"
    return [
        Figure(f"{key}_mean", text, sum(squared) / count, seeds=count),
        Figure(f"{key}_within_percent", "share within the 95 % bounds", inside, "%", seeds=count),
    ]


# -- heading and position


def _calibrated(setting: Setting) -> ImuMount:
    """The IMU of this seed, as `mrl calibrate imu` finds it."""
    rng = random.Random(f"mark {setting.seed}")
    with _open(setting, ImuMount()) as robot:

        def look() -> Pose:
            x_m, y_m, yaw_rad = robot.true_pose
            return Pose(x_m, y_m, wrap_angle(yaw_rad + rng.gauss(0.0, fit.BY_TAPE.heading_rad)))

        legs = turn_legs(CALIBRATION_LEGS, CALIBRATION_TURNS, SPEEDS)
        found = imu_procedures.calibrate(robot.driver, Truth(look), legs, 0.0, fit.BY_TAPE, lambda _: None)
        return found.after


def _open(setting: Setting, mount: Optional[ImuMount], **wrong: float) -> ContextManager[ExperimentRobot]:
    """A robot with slip, and with an IMU if `mount` is not None; `wrong` has its other errors."""
    error = disturbances.option(**{"slip": SLIP, **wrong})
    imu: Dict[str, Any] = {}
    if mount is not None:
        imu = {"imu": True, "imu_errors": ImuErrors.drawn(setting.seed)}
    return open_robot(
        setting, COURSE, imu_mount=mount, period_ms=PERIOD_MS, error=error, footprint="none", **imu
    )


def _errors(setting: Setting, mount: Optional[ImuMount]) -> Tuple[float, float]:
    """Errors of one robot at the end of the turns [deg], and of the L-course that begins where they end [cm]."""
    with _open(setting, mount) as robot:
        robot.wait(STAND_S)
        robot.reset_pose(robot.true_pose)
        for _ in range(TURNS):
            manoeuvres.turn(robot.driver, math.pi / 2, SPEEDS)
        robot.wait(STAND_S)
        heading_deg = math.degrees(abs(_between(robot.pose, robot.true_pose)[2]))
        start = robot.true_pose
        robot.reset_pose(start)
        first = world_file.load(COURSE).start
        points = [start.compose(*Pose(*each, 0.0).relative_to(first)) for each in l_course.WAYPOINTS]
        follow(robot, Course([point[:2] for point in points]), lambda: None)
        robot.wait(STAND_S)
        return heading_deg, 100 * math.hypot(*_between(robot.pose, robot.true_pose)[:2])


def _between(pose: Pose, true: Pose) -> Tuple[float, float, float]:
    """True pose minus pose."""
    return true.x_m - pose.x_m, true.y_m - pose.y_m, wrap_angle(true.yaw_rad - pose.yaw_rad)


# -- covariance


def _consistency(setting: Setting, case: Case) -> List[Tuple[float, float]]:
    """Normalised errors squared of the poses of drives, by the fused heading and by the wheels alone."""
    noise = load(case.robot).noise

    def drive(each: Setting) -> Tuple[float, float]:
        return _drive(each, _drawn(noise, random.Random(f"{case.robot} {each.seed}"), case.slip))

    return over_seeds(drive, setting._replace(robot=case.robot), RUNS)


def _drawn(noise: Noise, rng: random.Random, slip: Optional[float]) -> Dict[str, float]:
    """Errors of a robot as the model's noise has them; the wheels' size does not change the turns."""
    size, ratio = 1 + rng.gauss(0.0, noise.distance_scale_sd), 1 + rng.gauss(0.0, noise.wheel_ratio_sd)
    turns = 1 + rng.gauss(0.0, noise.turn_scale_sd) if slip is None else 1.0
    return {
        "wheel_size": size,
        "axle": size / turns,
        "wheel_ratio": ratio,
        "slip": slip or 0.0,
        "noise": noise.wheel_m2_per_m,
        "turn_noise": noise.turn_rad2_per_rad,
    }


def _drive(setting: Setting, wrong: Dict[str, float]) -> Tuple[float, float]:
    """Normalised errors squared at the end of a drive, with the gyro and with the wheels alone."""
    with _open(setting, ImuMount(), **wrong) as robot:
        robot.wait(STAND_S)
        robot.reset_pose(robot.true_pose)
        alone = odometry_of(robot.model, exact_time=True)
        alone.set_pose(robot.true_pose)
        robot.driver.on_telemetry(partial(_follow, alone))
        for linear, angular, seconds in (*DRIVE, (0.0, 0.0, STAND_S)):
            for _ in range(round(seconds / 0.1)):
                robot.drive(linear, angular)
                robot.wait(0.1)
        telemetry, sure = robot.driver.telemetry, alone.uncertainty
        assert telemetry is not None and sure is not None
        by_gyro = error_squared(telemetry.spread, *_between(telemetry.pose, robot.true_pose))
        return by_gyro, error_squared(sure.spread, *_between(alone.pose, robot.true_pose))


def _follow(odometry: Odometry, telemetry: Telemetry) -> None:
    """Gives the counts of telemetry to a second odometry."""
    right, left = (to_int16(int(count)) for count in telemetry.counts[:2])
    odometry.update(right, left, telemetry.stamp_s)


def _draw(
    setting: Setting,
    with_gyro: Sequence[Any],
    without: Sequence[Any],
    found: Dict[str, Sequence[float]],
) -> str:
    made, (ends, shares) = plot_style.figure(2, 10.5, 5.2)
    for errors, colour, mark, label in (
        (without, plot_style.ORANGE, "x", SOURCES["wheels"]),
        (with_gyro, plot_style.BLUE, "o", SOURCES["gyro"]),
    ):
        ends.plot(*zip(*errors), mark, color=colour, label=label, fillstyle="none")
    ends.set(
        xlabel=f"heading after {TURNS} turns [deg]", ylabel="position after the L-course [cm]", xscale="log",
        yscale="log", title=f"errors of {SEEDS} robots",
    )  # fmt: skip
    ends.legend()
    colours = (plot_style.BLUE, plot_style.ORANGE, plot_style.SKY, plot_style.PINK)
    for number, (name, squared) in enumerate(found.items()):
        colour, line = colours[number // 2], plot_style.LINES[number % 2]
        points = [(each, (i + 0.5) / len(squared)) for i, each in enumerate(sorted(squared))]
        plot_style.path(shares, points, colour, name, line)
    for bound in WITHIN:
        shares.axvline(bound, color=plot_style.GREY, linewidth=0.8)
    shares.set(
        xlabel="NEES of the pose", ylabel="share of drives below", xscale="log", title="covariance and errors"
    )
    shares.legend(loc="upper center", bbox_to_anchor=(0.5, -0.13), ncol=2, fontsize="x-small")
    return plot_style.save(made, setting.folder, "gyro")
