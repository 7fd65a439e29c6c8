"""Eight manoeuvres, each with a pass mark from the robot's model.

Four are judged by counts alone.  The others compare where the robot ends with where its counts say: by the emulator, a
virtual board, a person with a tape or a laser, or the front sonar and a wall, which give the distance alone.
"""

import math
from statistics import median
from typing import Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mrl_driver.apps.calibration import manoeuvres, trial
from mrl_driver.apps.calibration.fit import BY_TAPE, BY_TRUTH, Measured
from mrl_driver.apps.calibration.ground_truth import (
    NOT_MEASURED,
    TAPE_MEASURE,
    Check,
    Ruler,
    Truth,
    truth_file,
)
from mrl_driver.apps.calibration.manoeuvres import Speeds, Track
from mrl_driver.apps.calibration.trial import Trial
from mrl_driver.cli.doctor.board import CALCULATED
from mrl_driver.driver import Driver
from mrl_driver.errors import BoardTimeout, ConfigError, MrlError, WheelFault
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot.models import OmniDrive, RobotModel
from mrl_driver.robot.models.drives import moves_sideways
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.view.words import fault_code

from .rows import COURSE, KINDS, Row, absent, failed, keys_of

SPACE = "2 m of free floor ahead of it, 1 m to its left and 0.5 m on the other sides"
LINE_M, SIDE_M, RADIUS_M, TURNS = 1.0, 0.5, 0.25, 2
WALL_M, NEAREST_M, FARTHEST_M = 0.4, 0.2, 3.0
"""Way towards a wall, and the ranges at which a front sonar is believed [m]."""
FRESH_S, READINGS, READING_S = 0.7, 5, 0.15
"""After `FRESH_S` at rest, a range is the median of `READINGS`, one every `READING_S` [s]."""
BY_WALL = Measured(0.02, math.pi)  # a sonar measures to about 2 cm
SLOWEST_MM_S = (30, 50, 80, 120, 200)
SMOOTH, WINDOW_S, SLOW_S, STARTING_S = 0.5, 0.25, 2.5, 0.8
"""A wheel turns smoothly if its counts in windows of `WINDOW_S` differ by less than this share of their mean, from
`STARTING_S` on."""
ALIKE_M_S, ALIKE_S, ALIKE_PERCENT = 0.2, 1.6, 1.0
FULL_SHARE, MOST_ACCELERATION_S = 0.95, 3.0
SEEN_PERCENT = 1.0
"""A sonar that sees something in a smaller share of two turns is deaf, if another one of its type sees more."""
SURE = {1: 15.1, 2: 18.4, 3: 21.1}
"""Squared deviations that one sound robot in 10 000 exceeds, by the number of values (chi-squared)."""
_POSE = BY_NAME["read_virtual_pose"].code
_OMNI = {
    "wheel_size": "correct metres_per_count in the robot's file: multiply it by the true distance over the wheels'",
    "track_width": "correct radius_m in the robot's file: multiply it by the wheels' angle over the true one",
}
_OTHER_OMNI = "check that the three wheels are alike, and that their rollers turn freely"
"""What mends omni wheels, which `mrl calibrate` does not measure, by cause."""
Rows = Sequence[Row]


class Source(NamedTuple):
    """What knows the robot's true pose, and how accurately; `ruler` is None if nothing does."""

    ruler: Optional[Ruler]
    measured: Measured = BY_TAPE


class Wall:
    """A ruler that has a wall ahead: it measures the distance towards it alone."""

    def __init__(self, robot: Driver) -> None:
        self._robot = robot
        self._range_m = math.nan

    def begin(self, run: str) -> None:
        """Measure the range."""
        self._range_m = front_m(self._robot)

    def end(self, run: str, check: Check) -> Pose:
        """By how much the wall is closer."""
        return NOT_MEASURED._replace(x_m=self._range_m - front_m(self._robot))


def source(robot: Driver, truth: Optional[str], asks: bool) -> Source:
    """Return the best source: the emulator's file, the virtual board itself, a person, or a wall."""
    if truth is not None:
        return Source(Truth(truth_file(truth)), BY_TRUTH)
    if robot.board.virtual:
        return Source(Truth(lambda: _virtual_pose(robot)))
    if asks:
        return Source(TAPE_MEASURE)
    return Source(Wall(robot) if "front" in robot.ranges else None, BY_WALL)


def _virtual_pose(robot: Driver) -> Pose:
    x, y, heading = robot.ask(_POSE)
    return Pose(x / 1000, y / 1000, heading / 1000)


def front_m(robot: Driver) -> float:
    """Return the range of the front sonar at rest; NaN if it is not one that can be believed."""
    robot.wait(FRESH_S)
    ranges = []
    for _ in range(READINGS):
        robot.wait(READING_S)
        ranges.append(robot.ranges.get("front", math.nan))
    found = median(ranges)
    return found if NEAREST_M <= found <= FARTHEST_M else math.nan


def rows(robot: Driver, where: Source) -> Iterator[Row]:
    """Drive the eight manoeuvres; each ends near its start.  If the robot stops in one, it stays there."""
    model = robot.model
    assert model is not None
    mends, seen = CALCULATED if robot.board.virtual else "", set()
    for key, manoeuvre in _Course(robot, model, where).manoeuvres():
        jumps, ended = robot.link.statistics.refused_counts, False
        try:
            found = manoeuvre()
        except (ConfigError, WheelFault, BoardTimeout) as error:
            cause, ended = _cause_of(robot, error, jumps), not isinstance(error, ConfigError)
            robot.stop()
            found = [failed(key, str(error), cause) if cause else absent(key, str(error))]
        for row in found:
            seen.add(row.key)
            yield row._replace(command=row.command or mends)
        if ended:
            break
    yield from (
        absent(key, "the robot did not drive it to its end") for key in keys(model) if key not in seen
    )


def _cause_of(robot: Driver, error: MrlError, jumps: int) -> str:
    """Return the code of the cause of a manoeuvre that failed; empty if it is not one of the robot."""
    if isinstance(error, ConfigError):
        return "encoder_noise" if robot.link.statistics.refused_counts > jumps else ""
    if robot.battery_state in ("empty", "off"):
        return f"battery_{robot.battery_state}"
    return error.code if robot.mismatch is None else fault_code(robot.mismatch)


def keys(model: RobotModel) -> List[str]:
    """Return the keys of the rows of `rows`: a base that moves sideways does so in place of the circle."""
    other = "arc" if moves_sideways(model.drive) else "sideways"
    return [key for key in keys_of(COURSE) if key != other]


class _Course:
    """The manoeuvres of one robot."""

    def __init__(self, robot: Driver, model: RobotModel, where: Source) -> None:
        self._robot, self._model, self._where = robot, model, where
        self._track, self._speeds = Track(robot), Speeds()
        self._cause = ""  # of the first run that ended elsewhere
        self._ranges: Dict[str, List[float]] = {}  # of each sonar in the turns
        robot.on_telemetry(self._look)

    def manoeuvres(self) -> List[Tuple[str, Callable[[], Rows]]]:
        """Return the eight manoeuvres, each with the key of its first row."""
        aside = moves_sideways(self._model.drive)
        return [
            ("sonar_wall", self.sonar_wall),
            ("slowest_mm_s", self.slowest),
            ("wheels_alike", self.wheels_alike),
            ("full_speed", self.full_stop),
            ("straight", self.straight),
            ("turn", self.turn),
            ("sideways", self.sideways) if aside else ("arc", self.arc),
            ("square", self.square),
        ]

    def _look(self, telemetry: Telemetry) -> None:
        for name, range_m in telemetry.ranges.items():
            self._ranges.setdefault(name, []).append(range_m)

    # -- by counts

    def sonar_wall(self) -> Rows:
        """Towards a wall: what the front sonar sees less, against what the wheels say."""
        before_m = front_m(self._robot) if "front" in self._robot.ranges else math.nan
        if not before_m > WALL_M + NEAREST_M:
            return [absent("sonar_wall", f"no wall from {WALL_M + NEAREST_M:g} to {FARTHEST_M:g} m ahead")]
        start = self._begin()
        manoeuvres.straight(self._robot, WALL_M, self._speeds)
        steps, moved_m = manoeuvres.steps_of(self._track.rows()), self._robot.pose.relative_to(start).x_m
        nearer_m = before_m - front_m(self._robot)
        self._back(start)
        if math.isnan(nearer_m):
            return [absent("sonar_wall", "the front sonar lost the wall")]
        spread_m = math.sqrt(spread(self._model, steps, BY_WALL)[0, 0])
        note = f"{1000 * nearer_m:.0f} mm by the sonar, {1000 * moved_m:.0f} mm by the wheels"
        return [Row("sonar_wall", 1000 * abs(nearer_m - moved_m), note=note, allowed=3000 * spread_m)]

    def slowest(self) -> Rows:
        """The slowest speed at which both wheels turn smoothly; calibrations and goals need the first one."""
        for speed_mm_s in SLOWEST_MM_S:
            rows = self._there_and_back(speed_mm_s / 1000, SLOW_S)
            if all(smooth(rows[:, 0], rows[:, column]) for column in (1, 2)):
                return [Row("slowest_mm_s", speed_mm_s, SLOWEST_MM_S[0])]
        return [failed("slowest_mm_s", "no speed that was tried was smooth")]

    def wheels_alike(self) -> Rows:
        """Both wheels, at the same speed: the difference of their counts."""
        rows = self._there_and_back(min(ALIKE_M_S, self._model.limits.linear_m_s), ALIKE_S)
        late = rows[rows[:, 0] > rows[-1, 0] - ALIKE_S / 2]
        right, left = np.abs(late[-1, 1:3] - late[0, 1:3])
        percent = float(200 * abs(right - left) / max(1.0, right + left))
        return [Row("wheels_alike", percent, allowed=300 * self._model.noise.wheel_ratio_sd + ALIKE_PERCENT)]

    def full_stop(self) -> Rows:
        """Stop from full speed: the speed that was reached, and the distance by the wheels until the robot stands.

        It is at most that of the model's acceleration after a delay.
        """
        robot, limits = self._robot, self._model.limits
        start, reached_m_s, before = self._begin(), 0.0, robot.pose
        end_s = robot.now_s + MOST_ACCELERATION_S
        full_m_s = min(
            limits.linear_m_s, limits.linear_acceleration_m_s2 * (MOST_ACCELERATION_S - STARTING_S)
        )

        def fast() -> bool:
            nonlocal reached_m_s, before
            reached_m_s, before = robot.twist.linear_m_s, robot.pose
            return reached_m_s >= FULL_SHARE * full_m_s or robot.now_s >= end_s

        self._roll(full_m_s, fast)
        way_m = robot.pose.relative_to(before).x_m
        self._back(start)
        most_m = reached_m_s * manoeuvres.LATENCY_S + reached_m_s**2 / (2 * limits.linear_acceleration_m_s2)
        speed = Row(
            "full_speed", 1000 * reached_m_s, 1000 * full_m_s, allowed=1000 * (1 - FULL_SHARE) * full_m_s
        )
        note = f"from {reached_m_s:.2f} m/s"
        return [speed, Row("full_stop", 1000 * way_m, allowed=1000 * most_m, note=note)]

    # -- by the true end

    def straight(self) -> Rows:
        """A straight line."""
        start = self._robot.pose
        row = self._run("straight", lambda: manoeuvres.straight(self._robot, LINE_M, self._speeds))
        self._back(start)
        return [row]

    def turn(self) -> Rows:
        """Turns in place, in which every sonar sees what the others see."""
        alike = absent("sonars_alike", "the robot did not turn")

        def drive() -> None:
            nonlocal alike
            self._ranges.clear()
            manoeuvres.turn(self._robot, 2 * math.pi * TURNS, self._speeds)
            alike = self._sonars_alike()

        return [self._run("turn", drive), alike]

    def _sonars_alike(self) -> Row:
        """How often the sonar saw something that lags most behind the others of its type."""
        shares = {
            name: 100 * float(np.mean(np.array(each) < math.inf)) for name, each in self._ranges.items()
        }
        if not shares:
            return absent("sonars_alike", "no sonar was read")
        types = {name: self._model.sonars[name].type for name in shares}
        best = {
            name: max(shares[other] for other in shares if types[other] == types[name]) for name in shares
        }
        last = max(shares, key=lambda name: best[name] - shares[name])
        for name, ranges in self._ranges.items():
            if np.isnan(ranges).all():
                return Row("sonars_alike", 0.0, 100.0, note=f"{name}: no reading", cause="sonar_dead")
        if not any(shares.values()):
            return absent("sonars_alike", "no sonar saw anything")
        allowed = max(0.0, best[last] - SEEN_PERCENT)
        return Row(
            "sonars_alike", shares[last], best[last], len(self._ranges[last]), note=last, allowed=allowed
        )

    def arc(self) -> Rows:
        """A circle to the left."""
        return [self._run("arc", lambda: _circle(self._robot, RADIUS_M, self._speeds))]

    def sideways(self) -> Rows:
        """A way to the left, without a turn."""
        start = self._robot.pose
        row = self._run("sideways", lambda: manoeuvres.sideways(self._robot, SIDE_M, self._speeds))
        manoeuvres.sideways(self._robot, -self._robot.pose.relative_to(start).y_m, self._speeds)
        return [row]

    def square(self) -> Rows:
        """A square to the left, back to its start."""
        return [self._run("square", lambda: manoeuvres.square(self._robot, SIDE_M, True, self._speeds))]

    def _run(self, key: str, drive: Callable[[], None]) -> Row:
        """Drive, and compare the true end with that by the counts."""
        ruler, name = self._where.ruler, key.replace("_", " ")
        if ruler is None:
            return absent(key, "nobody measures: give --truth, use a terminal, or a front sonar and a wall")
        ruler.begin(name)
        self._begin()
        drive()
        steps = manoeuvres.steps_of(self._track.rows())
        end = ruler.end(name, self._require_plausible(steps, name))
        row = judged(key, self._model, steps, end, self._where.measured, self._cause)
        self._cause = self._cause or row.likely
        return row

    def _require_plausible(self, steps: np.ndarray, name: str) -> Check:
        """Return what refuses a wrong answer of a person; other sources measure what there is."""
        if self._where.ruler is not TAPE_MEASURE:
            return lambda pose: None
        return lambda pose: trial.require_plausible(self._model.base, Trial(steps, pose), name)

    # -- driving

    def _begin(self) -> Pose:
        manoeuvres.settle(self._robot)
        self._track.begin()
        return self._robot.pose

    def _roll(self, speed_m_s: float, done: Callable[[], bool]) -> None:
        """Drive at one speed until then, and come to rest."""
        manoeuvres.follow(self._robot, lambda _: None if done() else (speed_m_s, 0.0), manoeuvres.PATIENCE_S)

    def _there_and_back(self, speed_m_s: float, seconds: float) -> np.ndarray:
        """Drive at one speed, and back; return the track of the first drive, up to its stop."""
        start = self._begin()
        end_s = self._robot.now_s + seconds
        self._roll(speed_m_s, lambda: self._robot.now_s >= end_s)
        rows = self._track.rows()
        self._back(start)
        driven: np.ndarray = rows[rows[:, 0] <= end_s]
        return driven

    def _back(self, start: Pose) -> None:
        x_m = self._robot.pose.relative_to(start).x_m
        manoeuvres.straight(self._robot, -x_m, self._speeds)


def _circle(robot: Driver, radius_m: float, speeds: Speeds) -> None:
    """Drive a whole circle to the left by odometry."""
    turned_rad, before_rad = 0.0, robot.pose.yaw_rad
    rate = min(speeds.angular_rad_s, speeds.linear_m_s / radius_m)

    def steer(pose: Pose) -> Optional[Tuple[float, float]]:
        nonlocal turned_rad, before_rad
        turned_rad += wrap_angle(pose.yaw_rad - before_rad)
        before_rad = pose.yaw_rad
        return (rate * radius_m, rate) if turned_rad < 2 * math.pi else None

    manoeuvres.follow(robot, steer, 10 + 8 * math.pi / rate)


def smooth(times_s: np.ndarray, counts: np.ndarray) -> bool:
    """Whether a wheel turns, and evenly."""
    edges = np.arange(times_s[0] + STARTING_S, times_s[-1], WINDOW_S)
    turned = np.diff(np.interp(edges, times_s, counts))
    return len(turned) > 1 and float(np.ptp(turned)) < SMOOTH * abs(float(np.mean(turned)))


def spread(model: RobotModel, steps: np.ndarray, measured: Measured) -> np.ndarray:
    """Covariance (3, 3) of the true end minus that by the counts: random errors, scales, and the measurement.

    Scales are those of `covariance.WheelUncertainty`.
    """
    drive, noise, wheels = model.base, model.noise, steps.shape[1]
    wheel_sd = noise.wheel_ratio_sd * math.sqrt(wheels // 2 / 2)
    turning = drive._replace(turn_slip=1 - (1 - drive.turn_slip) * (1 + noise.turn_scale_sd))
    others = [trial.path(drive, steps * (1 + wheel_sd * one)) for one in np.eye(wheels)]
    end = trial.path(drive, steps)[-1]
    off = [path[-1] - end for path in (trial.path(turning, steps), *others)]
    off.append(noise.distance_scale_sd * end * (1, 1, 0))
    scales: np.ndarray = sum(np.outer(each, each) for each in off)
    total: np.ndarray = trial.spread(drive, steps, noise) + scales + np.diag(measured.variances)
    return total


def judged(
    key: str, model: RobotModel, steps: np.ndarray, end: Pose, measured: Measured, cause: str = ""
) -> Row:
    """Return the row of a run: its error, as a share of what the model allows; `cause` is that of an earlier run."""
    error = trial.errors(model.base, [Trial(steps, end)])[0]
    known = np.isfinite(error) & (key != "turn", key != "turn", True)  # of a turn in place, the heading alone
    if not known.any():
        return absent(key, "this needs the heading" if key == "turn" else "the end was not measured")
    covariance = spread(model, steps, measured)[np.ix_(known, known)]
    squared = float(error[known] @ np.linalg.solve(covariance, error[known])) / SURE[int(known.sum())]
    cause = cause or _cause(key, error)
    command = _OMNI.get(cause, _OTHER_OMNI) if isinstance(model.drive, OmniDrive) else ""
    return Row(key, math.sqrt(squared), note=_in_words(error), cause=cause, command=command)


def _cause(key: str, error: np.ndarray) -> str:
    """Return the likely cause of an end elsewhere."""
    x, y, yaw = np.abs(np.nan_to_num(error))
    too_far = key == "straight" and x > max(y, LINE_M * yaw / 2)
    return "wheel_size" if too_far else KINDS[key].cause


def _in_words(error: np.ndarray) -> str:
    x, y, yaw = np.nan_to_num(error)
    return f"ends {1000 * math.hypot(x, y):.0f} mm and {abs(math.degrees(yaw)):.1f} deg from where the wheels say"
