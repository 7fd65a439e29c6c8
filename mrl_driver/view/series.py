"""Numbers of a robot over time: names, units, values.  No I/O."""

import math
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.protocol.table import SENSOR_BY_NAME, SENSORS
from mrl_driver.robot.imu import ABSENT, IN_USE, LEARNING, OFF
from mrl_driver.robot.models import OmniDrive, RobotModel
from mrl_driver.session.sensor_polling import Reading, of_board

from .rows import sonar_order
from .shown_state import SILENT_S, has_motors, moves_sideways

Name = Tuple[str, str]
"""Name and unit of a value."""
_UNKNOWN = math.nan
_POSE: Tuple[Name, ...] = (("x", "m"), ("y", "m"), ("yaw", "rad"))
_SPEEDS: Tuple[Name, ...] = (("speed", "m/s"), ("turn rate", "rad/s"), ("sideways speed", "m/s"))
_IMU: Tuple[Name, ...] = (
    *((f"imu {axis} rate", "rad/s") for axis in ("roll", "pitch", "yaw")),
    *((f"imu acceleration {axis}", "m/s2") for axis in "xyz"),
    ("imu bias", "rad/s"),
)
_IMU_UNKNOWN = (_UNKNOWN,) * len(_IMU)
_HEARD = (LEARNING, IN_USE)
"""States in which the last reading of the IMU is a good one."""


class _Group(NamedTuple):
    """Values that are read together."""

    names: Sequence[Name]
    read: Callable[[], Sequence[float]]


class Series:
    """The numbers of one robot.

    Attributes:
        names: names and units, in the order of `values`.

    Args:
        robot: a connected Driver, or an object that has some of its properties; values of others are left out.
    """

    def __init__(self, robot: Any) -> None:
        self._robot = robot
        groups = _groups(robot)
        self.names = [name for group in groups for name in group.names]
        self._reads = [group.read for group in groups]

    def values(self) -> List[float]:
        """Return the values now.

        A value that is not known is NaN, such as a speed while no telemetry arrives.  Commanded speeds are 0 while the
        robot is stopped.  Ranges are those of REP 117, which have infinities.  The age of the link is infinite before
        the first telemetry.
        """
        found: List[float] = []
        for read in self._reads:
            found += read()
        return found

    def outdated(self) -> bool:
        """Return whether the robot has other values by now, such as another sonar."""
        return self.names != [name for group in _groups(self._robot) for name in group.names]


def _groups(robot: Any) -> List[_Group]:
    """Return the values that a robot has."""
    model: Optional[RobotModel] = robot.model
    groups = _motion(robot, model) if has_motors(model) else []
    groups += [*_ranges(robot, model), *_board(robot, model), *_imu(robot), *_link(robot), *_sensors(robot)]
    return groups


def _is_silent(robot: Any) -> bool:
    """Return whether no telemetry arrives.  A driver has speeds of zero then, which nobody has measured."""
    return robot.link.age_s > SILENT_S or not getattr(robot, "ready", True)


def _motion(robot: Any, model: Optional[RobotModel]) -> List[_Group]:
    axes = 3 if moves_sideways(model) else 2

    def speeds() -> Sequence[float]:
        if _is_silent(robot):
            return (_UNKNOWN,) * axes
        twist = robot.twist
        return (twist.linear_m_s, twist.angular_rad_s, twist.lateral_m_s)[:axes]

    def asked() -> Sequence[float]:
        command = robot.command
        if command is None:
            return (0.0,) * axes
        return (command.linear_m_s, command.angular_rad_s, command.lateral_m_s)[:axes]

    groups = [
        _Group(_POSE, lambda: robot.pose),
        _Group(_SPEEDS[:axes], speeds),
        _Group([(f"asked {name}", unit) for name, unit in _SPEEDS[:axes]], asked),
    ]
    if model is not None and hasattr(robot, "telemetry"):
        wheels = _Wheels(robot, model)
        groups.append(_Group([(f"{name} wheel", "m/s") for name in wheels.names], wheels.speeds))
    return groups


class _Wheels:
    """Speeds of the wheels, from the counts of the two newest frames."""

    def __init__(self, robot: Any, model: RobotModel) -> None:
        drive: Any = model.drive
        self.names = ("right", "left", "rear") if isinstance(drive, OmniDrive) else ("right", "left")
        self._m_per_count = (drive.right_m_per_count, drive.left_m_per_count, drive.metres_per_count)
        self._robot = robot
        self._newest: Any = None
        self._speeds = self._unknown = (_UNKNOWN,) * len(self.names)

    def speeds(self) -> Sequence[float]:
        """Return the speeds [m/s]; NaN if they are not known."""
        telemetry, before = self._robot.telemetry, self._newest
        if telemetry is None or not self._robot.ready:
            self._newest, self._speeds = None, self._unknown
        elif telemetry is not before:
            self._newest, self._speeds = telemetry, self._unknown
            if before is not None and telemetry.stamp_s > before.stamp_s:
                dt_s = telemetry.stamp_s - before.stamp_s
                pairs = zip(telemetry.counts, before.counts, self._m_per_count)
                self._speeds = tuple([(now - then) * scale / dt_s for now, then, scale in pairs])
        return self._speeds


def _ranges(robot: Any, model: Optional[RobotModel]) -> List[_Group]:
    names = sonar_order(tuple(dict.fromkeys((*(model.sonars if model is not None else ()), *robot.ranges))))

    def read() -> Sequence[float]:
        ranges: Dict[str, float] = {} if _is_silent(robot) else robot.ranges
        return [ranges.get(name, _UNKNOWN) for name in names]

    return [_Group([(f"sonar {name.replace('_', ' ')}", "m") for name in names], read)] if names else []


def _board(robot: Any, model: Optional[RobotModel]) -> List[_Group]:
    """Return what a motor board measures."""
    if not has_motors(model):
        return []

    def measured() -> Any:
        return getattr(robot, "board", robot)  # a robot of ROS topics has no board

    groups = [_Group([("battery", "V")], lambda: (measured().battery_v,))]
    if hasattr(measured(), "temperature_c"):
        groups.append(_Group([("temperature", "degC")], lambda: (measured().temperature_c,)))
    return groups


def _imu(robot: Any) -> List[_Group]:
    if not hasattr(robot, "imu"):
        return []
    if robot.imu is None and getattr(robot, "imu_state", ABSENT) in (ABSENT, OFF):
        return []

    def read() -> Sequence[float]:
        imu = robot.imu
        if imu is None or _is_silent(robot) or getattr(robot, "imu_state", IN_USE) not in _HEARD:
            return _IMU_UNKNOWN
        bias_rad_s = imu.bias_rad_s if imu.bias_known else _UNKNOWN
        return (*imu.angular_velocity_rad_s, *imu.linear_acceleration_m_s2, bias_rad_s)

    return [_Group(_IMU, read)]


def _link(robot: Any) -> List[_Group]:
    groups = [
        _Group([("link age", "s"), ("link delay", "s")], lambda: (robot.link.age_s, robot.link.delay_s))
    ]
    if not hasattr(robot.link, "statistics"):
        return groups

    def read() -> Sequence[float]:
        seen = robot.link.statistics
        return seen.lost, sum(seen.garbage.values())

    return [*groups, _Group([("frames lost", ""), ("frames damaged", "")], read)]


def _sensors(robot: Any) -> List[_Group]:
    if not hasattr(robot, "sensors"):
        return []
    there = set(robot.sensors)
    if hasattr(robot, "board"):
        there |= {row.name for row in of_board(robot.board.capabilities, robot.board.version)}
    rows = [row for row in SENSORS if row.name in there]
    blank = {row.name: (_UNKNOWN,) * len(row.fields) for row in rows}

    def read() -> Sequence[float]:
        found: Dict[str, Reading] = robot.sensors
        values: List[float] = []
        for name, unknown in blank.items():
            values += found[name].values if name in found else unknown
        return values

    return [_Group([name for row in rows for name in _fields(row.name)], read)] if rows else []


def _fields(name: str) -> List[Name]:
    fields, title = SENSOR_BY_NAME[name].fields, name.replace("_", " ")
    if len(fields) == 1:
        return [(title, fields[0].base_unit)]
    return [(f"{title} {field.name.replace('_', ' ')}", field.base_unit) for field in fields]
