"""Drives a robot for a calibration: straight lines, turns and squares by odometry, and steps of single motors.

The same code works with `Driver` and `SteppedDriver`.
"""

import math
from typing import Callable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from mrl_driver.clocks import slept_s
from mrl_driver.driver import Driver
from mrl_driver.errors import BoardTimeout, ConfigError, HostBusy
from mrl_driver.geometry import Pose, wrap_angle
from mrl_driver.navigation.line_follower import limit_to_stop
from mrl_driver.protocol.stop_reason import PASSING, StopReason
from mrl_driver.protocol.table import BY_NAME
from mrl_driver.robot.odometry import AnyWheels, FourWheels
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.view.words import stop_error

TICK_S = 0.05
SETTLED_S = 0.4  # if the counts do not change for this time, the robot is at rest
PATIENCE_S = 5.0
HELD_UP_S = 1.0
"""A robot stands while its driver refuses commands, as after a pause of the computer; it drives on within this time."""
STEP_TRIES = 3
KEEP_ALIVE_S = 0.1
"""Requests that drive motors are repeated after this time, which feeds the board's watchdog."""
ARRIVED_M, ARRIVED_RAD = 0.003, math.radians(0.4)
LEAST_M_S, LEAST_RAD_S = 0.03, 0.15  # slower than this the motors may not turn at all
LATENCY_S = 0.2  # delay from a command to the motion of the wheels
HEADING_GAIN, OFFSET_GAIN = 3.0, 3.0
MOVE_PID, MOVE, SET_GAINS = (
    BY_NAME[name].code for name in ("move_motors_pid", "move_motors", "set_pid_gains")
)

Command = Optional[Tuple[float, ...]]


FIRST_WHEEL = 4
"""Column of a track from which on it has the counts of each wheel."""


class Speeds(NamedTuple):
    """Speeds of a calibration; low, to avoid slip."""

    linear_m_s: float = 0.2
    angular_rad_s: float = 0.8
    braking_m_s2: float = 0.15
    braking_rad_s2: float = 0.8


class Track:
    """Records the wheels from `begin` on.  Make one per robot: its callback stays registered."""

    def __init__(self, robot: Driver) -> None:
        self._robot = robot
        self._rows: List[Tuple[float, ...]] = []
        self._refused = self._restarts = 0
        robot.on_telemetry(lambda telemetry: self._rows.append(_row(telemetry)))

    def begin(self) -> None:
        """Start to record."""
        telemetry = self._robot.telemetry
        self._rows = [_row(telemetry)] if telemetry else []
        seen = self._robot.link.statistics
        self._refused, self._restarts = seen.refused_counts, seen.restarts

    def rows(self) -> np.ndarray:
        """(N, 4 + W) readings since `begin`: time [s], right, left [count, without wrap], range of the front sonar [m],
        and the counts of each wheel.

        Raise ConfigError if the counts jumped or the board restarted, which makes the run unusable.
        """
        seen = self._robot.link.statistics
        if seen.restarts != self._restarts:
            raise ConfigError(
                "the board restarted in this run, expected one that runs through: check its supply, then drive the run "
                "again"
            )
        jumps = seen.refused_counts - self._refused
        if jumps:
            raise ConfigError(
                f"the counts jumped {jumps} times in this run, expected no jump: check encoder plugs and motor power, "
                "then drive the run again"
            )
        return np.array(self._rows).reshape(-1, len(self._rows[0]) if self._rows else FIRST_WHEEL)


def _row(telemetry: Telemetry) -> Tuple[float, ...]:
    front_m, counts = telemetry.ranges.get("front", math.nan), telemetry.counts
    return (telemetry.stamp_s, *sides(counts), front_m, *counts)


def sides(counts: AnyWheels) -> Tuple[float, float]:
    """Return the counts of the right and of the left side, of four wheels their means; NaN without encoders."""
    if isinstance(counts, FourWheels):
        return (counts.right + counts.rear_right) // 2, (counts.left + counts.rear_left) // 2
    return counts[0], counts[1]


def steps_of(rows: np.ndarray) -> np.ndarray:
    """(N, W) counts of each wheel between the readings of a track in which one moved."""
    steps = np.diff(rows[:, FIRST_WHEEL:], axis=0).astype(np.int64)
    moved: np.ndarray = steps[np.any(steps != 0, axis=1)]
    return moved


def settle(robot: Driver) -> None:
    """Stop, and wait until the robot is at rest; raise BoardTimeout if the wheels keep turning."""
    robot.stop()
    still_s, waited_s, last = 0.0, 0.0, _counts(robot)
    while still_s < SETTLED_S:
        robot.wait(TICK_S)
        waited_s += TICK_S
        counts = _counts(robot)
        still_s = still_s + TICK_S if counts == last and robot.stopped else 0.0
        last = counts
        if waited_s > PATIENCE_S:
            if not robot.ready:
                raise stop_error(robot, "the stop was not confirmed")
            raise BoardTimeout(
                f"the wheels still turn {PATIENCE_S:g} s after a stop; switch the motor power off"
            )


def _counts(robot: Driver) -> Sequence[float]:
    counted = robot.model is not None and robot.model.has_odometry
    return robot.telemetry.counts if counted and robot.telemetry else ()


def follow(robot: Driver, steer: Callable[[Pose], Command], patience_s: float) -> None:
    """Drive by `steer`, which returns speeds for a pose, or None at the end; then come to rest.

    WheelFault if a wheel did not follow its command.  BoardTimeout if a bumper or another input stopped the robot, it
    accepted no command for `HELD_UP_S`, its board restarted, this computer was suspended, or it did not arrive within
    `patience_s`.
    """
    waited_s = refused_s = 0.0
    restarts, most_s = robot.link.statistics.restarts, slept_s() + HELD_UP_S
    while True:
        command = steer(robot.pose)
        if command is None:
            break
        refused_s = 0.0 if robot.drive(*command) else refused_s + TICK_S
        if robot.mismatch is not None:
            raise stop_error(robot, "stopped early")
        if refused_s > HELD_UP_S or robot.link.statistics.restarts != restarts or slept_s() > most_s:
            error = stop_error(robot, "the robot accepted no command")
            robot.stop()
            raise error
        robot.wait(TICK_S)
        if robot.command is None and robot.stop_reason not in PASSING:
            raise stop_error(robot, "stopped early")
        waited_s += TICK_S
        if waited_s > patience_s:
            robot.stop()
            raise BoardTimeout(f"the robot did not arrive within {patience_s:.0f} s; clear its path")
    settle(robot)


def straight(robot: Driver, distance_m: float, speeds: Speeds, line: Optional[Pose] = None) -> None:
    """Drive straight, back for negative distances; `line` is the ideal start pose if it is not the present pose."""
    start, sign = line or robot.pose, math.copysign(1.0, distance_m)

    def steer(pose: Pose) -> Command:
        x_m, y_m, yaw_rad = pose.relative_to(start)
        left_m = abs(distance_m) - sign * x_m
        if left_m < ARRIVED_M:
            return None
        linear = sign * limit_to_stop(left_m, speeds.linear_m_s, speeds.braking_m_s2, LATENCY_S, LEAST_M_S)
        aside = max(-0.4, min(0.4, OFFSET_GAIN * y_m))
        error = wrap_angle(-sign * aside - yaw_rad)
        return linear, max(-speeds.angular_rad_s, min(speeds.angular_rad_s, HEADING_GAIN * error))

    follow(robot, steer, 10 + 4 * abs(distance_m) / speeds.linear_m_s)


def sideways(robot: Driver, distance_m: float, speeds: Speeds) -> None:
    """Drive to the left, or to the right for negative distances; the heading stays the same."""
    start, sign = robot.pose, math.copysign(1.0, distance_m)

    def steer(pose: Pose) -> Command:
        x_m, y_m, yaw_rad = pose.relative_to(start)
        left_m = abs(distance_m) - sign * y_m
        if left_m < ARRIVED_M:
            return None
        lateral = limit_to_stop(left_m, speeds.linear_m_s, speeds.braking_m_s2, LATENCY_S, LEAST_M_S)
        return -OFFSET_GAIN * x_m, -HEADING_GAIN * yaw_rad, sign * lateral

    follow(robot, steer, 10 + 4 * abs(distance_m) / speeds.linear_m_s)


def turn(robot: Driver, angle_rad: float, speeds: Speeds) -> None:
    """Turn in place, counter-clockwise for positive angles; more than one whole turn is possible."""
    done_rad, before = 0.0, robot.pose.yaw_rad

    def steer(pose: Pose) -> Command:
        nonlocal done_rad, before
        done_rad += wrap_angle(pose.yaw_rad - before)
        before = pose.yaw_rad
        left = (angle_rad - done_rad) * math.copysign(1.0, angle_rad)
        if left < ARRIVED_RAD:
            return None
        speed = limit_to_stop(left, speeds.angular_rad_s, speeds.braking_rad_s2, LATENCY_S, LEAST_RAD_S)
        return 0.0, math.copysign(speed, angle_rad)

    follow(robot, steer, 10 + 4 * abs(angle_rad) / speeds.angular_rad_s)


def square(robot: Driver, side_m: float, left: bool, speeds: Speeds) -> None:
    """Drive one lap, correcting the error of each corner."""
    corner = math.pi / 2 if left else -math.pi / 2
    line = robot.pose
    for _ in range(4):
        straight(robot, side_m, speeds, line)
        line = line.compose(side_m, 0.0, corner)
        turn(robot, _near(wrap_angle(line.yaw_rad - robot.pose.yaw_rad), corner), speeds)


def _near(angle_rad: float, wanted_rad: float) -> float:
    """The angle to turn; a small error must not reverse its direction."""
    return angle_rad if abs(angle_rad - wanted_rad) < 1.0 else wanted_rad


def spin_motors(robot: Driver, code: int, percents: Sequence[int], seconds: float) -> None:
    """Turn the motors at these shares of full speed; afterwards they turn until they are stopped.

    The robot must be settled first; before that, the driver still repeats its stop.  Raise BoardTimeout, with the robot
    stopped, if telemetry ends, this computer pauses, or the board stops the robot by itself.
    """
    for _ in range(max(1, round(seconds / KEEP_ALIVE_S))):
        robot.request(code, *percents)
        robot.wait(KEEP_ALIVE_S)
        if not robot.ready or robot.stop_reason != StopReason.USER:
            error = stop_error(robot, "the motors did not turn on")
            robot.stop()
            raise error


def step(robot: Driver, track: Track, code: int, percents: Sequence[int], seconds: float) -> None:
    """From rest, begin the track and turn the motors as `spin_motors` does.

    A step in which this computer was too busy is made again; raise HostBusy at the third such step, and after a pause
    of more than `HELD_UP_S`, a suspension, or a restart of the board.
    """
    restarts = robot.link.statistics.restarts
    for tries_left in reversed(range(STEP_TRIES)):
        settle(robot)
        track.begin()
        most_s, asleep_s = robot.now_s + seconds + HELD_UP_S + SETTLED_S, slept_s() + HELD_UP_S
        try:
            spin_motors(robot, code, percents, seconds)
            break
        except HostBusy:
            settle(robot)  # meanwhile the board reports its own stop, which is not one of the next step
            late = robot.now_s > most_s or slept_s() > asleep_s
            if late or not tries_left or robot.link.statistics.restarts != restarts:
                raise
