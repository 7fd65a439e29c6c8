"""Calibrates parts: wires, the sonars' curve, the motors' gains.  It drives; the pure modules compute."""

import contextlib
from typing import Callable, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mrl_driver.driver import Driver
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import sonar_curve
from mrl_driver.robot.models import Drive, RobotModel
from mrl_driver.robot.sonar_curve import Curve

from . import from_recording, gains, manoeuvres, wiring_check
from .gains import Gains, MotorModel, Response
from .ground_truth import Ruler
from .manoeuvres import MOVE, MOVE_PID, Speeds, Track

DUTY_PERCENT, WIRING_S = 35, 0.5
STEP_PERCENT, STEP_S = 40, 1.5
STOP_S, FRESH_S = 1.5, 0.7
"""Duration of a stop in front of the wall, and time after which the readings belong to this stop [s]."""

READINGS, MIN_RANGE_SHARE = 5, 0.7
"""Number of readings at each distance, and smallest plausible range as a share of the distance."""

Observe = Callable[[str, Pose], Tuple[Optional[str], int]]
"""Which wheel turned, and in which direction, given the driven motor and the measured end; see `wiring.Trial`."""


def check_wiring(robot: Driver, track: Track, ruler: Ruler, observe: Observe) -> List[str]:
    """Turn each motor forward alone, without speed control; returns the faults of the wires."""
    trials = []
    for motor, percents in ((wiring_check.LEFT, (DUTY_PERCENT, 0)), (wiring_check.RIGHT, (0, DUTY_PERCENT))):
        manoeuvres.settle(robot)
        ruler.begin(f"{motor} motor alone")
        track.begin()
        manoeuvres.spin_motors(robot, MOVE, *percents, WIRING_S)
        manoeuvres.settle(robot)
        rows = track.end()
        right, left = (int(value) for value in rows[-1, 1:3] - rows[0, 1:3])
        trials.append(
            wiring_check.Trial(
                motor, right, left, *observe(motor, ruler.end(f"{motor} motor alone", lambda _: None))
            )
        )
    return wiring_check.diagnose(trials)


# -- sonar


class SonarPlan(NamedTuple):
    """Distances from the wall at which the robot stops: from `start_m` to `stop_m` in steps of `step_m`."""

    start_m: float = 2.0
    stop_m: float = 0.2
    step_m: float = 0.05

    def distances(self) -> List[float]:
        """All distances [m].

        Raises:
            ConfigError: there are too few distances, or they do not approach the wall.
        """
        good = 0.15 <= self.stop_m < self.start_m <= 6.0 and 0.01 <= self.step_m <= 0.5
        count = int((self.start_m - self.stop_m) / self.step_m + 1e-6) + 1 if good else 0
        if count < sonar_curve.LEAST_DISTANCES:
            raise ConfigError(
                f"--start {self.start_m:g} --step {self.step_m:g} --stop {self.stop_m:g} gives {count} distances, "
                f"expected at least {sonar_curve.LEAST_DISTANCES} between 6 m and 0.15 m"
            )
        return [self.start_m - i * self.step_m for i in range(count)]


def approach_wall(
    robot: Driver,
    track: Track,
    distances: Sequence[float],
    speeds: Speeds,
    report: Callable[[str], None],
    keep: Callable[[np.ndarray], None],
) -> None:
    """Drive towards the wall and stop at each distance [m]; the robot starts at the first one.

    After each distance, `keep` gets the rows of the track since the first distance.

    Raises:
        ConfigError: the wall, or another object, is much closer than expected.
    """
    line = robot.pose
    track.begin()
    for number, distance_m in enumerate(distances, 1):
        if number > 1:
            manoeuvres.straight(robot, distances[0] - distance_m, speeds, line)
        report(f"{number} of {len(distances)}: {distance_m:.2f} m")
        _require_free_path(_front_range(robot), distance_m)
        keep(track.so_far())


def require_sonars(robot: Driver) -> None:
    """Raise ConfigError if the robot has no front sonar, without which it would drive blindly."""
    if robot.model is None or "front" not in robot.model.sonars:
        raise ConfigError("this board has no front sonar, expected one: nothing was measured")


def _front_range(robot: Driver) -> float:
    """Median range of the front sonar while the robot stands still [m]; NaN without a reading."""
    readings = []
    for _ in range(READINGS):
        robot.wait(STOP_S / READINGS)
        readings.append(robot.telemetry.ranges.get("front", np.nan) if robot.telemetry else np.nan)
    return float(np.median(readings))


def _require_free_path(range_m: float, distance_m: float) -> None:
    """Refuse to drive on if the wall is much closer than expected; a sonar error cannot be that large."""
    if range_m < MIN_RANGE_SHARE * distance_m:
        raise ConfigError(
            f"the front sonar measures {max(range_m, 0.0):.2f} m, expected about {distance_m:.2f} m to the wall: "
            "measure --start from the sonar to the wall, and clear the path"
        )


def readings_at_stops(rows: np.ndarray, drive: Drive, start_m: float) -> Tuple[List[float], List[float]]:
    """Ranges of the front sonar [m], NaN for none, and distances by odometry [m], for each stop of a track.

    Args:
        rows: (N, 4) time, right, left, range; see `Track.end`.
        start_m: distance from the wall at the first row.
    """
    times_s = rows[:, 0]
    travelled_m = (rows[:, 1:3] - rows[0, 1:3]) @ (drive.right_m_per_count / 2, drive.left_m_per_count / 2)
    moved = np.flatnonzero(np.any(np.diff(rows[:, 1:3], axis=0) != 0, axis=1)) + 1
    edges = [0, *moved.tolist(), len(rows)]
    ranges, distances = [], []
    for begin, end in zip(edges, edges[1:]):
        stopped_s = times_s[begin:end] - times_s[begin]
        if not len(stopped_s) or stopped_s[-1] < STOP_S - 0.2:
            continue
        ranges_here = rows[begin:end, 3][stopped_s >= FRESH_S]
        ranges.append(float(np.median(np.where(np.isfinite(ranges_here), ranges_here, np.nan))))
        distances.append(start_m - float(travelled_m[begin]))
    return ranges, distances


def curve_in_force(robot: Driver) -> Curve:
    """The curve that converts counts to ranges now; ranges of 2013 boards are corrected to the thesis's curve."""
    if not robot.parameters.can_save:
        return sonar_curve.THESIS
    values = robot.parameters.read("sonar_a", "sonar_b", "sonar_c")
    return Curve(*(value / 1e4 for value in values.values()))


def curve_values(curve: Curve) -> Dict[str, int]:
    """The board's parameters for a curve."""
    return {f"sonar_{name}": round(value * 1e4) for name, value in curve.on_wire()._asdict().items()}


# -- gains


class Steps(NamedTuple):
    """A step of each wheel: times since the step [s], and distances (right, left) since then [count]."""

    times_s: np.ndarray
    right: np.ndarray
    left: np.ndarray

    def response(self, left: bool) -> Response:
        """Figures of one wheel; its steady speed is that of the last quarter."""
        travelled = np.abs(self.left if left else self.right)
        _, speed = gains.speeds(self.times_s, travelled)
        return gains.describe(self.times_s, travelled, float(speed[-max(1, len(speed) // 4) :].mean()))


def step(robot: Driver, track: Track, code: int, percent: int, seconds: float = STEP_S) -> Steps:
    """Turn in place from rest: left motor back, right motor forward."""
    manoeuvres.settle(robot)
    track.begin()
    manoeuvres.spin_motors(robot, code, -percent, percent, seconds)
    rows = track.end()
    manoeuvres.settle(robot)
    return steps_of_rows(rows)


def steps_of_rows(rows: np.ndarray) -> Steps:
    """Rows of a track that begins with the step."""
    if len(rows) < gains.LEAST_READINGS:
        raise ConfigError(f"a step has {len(rows)} readings, expected at least {gains.LEAST_READINGS}")
    return Steps(rows[:, 0] - rows[0, 0], rows[:, 1] - rows[0, 1], rows[:, 2] - rows[0, 2])


def identify(steps: Steps, percent: int = STEP_PERCENT) -> Tuple[MotorModel, MotorModel]:
    """Right and left motor, identified from a step of the duty."""
    duty = percent / 100
    return (
        gains.identify(steps.times_s, steps.right, duty),
        gains.identify(steps.times_s, steps.left, -duty),
    )


class Tuned(NamedTuple):
    """Result of the tuning."""

    plants: Tuple[MotorModel, MotorModel]
    before: Gains
    after: Gains
    steps_before: Steps
    steps_after: Steps


def tune(robot: Driver, track: Track, present: Gains, report: Callable[[str], None]) -> Tuned:
    """Drive steps of the duty, compute gains, and drive steps of the speed with the old and the new gains.

    At the end the old gains and the ramp are in force again, even after an error.
    """
    with ramp_off(robot):
        try:
            report(f"step of the duty, {STEP_PERCENT} %")
            plants = identify(step(robot, track, MOVE, STEP_PERCENT))
            wanted = gains.suggest(plants)
            measured = []
            for name, trial in (("present", present), ("suggested", wanted)):
                report(f"step of the speed, {name} gains {trial.kp} {trial.ki} {trial.kd}")
                set_gains(robot, trial)
                measured.append(step(robot, track, MOVE_PID, STEP_PERCENT))
            return Tuned(plants, present, wanted, measured[0], measured[1])
        finally:
            robot.stop()
            set_gains(robot, present)


@contextlib.contextmanager
def ramp_off(robot: Driver) -> Iterator[None]:
    """Without a ramp inside the block, if the board has a configuration; then with the former ramp again."""
    ramped = robot.parameters.can_save
    ramp = robot.parameters.read("ramp_time") if ramped else {}
    if ramped and not ramp["ramp_time"] and robot.model is not None:
        ramp = {"ramp_time": robot.model.board["ramp_time"]}  # a run that was killed left a ramp of 0
    try:
        if ramped:
            robot.parameters.write({"ramp_time": 0})
        yield
    finally:
        robot.stop()
        if ramped:
            robot.parameters.write(ramp)


def set_gains(robot: Driver, wanted: Sequence[int]) -> None:
    """Set gains until the board restarts."""
    robot.request(manoeuvres.SET_GAINS, *wanted)
    robot.wait(0.1)


def gains_in_force(robot: Driver, default: Gains) -> Gains:
    """The gains in the board's configuration; `default` if the board stores no configuration."""
    if not robot.parameters.can_save:
        return default
    return Gains(**robot.parameters.read(*Gains._fields))


# -- recordings


def recorded_gains(path: str, model: RobotModel) -> Tuple[Tuple[MotorModel, MotorModel], Gains]:
    """Motors and gains from a recorded step of the duty that turns both motors, in any directions.

    Raises:
        ConfigError: the recording has no such step.
    """
    rows, (left, right) = from_recording.step_of(from_recording.read(path, model), MOVE)
    steps = steps_of_rows(rows)
    if not left or not right:
        raise ConfigError(f"{path}: the first step turns only one motor, expected both")
    plants = (
        gains.identify(steps.times_s, steps.right, right / 100),
        gains.identify(steps.times_s, steps.left, left / 100),
    )
    return plants, gains.suggest(plants)


def recorded_wiring(path: str, model: RobotModel) -> List[str]:
    """Faults of the wires, from a recording of `check_wiring`; it does not show which wheel turned.

    Raises:
        ConfigError: in the recording, no motor was turned alone.
    """
    recorded = from_recording.read(path, model)
    times_s = recorded.rows[:, 0]
    found: Dict[str, Tuple[float, float]] = {}
    for time_s, frame in recorded.requests:
        if frame.code == MOVE and (frame.args[0] > 0) != (frame.args[1] > 0):
            motor = wiring_check.LEFT if frame.args[0] > 0 else wiring_check.RIGHT
            begin, last = found.get(motor, (time_s, time_s))
            found[motor] = (begin, time_s)
    trials = []
    for motor, (begin_s, last_s) in found.items():
        first, last = np.searchsorted(times_s, (begin_s, last_s + manoeuvres.SETTLED_S))
        moved = recorded.rows[min(last, len(times_s) - 1)] - recorded.rows[max(0, first - 1)]
        trials.append(wiring_check.Trial(motor, int(moved[1]), int(moved[2])))
    if not trials:
        raise ConfigError(f"{path}: no motor was turned alone, expected a recording of mrl calibrate wiring")
    return wiring_check.diagnose(trials)
