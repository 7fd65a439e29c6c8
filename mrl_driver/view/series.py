"""Numbers of a robot over time: names, units, values.  No I/O."""

import functools
import itertools
import math
from typing import Any, Dict, Iterable, Iterator, List, Optional, Tuple

from mrl_driver.protocol.table import SENSOR_BY_NAME, SENSORS
from mrl_driver.robot.imu import ABSENT, IN_USE, LEARNING, OFF
from mrl_driver.robot.kinematics import kinematics_of
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.models.drives import metres_per_count
from mrl_driver.robot.odometry import WHEELS_BY_COUNT, AnyTwist
from mrl_driver.session.sensor_polling import Reading, of_board

from .rows import sonar_order
from .shown_state import SILENT_S, has_motors, has_odometry, moves_sideways

Name = Tuple[str, str]  # name and unit of a value
_POSE: Tuple[Name, ...] = (("x", "m"), ("y", "m"), ("yaw", "rad"))
_SPEEDS: Tuple[Name, ...] = (("speed", "m/s"), ("turn rate", "rad/s"), ("sideways speed", "m/s"))
_ASKED: Tuple[Name, ...] = tuple((f"asked {name}", unit) for name, unit in _SPEEDS)
_IMU: Tuple[Name, ...] = (
    *((f"imu {axis} rate", "rad/s") for axis in ("roll", "pitch", "yaw")),
    *((f"imu acceleration {axis}", "m/s2") for axis in "xyz"),
    ("imu bias", "rad/s"),
)
_HEARD = (LEARNING, IN_USE)  # states in which the last reading of the IMU is a good one
_UNKNOWN = itertools.repeat(math.nan)
_Values = Iterator[Tuple[Name, float]]


class Series:
    """The numbers of one robot: a connected Driver, or an object that has some of its properties."""

    def __init__(self, robot: Any) -> None:
        self._robot = robot
        self._wheels = _Wheels(robot)
        self.names = list(self._read())  # names and units, in the order of `values`

    def values(self) -> List[float]:
        """Return the values now.

        A value that is not known is NaN, such as a speed while no telemetry arrives.  Commanded speeds are 0 while the
        robot is stopped.  Ranges are those of REP 117, which have infinities.  The age of the link is infinite before
        the first telemetry.
        """
        found = self._read()
        return [found.get(name, math.nan) for name in self.names]

    def outdated(self) -> bool:
        """Return whether the robot has other values by now, such as another sonar."""
        return self.names != list(self._read())

    def _read(self) -> Dict[Name, float]:
        robot = self._robot
        # without telemetry a driver has speeds of zero, which nobody has measured
        silent = robot.link.age_s > SILENT_S or not getattr(robot, "ready", True)
        found: Dict[Name, float] = {}
        if has_motors(robot.model):
            found.update(_motion(robot, silent))
        if has_odometry(robot.model):
            found.update(self._wheels.speeds())
        found.update(_ranges(robot, silent))
        if has_motors(robot.model):
            measured = getattr(robot, "board", robot)  # a robot of ROS topics has no board
            found["battery", "V"] = measured.battery_v
            if hasattr(measured, "temperature_c"):
                found["temperature", "degC"] = measured.temperature_c
        found.update(_imu(robot, silent))
        found["link age", "s"], found["link delay", "s"] = robot.link.age_s, robot.link.delay_s
        if hasattr(robot.link, "statistics"):
            seen = robot.link.statistics
            found["frames lost", ""], found["frames damaged", ""] = seen.lost, sum(seen.garbage.values())
        found.update(_sensors(robot))
        return found


def _motion(robot: Any, silent: bool) -> _Values:
    axes = 3 if moves_sideways(robot.model) else 2
    if has_odometry(robot.model):
        yield from zip(_POSE, robot.pose)
        yield from zip(_SPEEDS[:axes], _UNKNOWN if silent else _speeds(robot.twist))
    command = robot.command
    yield from zip(_ASKED[:axes], itertools.repeat(0.0) if command is None else _speeds(command))


def _speeds(twist: AnyTwist) -> Tuple[float, float, float]:
    return twist.linear_m_s, twist.angular_rad_s, twist.lateral_m_s


class _Wheels:
    """Speeds of the wheels, from the counts of the two newest frames."""

    def __init__(self, robot: Any) -> None:
        self._robot = robot
        self._newest: Any = None
        self._speeds: Iterable[float] = _UNKNOWN

    def speeds(self) -> _Values:
        """Return the speeds; NaN if they are not known, and none if the robot has no telemetry."""
        model: Optional[RobotModel] = self._robot.model
        if model is None or not hasattr(self._robot, "telemetry"):
            return iter(())
        drive: Any = model.drive
        names = WHEELS_BY_COUNT[len(kinematics_of(drive).wheels)]._fields
        telemetry, before = self._robot.telemetry, self._newest
        if telemetry is None or not self._robot.ready:
            self._newest, self._speeds = None, _UNKNOWN
        elif telemetry is not before:
            self._newest, self._speeds = telemetry, _UNKNOWN
            if before is not None and telemetry.stamp_s > before.stamp_s:
                dt_s = telemetry.stamp_s - before.stamp_s
                counts = zip(telemetry.counts, before.counts, metres_per_count(drive, names))
                self._speeds = [(now - then) * scale / dt_s for now, then, scale in counts]
        return zip(((f"{name.replace('_', ' ')} wheel", "m/s") for name in names), self._speeds)


def _ranges(robot: Any, silent: bool) -> _Values:
    model: Optional[RobotModel] = robot.model
    ranges: Dict[str, float] = robot.ranges
    for name in sonar_order(tuple(dict.fromkeys((*(model.sonars if model is not None else ()), *ranges)))):
        yield (f"sonar {name.replace('_', ' ')}", "m"), math.nan if silent else ranges.get(name, math.nan)


def _imu(robot: Any, silent: bool) -> _Values:
    imu, state = getattr(robot, "imu", None), getattr(robot, "imu_state", None)
    if not hasattr(robot, "imu") or (imu is None and state in (None, ABSENT, OFF)):
        return iter(())
    if imu is None or silent or state not in (None, *_HEARD):
        return zip(_IMU, _UNKNOWN)
    bias_rad_s = imu.bias_rad_s if imu.bias_known else math.nan
    return zip(_IMU, (*imu.angular_velocity_rad_s, *imu.linear_acceleration_m_s2, bias_rad_s))


def _sensors(robot: Any) -> _Values:
    readings: Dict[str, Reading] = getattr(robot, "sensors", {})
    there = set(readings)
    if hasattr(robot, "sensors") and hasattr(robot, "board"):
        there |= {row.name for row in of_board(robot.board.capabilities, robot.board.version)}
    for row in SENSORS:
        if row.name in there:
            found = readings[row.name].values if row.name in readings else _UNKNOWN
            yield from zip(_fields(row.name), found)


@functools.lru_cache(maxsize=None)
def _fields(name: str) -> Tuple[Name, ...]:
    fields, title = SENSOR_BY_NAME[name].fields, name.replace("_", " ")
    if len(fields) == 1:
        return ((title, fields[0].base_unit),)
    return tuple((f"{title} {field.name.replace('_', ' ')}", field.base_unit) for field in fields)
