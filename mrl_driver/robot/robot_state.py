"""The robot's state: session events go in; pose, speeds, ranges and battery state come out.  No I/O."""

import math
from typing import Dict, FrozenSet, List, NamedTuple, Optional, Tuple, Union

from mrl_driver.errors import WrongRobot
from mrl_driver.geometry import Pose
from mrl_driver.session.events import (
    Counts,
    Info,
    PathUnknown,
    Ready,
    Reply,
    SessionEvent,
    Sonars,
    Stale,
    Status,
)
from mrl_driver.session.handshake import Board, with_measured

from . import battery, models, sonar
from .models import OmniDrive, RobotModel, require_drivable
from .odometry import AnyTwist, AnyWheels, Odometry, fastest_wheel_m_s
from .omni_odometry import STREAM, OmniOdometry

UNSET = "the board's robot id is not set; set it with: mrl set-id ID --port PORT"


class Telemetry(NamedTuple):
    """The robot's state after one frame of the stream."""

    stamp_s: float
    """Time when the counters were read [s, clock of `time.monotonic()`]; increases from frame to frame."""
    arrival_s: float
    """Time when the frame arrived [s, same clock]."""
    pose: Pose
    twist: AnyTwist
    ranges: Dict[str, float]
    """Range of each sonar by name [m]: -inf too near, nan no reading, inf nothing in range (REP 117)."""
    fresh: Tuple[str, ...]
    """Names of the sonars whose reading is new in this frame."""
    counts: AnyWheels
    """Counts of each wheel since the start, without wrap [count]."""
    sequence: Optional[int]
    """Sequence number of the frame (int16, wraps); None from boards without one."""


RobotEvent = Union[Telemetry, Board, Ready, Status, Stale, PathUnknown, Reply]
"""What the state of a robot reports; a `Board` is its new battery voltage and temperature."""
SENSOR_BOARD_IDS = range(6, 11)
"""Robot ids of 2013 boards that carry environment sensors and do not drive the robot."""


class RobotState:
    """Pose, ranges and battery of one robot.  If `model` is None, the model that lists the board's id is used."""

    def __init__(
        self, model: Optional[RobotModel], ignore_battery: bool = False, any_id: bool = False
    ) -> None:
        self.model = model
        self._auto = model is None
        self.info: Optional[Board] = None
        self.odometry: Optional[Odometry] = None
        self.battery_state = battery.OK
        self.ranges: Dict[str, float] = {}
        self.telemetry: Optional[Telemetry] = None
        self.path_unknown: Optional[PathUnknown] = None
        """The `PathUnknown` event of the last reading; None if there is none."""
        self.powerless = False
        """The battery is empty or off, so the robot must not drive."""
        self._primed, self._used_s = 0, 0.0
        self._ignore_battery, self._any_id = ignore_battery, any_id
        self._monitor: Optional[battery.BatteryMonitor] = None
        self._new_readings = sonar.NewReadings()
        self._late_sonars: Tuple[str, ...] = ()

    @property
    def has_sonars(self) -> bool:
        """The board measures ranges.  2013 boards do not report it; for them the model and the robot id decide."""
        if self.model is None or self.info is None:
            return False
        return has_sonars(self.model, self.info.capabilities, self.info.robot_id)

    def admit(self, board: Board) -> Optional[str]:
        """Accept the board, and choose its model if none was given.

        A board may be asked for its identity more than once before it is ready; the last answer counts.

        Returns:
            The table row of the stream to start; None for the usual one.

        Raises:
            ConfigError: the board cannot move the base of this model.
            WrongRobot: another robot answers.
            BatteryDead: the battery is too low to start; not checked again after the start.
        """
        if self._auto and self.info is None:
            self.model = model_of(board)
        assert self.model is not None
        if board.robot_id not in self.model.ids and not self._any_id:
            raise _wrong(board, self.model)
        if self.info is not None and board.robot_id != self.info.robot_id and not self._any_id:
            raise WrongRobot(
                f"robot id {board.robot_id} answers, expected {self.info.robot_id}, the robot of before: "
                "connect that one, or start again"
            )
        if self.odometry is None and not self._ignore_battery and not _may_lack_battery(board):
            battery.require_charge(board.battery_v, self.model.battery)
        require_drivable(self.model)
        return STREAM if isinstance(self.model.drive, OmniDrive) else None

    def digest(self, event: SessionEvent, now: float) -> List[RobotEvent]:
        """Process an event; return the events for the listeners."""
        if isinstance(event, Counts):
            telemetry = self.on_counts(event)
            lost: List[RobotEvent] = [self.path_unknown] if self.path_unknown else []
            return [*lost, telemetry] if telemetry else []
        if isinstance(event, Sonars):
            if self.info is not None:  # otherwise the model is not known yet
                self._late_sonars = self._on_new(self._new_readings.update(event.values, now), event.values)
            return []
        if isinstance(event, Info):
            return self._on_info(event.board, now)
        if isinstance(event, Ready):
            self._on_ready(event)
        return [event]

    def _on_ready(self, event: Ready) -> None:
        assert self.model is not None
        self.info = event.board
        if self.odometry is None:
            self.odometry = odometry_of(self.model, event.checked)
            self._monitor = battery.BatteryMonitor(self.model.battery)
        elif event.restarted:
            self.odometry.reset()
        self.odometry.baseline.coast_s = event.coast_s

    def on_counts(self, event: Counts) -> Optional[Telemetry]:
        """Process one frame of the stream; return the telemetry, or None before the first greeting."""
        odometry = self.odometry
        if odometry is None:
            return None
        used, arrival_s, sonars = False, event.arrival_s, event.sonars
        if event.rear is None:
            used = odometry.update(event.right, event.left, event.time_s)
        elif isinstance(odometry, OmniOdometry):
            used = odometry.update(event.right, event.left, event.time_s, event.rear)
        self.path_unknown = None
        if used:
            self._used_s = arrival_s
        elif odometry.baseline.primed != self._primed:
            self._begin_baseline(odometry, arrival_s)
        if not sonars:
            fresh, self._late_sonars = self._late_sonars, ()
        elif sonars == self._new_readings.values and arrival_s < self._new_readings.due_s:
            fresh = ()
        else:
            fresh = self._on_new(self._new_readings.update(sonars, arrival_s), sonars)
        pose, twist, travel = odometry.pose, odometry.twist, odometry.travel
        telemetry = self.telemetry = _new(
            Telemetry, (event.stamp_s, arrival_s, pose, twist, self.ranges, fresh, travel, event.sequence)
        )
        return telemetry

    def _begin_baseline(self, odometry: Odometry, now: float) -> None:
        """A new baseline begins here; the movement since the last reading is unknown."""
        assert self.model is not None
        if self._primed:
            gap_s, limits = now - self._used_s, self.model.limits
            moving_s = min(gap_s, odometry.baseline.coast_s)
            turn_rad = min(math.pi, limits.angular_rad_s * moving_s)
            self.path_unknown = PathUnknown(gap_s, limits.linear_m_s * moving_s, turn_rad)
        self._primed, self._used_s = odometry.baseline.primed, now

    def _on_new(self, new: Tuple[str, ...], values: Tuple[int, ...]) -> Tuple[str, ...]:
        """Process sonar values of which those in `new` are new; return the names that this robot has."""
        if not self.has_sonars:
            return ()
        assert self.model is not None
        fresh = tuple(name for name in new if name in self.model.sonars)
        if fresh:
            version = self.info.version if self.info else 2
            self.ranges = {
                name: sonar.range_m(value, version)
                for name, value in zip(sonar.NAMES, values)
                if name in self.model.sonars
            }
        return fresh

    def _on_info(self, board: Board, now: float) -> List[RobotEvent]:
        if self.info is None or self._monitor is None:
            return []
        board = with_measured(board, self.info.capabilities)
        self.info = self.info._replace(battery_v=board.battery_v, temperature_c=board.temperature_c)
        self.battery_state = self._monitor.update(board.battery_v, now)
        self.powerless = not self._ignore_battery and self.battery_state in (battery.EMPTY, battery.OFF)
        return [self.info]


def _may_lack_battery(board: Board) -> bool:
    """Return whether 0 V may mean that the board does not measure its battery: it has not reported its capabilities."""
    return board.version >= 2 and board.protocol < 2 and board.battery_v == 0.0


def has_sonars(model: RobotModel, capabilities: FrozenSet[str], robot_id: Optional[int]) -> bool:
    """Return whether a board measures ranges.  2013 boards have no capabilities: model and robot id decide."""
    if not model.sonars:
        return False
    return "sonars" in capabilities if capabilities else robot_id not in SENSOR_BOARD_IDS


def odometry_of(model: RobotModel, exact_time: bool) -> Odometry:
    """Return the odometry for a robot of this model."""
    if isinstance(model.drive, OmniDrive):
        return OmniOdometry(model.drive, fastest_m_s(model), exact_time)
    return Odometry(model.drive, fastest_m_s(model), exact_time)


def model_of(board: Board) -> RobotModel:
    """Return the model that lists the board's id.

    Raises:
        WrongRobot: no model lists it.
    """
    name = models.by_id(board.robot_id)
    if name:
        return models.load(name)
    if board.robot_id == 0:
        raise WrongRobot(UNSET)
    raise WrongRobot(
        f"robot id {board.robot_id} is in no packaged model ({', '.join(models.names())}); name a model "
        "file that lists it"
    )


def fastest_m_s(model: RobotModel) -> float:
    """Return the speed that no wheel of this model exceeds [m/s]; faster counts are refused."""
    ceilings = model.board["linear_ceiling"] / 1000, model.board["angular_ceiling"] / 1000
    return fastest_wheel_m_s(*ceilings, model.drive.wheel_separation_m)


def _wrong(board: Board, model: RobotModel) -> WrongRobot:
    if board.robot_id == 0:
        return WrongRobot(UNSET)
    there = models.by_id(board.robot_id)
    named = f"{there} (id {board.robot_id})" if there else f"id {board.robot_id}"
    ids = ", ".join(map(str, model.ids))
    return WrongRobot(
        f"the board is {named}, expected {model.name} (id {ids}): choose the other robot model, or set "
        "the board's id with: mrl set-id"
    )


_new = tuple.__new__
