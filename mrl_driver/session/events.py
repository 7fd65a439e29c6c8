"""The events that a session and its driver report; each is a class of its own, with typed fields."""

import math
from typing import NamedTuple, Optional, Tuple, Union

from mrl_driver.protocol import Frame
from mrl_driver.protocol.stop_reason import STOP_REASONS, StopReason
from mrl_driver.protocol.table import BY_NAME, FAULTS, RESET_CAUSES

from .handshake import Board
from .sensor_polling import Reading


class Ready(NamedTuple):
    """The greeting is complete and the board streams."""

    board: Board
    restarted: bool  # the board restarted: counters and board time have a new baseline
    checked: bool  # frames carry a checksum, a sequence number and board time
    # The wheels stand still at most this long after the last telemetry, because the board's watchdog stops them [s].
    coast_s: float = math.inf
    imu: bool = False  # the board has an IMU, and its stream was started


class Counts(NamedTuple):
    """One frame of the stream: 16-bit counters, and sonars [wire cm] if the frame has them."""

    right: int
    left: int
    sonars: Optional[Tuple[int, ...]]
    time_s: float  # board time if `sequence` is set, else arrival time [s]
    stamp_s: float
    """Time when the counters were read [s, caller's clock]; the arrival time if the board sends no time."""
    arrival_s: float
    sequence: Optional[int]
    others: Tuple[int, ...] = ()
    """Counters of the rear wheel of three, or of rear left and rear right of four."""


class ImuReading(NamedTuple):
    """One reading of the IMU, in the axes of the chip: x y z."""

    time_s: float  # board time, on the same axis as `Counts.time_s` [s]
    stamp_s: float  # time of the reading [s, caller's clock]
    arrival_s: float  # time when the frame arrived [s, same clock]
    gyro_rad_s: Tuple[float, float, float]
    accel_m_s2: Tuple[float, float, float]  # acceleration; at rest it is that of gravity, upward


class ImuChanged(NamedTuple):
    """The gyro is not used for the heading, or is used again."""

    in_use: bool
    state: str  # the IMU's state now, one of `robot.imu.STATES`
    text: str  # one line for people: the reason, and what to do

    def __str__(self) -> str:
        return self.text


class Sonars(NamedTuple):
    """Sonar values [wire cm] that arrived in a frame of their own."""

    values: Tuple[int, ...]


class Ranges(NamedTuple):
    """Values of the HC-SR04 [wire mm], by input."""

    values: Tuple[int, ...]


class Info(NamedTuple):
    """A new `robot_info` reply."""

    board: Board


class Status(NamedTuple):
    """Board health: uptime, resets, faults, clamped commands."""

    uptime_s: int
    reset_cause: str
    stop_reason: StopReason
    faults: Tuple[str, ...]
    clamped: int
    impossible: Optional[int] = None
    """Encoder transitions that skip a state; None if the board does not count them."""


class OwnStop(NamedTuple):
    """The board has stopped the robot by itself, under a command to move."""

    reason: StopReason


GYRO_RAD_S, ACCEL_M_S2 = (BY_NAME["read_imu"].reply[i].scale for i in (0, 3))
"""One count of the IMU's gyro [rad/s] and accelerometer [m/s2]."""

WAITS = "the robot waits for a new command"
MAY_MOVE = "the robot may still be moving, for its board has no watchdog: stop it by hand"


class Stale(NamedTuple):
    """No telemetry for `age_s`; the session stops the robot and greets the board again."""

    age_s: float
    may_move: bool = False  # the robot was driving, and its board has no watchdog to stop it


class Awaited(NamedTuple):
    """The port cannot be opened yet, and is tried again; see `Options.port_timeout_s`."""

    port: str
    reason: str

    def __str__(self) -> str:
        return f"{self.reason}; the port is tried again"


class Lost(NamedTuple):
    """The port went away; the driver searches it, and the robot waits for a new command."""

    port: str
    reason: str
    may_move: bool = False  # the robot was driving, and its board has no watchdog to stop it

    def __str__(self) -> str:
        return f"{self.reason}; the port is searched; {MAY_MOVE if self.may_move else WAITS}"


class Reconnected(NamedTuple):
    """The robot answers again, on this port."""

    port: str

    def __str__(self) -> str:
        return f"the robot answers again, on {self.port}"


class Slowed(NamedTuple):
    """The line failed at the higher speed and now runs at `baud` [Bd]."""

    baud: int

    def __str__(self) -> str:
        return f"the line shows errors at its higher speed and goes back to {self.baud} baud"


class PathUnknown(NamedTuple):
    """The robot may have moved while its counters could not be followed; the pose does not contain that motion."""

    gap_s: float  # time between the last reading before and the first after [s]
    distance_m: float  # largest possible position error [m]
    turn_rad: float  # largest possible yaw error [rad]; at most pi

    def __str__(self) -> str:
        return (
            f"the wheels could not be followed for {self.gap_s:.1f} s: the pose may be off by up to "
            f"{self.distance_m:.2f} m and {self.turn_rad:.2f} rad"
        )


class Reply(NamedTuple):
    """Any other frame of the board."""

    frame: Frame


class SensorRead(NamedTuple):
    """A new reading of a sensor of `table.SENSORS`."""

    name: str
    reading: Reading


SessionEvent = Union[
    Ready, Counts, ImuReading, Sonars, Ranges, Info, Status, OwnStop, Stale, Reply, SensorRead
]
"""What a session reports."""


def imu_reading(args: Tuple[int, ...], time_s: float, stamp_s: float, arrival_s: float) -> ImuReading:
    """Return the fields of a `read_imu` reply in SI units, with the times of its frame."""
    gyro_x, gyro_y, gyro_z, accel_x, accel_y, accel_z = args
    return ImuReading(
        time_s,
        stamp_s,
        arrival_s,
        (gyro_x * GYRO_RAD_S, gyro_y * GYRO_RAD_S, gyro_z * GYRO_RAD_S),
        (accel_x * ACCEL_M_S2, accel_y * ACCEL_M_S2, accel_z * ACCEL_M_S2),
    )


def status_of(args: Tuple[int, ...]) -> Status:
    """Return the fields of a `read_status` reply as a `Status`."""
    high, low, cause, reason, faults, clamped, *bridge = args
    names = tuple(name for i, (name, _) in enumerate(FAULTS) if faults >> i & 1)
    return Status(high * 32768 + low, RESET_CAUSES[cause], STOP_REASONS[reason], names, clamped, *bridge)
