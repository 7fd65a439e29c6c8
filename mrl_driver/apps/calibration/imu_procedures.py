"""`mrl calibrate imu`: its mounting angles, and the scale of its gyro.  It drives; `imu_fit` computes."""

import math
from functools import partial
from typing import Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Sequence

import click
import numpy as np

from mrl_driver import figures
from mrl_driver.cli.commands.shared import Between, print_message
from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot.imu import Imu
from mrl_driver.robot.kinematics import Planar, kinematics_of
from mrl_driver.robot.models import ImuMount, RobotModel
from mrl_driver.robot.models.drives import metres_per_count
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.session.events import ImuReading

from . import fit, imu_fit, manoeuvres
from .calibration_files import Key
from .commands.calibrate_job import RUNS, TURNS, Job, Result, job_options, value_option
from .fit import Measured
from .geometry_procedures import Leg, turn_legs
from .ground_truth import Ruler, ruler_for, tell
from .imu_fit import Push, Rest, Turned
from .manoeuvres import Speeds

STAND_S, REST_S = 5.0, 3.0  # time at rest at the start, and before and after each turn [s]
PATIENCE_S = 20.0  # a robot that somebody has just put down must stand still within this time
CAPABILITY = "imu"
IMU_PERIOD_MS = 20  # time between two readings of the IMU


class ImuOutcome(NamedTuple):
    """Result of the calibration."""

    before: ImuMount
    after: ImuMount
    rest: Rest
    turns: List[Turned]
    yaw_sd_rad: float  # NaN if the yaw was not measured
    trouble: str  # why the yaw could not be measured; empty if it was, or was not asked for


class ImuTrack:
    """Records IMU and wheels from `begin` on.  Make one per robot: its callbacks stay registered."""

    def __init__(self, robot: Driver) -> None:
        assert robot.model is not None
        self.robot, self.model = robot, robot.model
        self._readings: List[ImuReading] = []
        self._telemetry: List[Telemetry] = []
        robot.on(Imu, lambda imu: self._readings.append(imu.reading))
        robot.on_telemetry(lambda telemetry: self._telemetry.append(telemetry))

    def begin(self) -> None:
        """Start to record."""
        self._readings, self._telemetry = [], []

    def readings(self, since: int = 0) -> np.ndarray:
        """(N, 8) readings since `begin`, or since reading `since`, as `imu_fit` takes them."""
        rows = [(r.time_s, r.stamp_s, *r.gyro_rad_s, *r.accel_m_s2) for r in self._readings[since:]]
        return np.array(rows).reshape(-1, 8)

    def ways(self) -> np.ndarray:
        """(K, 3) host's time [s], distance forward [m] and turn [rad] by the wheels alone, since `begin`."""
        planar = [by_wheels(self.model, each) for each in self._telemetry]
        rows = [(each.stamp_s, way[0], way[2]) for each, way in zip(self._telemetry, planar)]
        ways = np.array(rows).reshape(-1, 3)
        return ways - np.array([0.0, *ways[0, 1:]]) if len(ways) else ways


def by_wheels(model: RobotModel, telemetry: Telemetry) -> Planar:
    """Return distance and turn of all steps so far, by the wheels alone: both add up over any way."""
    base = kinematics_of(model.base)
    scales = zip(base.wheels, metres_per_count(model.base, base.wheels))
    return base.step([getattr(telemetry.counts, name) * scale for name, scale in scales])


def require_imu(robot: Driver) -> None:
    """Check that the board streams an IMU; raise ConfigError if it does not."""
    if CAPABILITY not in robot.board.capabilities:
        raise ConfigError(
            "the board has found no IMU, expected an MPU-6050 or a relative of it: check its wires (HARDWARE.md), and "
            "upload the firmware with mrl flash if it is older than the IMU"
        )


def stand(track: ImuTrack, seconds: float, begin: bool = False) -> Rest:
    """Wait until the robot has stood still for `seconds`, and return the means of that time.

    With `begin`, the track begins with that time.  Raise ConfigError if the robot does not come to rest.
    """
    robot = track.robot
    end_s = robot.now_s + PATIENCE_S
    while True:
        if begin:
            track.begin()
        since = len(track.readings())
        robot.wait(seconds)
        rows = track.readings(since)
        if len(rows) < imu_fit.LEAST_READINGS or imu_fit.is_still(rows) or robot.now_s > end_s:
            return imu_fit.rest_of(rows)


def calibrate(
    robot: Driver,
    ruler: Ruler,
    legs: Sequence[Leg],
    distance_m: float,
    measured: Measured,
    report: Callable[[str], None],
) -> ImuOutcome:
    """Stand still, drive straight, and turn in place, each between two rests; `report` gets the name of each step.

    `ruler` measures the heading at the end of each turn, as exactly as `measured` says.  A `distance_m` of 0 leaves out
    the straight drives, and so the yaw of the mount.  ConfigError if the readings of the IMU cannot be used, or
    contradict wheels and headings; errors of driving are those of `manoeuvres.follow`.
    """
    track = ImuTrack(robot)
    report("standing still")
    manoeuvres.settle(robot)
    rest = stand(track, STAND_S, begin=True)
    before = track.model.imu
    mount, yaw_sd_rad, trouble = imu_fit.levelled(before, rest.accel_m_s2), math.nan, ""
    if distance_m:
        try:
            yaw_rad, yaw_sd_rad = imu_fit.yaw_of(
                [_push(track, way_m, report) for way_m in (distance_m, -distance_m)]
            )
            mount = mount._replace(yaw_deg=round(math.degrees(yaw_rad), 1))
        except ConfigError as error:
            trouble = str(error)
    turns: List[Turned] = []
    for leg in legs:
        turns.append(_turn(track, ruler, leg, mount, turns, measured.heading_rad))
    scale, sd = imu_fit.scale_of(turns, measured.heading_rad)
    after = mount._replace(gyro_scale=round(scale, 5), gyro_scale_sd=round(sd, 5))
    return ImuOutcome(before, after, rest, turns, yaw_sd_rad, trouble)


def _push(track: ImuTrack, distance_m: float, report: Callable[[str], None]) -> Push:
    report(f"{abs(distance_m):g} m {'forward' if distance_m > 0 else 'back'}")
    rest = stand(track, REST_S, begin=True)
    manoeuvres.straight(track.robot, distance_m, Speeds())
    flat = imu_fit.levelled(track.model.imu, rest.accel_m_s2)
    return imu_fit.push_of(track.readings(), flat, track.ways()[:, :2])


def _turn(
    track: ImuTrack, ruler: Ruler, leg: Leg, mount: ImuMount, earlier: List[Turned], heading_sd_rad: float
) -> Turned:
    """Turn in place between two rests.  Between them the robot may also be turned by hand: the gyro notices it."""
    ruler.begin(leg.name)
    manoeuvres.settle(track.robot)
    before = stand(track, REST_S, begin=True)
    leg.drive(track.robot)
    wheels_rad = float(track.ways()[-1, 2])

    def turned(end: Pose, after: Optional[Rest]) -> Turned:
        if math.isnan(end.yaw_rad):
            raise ConfigError(f"{leg.name}: the heading was not measured, expected it in degrees")
        gyro_rad, sd_rad = imu_fit.angle(track.readings(), mount, before, after)
        scale = imu_fit.scale_of(earlier, heading_sd_rad)[0] if earlier else 1.0
        found = Turned(gyro_rad, sd_rad, wheels_rad, imu_fit.true_angle(gyro_rad, end.yaw_rad, scale))
        imu_fit.require_agreement(found, earlier, heading_sd_rad, leg.name)
        return found

    end = ruler.end(leg.name, lambda pose: turned(pose, None) and None)
    after = stand(track, REST_S)
    return turned(end, after)


def values_for(outcome: ImuOutcome) -> Dict[Key, float]:
    """Values of the robot's YAML file: what was measured."""
    names = ["roll_deg", "pitch_deg", "gyro_scale", "gyro_scale_sd"]
    if not math.isnan(outcome.yaw_sd_rad):
        names.insert(2, "yaw_deg")
    return {("imu", name): getattr(outcome.after, name) for name in names}


# -- the command


@click.command(short_help="Measure the mounting angles of the IMU, and the scale of its gyro.")
@job_options
@value_option("--turns", TURNS, 3, "Whole turns per run.")
@value_option("--count", RUNS, 4, "Runs, alternately left and right.")
@value_option(
    "--distance",
    Between(0.0, 5.0),
    0.4,
    "Length of the straight drives [m]; 0 leaves them out, and the yaw of the mount stays as it is.",
)
def imu(job: Job, turns: int, count: int, distance: float) -> None:
    """Measure the mounting angles of the IMU, and the scale of its gyro.

    Needs a level floor with a straight line on it, such as a joint or a strip of tape.  The robot stands still, which
    gives bias, noise, and roll and pitch of the mount.  It drives forward and back, which gives the yaw.  Then it turns
    in place, counter-clockwise and clockwise; after each run you align it with the line again, by hand.  The gyro
    notices this too, so that the true angle is a number of whole turns.  The first two runs are one turn each.

    Takes 3 min; after Ctrl-C it starts from the beginning.

    \b
    Examples:
      mrl calibrate imu --robot traxbot-1.yaml --port /dev/ttyACM0
      mrl calibrate imu --port /dev/pts/3 --truth truth.jsonl --yes     an emulated robot
    """
    ruler, legs = ruler_for(job.truth, heading_only=True), turn_legs(count, turns, Speeds())
    with job.robot(imu_period_ms=IMU_PERIOD_MS) as (driver, model, output):
        require_imu(driver)
        drives = f"drives {distance:g} m forward and back, and turns" if distance else "turns"
        job.confirm_drive(f"The robot {drives} in place. Does it stand on a level floor, with its path free?")
        measured = fit.BY_TRUTH if job.truth else fit.BY_TAPE
        outcome = calibrate(driver, ruler, legs, distance, measured, tell)
        if outcome.trouble:
            print_message(
                f"warning: {outcome.trouble}; imu.yaw_deg stays {outcome.after.yaw_deg:g}, measure it with a protractor"
            )
        values, lines, draw = values_for(outcome), _lines(outcome), partial(_draw, outcome)
        job.finish(Result("imu", model, output, values, lines, _facts(outcome), draw))


def _lines(outcome: ImuOutcome) -> List[str]:
    rest = outcome.rest
    before, after = (
        _in_degrees(turn.error_rad(mount.gyro_scale) for turn in outcome.turns)
        for mount in (outcome.before, outcome.after)
    )
    return [
        f"gyro at rest, axes of the chip: bias {_in_degrees(rest.gyro_rad_s)} deg/s, "
        f"noise {_in_degrees(rest.gyro_sd_rad_s)} deg/s",
        f"errors of the turns before: {before} deg",
        f"errors of the turns after:  {after} deg",
    ]


def _in_degrees(values: Iterable[float]) -> str:
    return ", ".join(f"{math.degrees(value):.2f}" for value in values)


def _facts(outcome: ImuOutcome) -> Dict[str, Any]:
    yaw_sd = outcome.yaw_sd_rad
    return {
        "bias_rad_s": outcome.rest.gyro_rad_s.tolist(),
        "noise_rad_s": outcome.rest.gyro_sd_rad_s.tolist(),
        "gravity_m_s2": outcome.rest.accel_m_s2.tolist(),
        "mount_before": outcome.before._asdict(),
        "mount_after": outcome.after._asdict(),
        "yaw_sd_rad": None if math.isnan(yaw_sd) else yaw_sd,
        "turns": [turn._asdict() for turn in outcome.turns],
    }


def _draw(outcome: ImuOutcome, path: str) -> None:
    """Plot the error of the gyro over the angle of each turn, before and after."""
    figure = figures.figure(6.0, 4.0)
    axes = figure.add_subplot()
    angles = np.degrees([turn.true_rad for turn in outcome.turns])
    for name, style, colour, mount in (
        ("before", "o", figures.ORANGE, outcome.before),
        ("after", "+", figures.BLUE, outcome.after),
    ):
        errors = np.degrees([turn.error_rad(mount.gyro_scale) for turn in outcome.turns])
        axes.plot(angles, errors, style, color=colour, label=f"{name}, scale {mount.gyro_scale:.4f}")
    axes.axhline(0, color=figures.GREY, linewidth=0.8)
    axes.set(xlabel="true angle [deg]", ylabel="gyro minus truth [deg]", title="Errors of the gyro")
    axes.legend(fontsize="small")
    figures.save(figure, path)
