"""The robot's state: session events go in; pose, speeds, ranges and battery state come out.  No I/O."""

import math
from typing import Any, Dict, FrozenSet, List, NamedTuple, Optional, Tuple, Union

from mrl_driver.errors import WrongRobot
from mrl_driver.geometry import Pose
from mrl_driver.session.events import (
    Counts,
    ImuChanged,
    ImuReading,
    Info,
    OwnStop,
    PathUnknown,
    Ranges,
    Ready,
    Reply,
    SensorRead,
    SessionEvent,
    Sonars,
    Stale,
    Status,
)
from mrl_driver.session.handshake import Board, with_measured
from mrl_driver.session.sensor_polling import SENSOR_STREAM

from . import battery, imu, models, sonar
from .covariance import AT_START, Spread, Uncertainty, Variances, WheelUncertainty
from .imu import Imu, ImuTracker
from .kinematics import kinematics_of
from .models import ECHO_INPUTS, RobotModel, require_supported
from .odometry import AnyTwist, AnyWheels, NoOdometry, Odometry, fastest_wheel_m_s
from .wheel_odometry import STREAMS, WheelOdometry

UNSET = "the board's robot id is not set; set it with: mrl set-id ID --port PORT"


SURELY_NEW = 0.9
"""An equal value of an HC-SR04 counts as a new reading after this share of a round: requests do not keep its time."""


class Telemetry(NamedTuple):
    """The robot's state after one frame of the stream."""

    stamp_s: float
    """Time when the counters were read [s, clock of `time.monotonic()`]; increases from frame to frame."""
    arrival_s: float
    """Time when the frame arrived [s, same clock]."""
    pose: Pose
    """NaN for motors without encoders, as the twist, the counts and all variances."""
    twist: AnyTwist
    ranges: Dict[str, float]
    """Range of each sonar by name [m]: -inf too near, nan no reading, inf nothing in range (REP 117)."""
    fresh: Tuple[str, ...]
    """Names of the sonars whose reading is new in this frame."""
    counts: AnyWheels
    """Counts of each wheel since the start, without wrap [count]."""
    sequence: Optional[int]
    """Sequence number of the frame (int16, wraps); None from boards without one."""
    gyro: bool = False
    """The turn since the last frame comes from the gyro, not from the wheels."""
    spread: Spread = AT_START
    """Covariance of the pose."""
    twist_variances: Variances = (0.0, 0.0, 0.0)
    """Variances of the twist: linear, angular, lateral [m2/s2, rad2/s2, m2/s2]."""


RobotEvent = Union[Telemetry, Imu, ImuChanged, Board, Ready, Status, Stale, PathUnknown, Reply, SensorRead]
"""What the state of a robot reports; a `Board` is its new battery voltage and temperature."""


class RobotState:
    """Pose, ranges and battery of one robot.  If `model` is None, the model that lists the board's id is used.

    `build` replaces the model's, see `models.with_build`: ConfigError if the model cannot have it.  When a board
    without sonars is ready, the model has none either.
    """

    def __init__(
        self,
        model: Optional[RobotModel],
        ignore_battery: bool = False,
        any_id: bool = False,
        build: str = "",
        robot_id: Optional[int] = None,
        virtual: Optional[bool] = None,
    ) -> None:
        self.model = models.with_build(model, build) if model is not None else None
        self._auto, self._build, self._robot_id, self._virtual = model is None, build, robot_id, virtual
        self.info: Optional[Board] = None
        self.odometry: Optional[Odometry] = None
        self.battery_state = battery.OK
        self.ranges: Dict[str, float] = {}
        self.telemetry: Optional[Telemetry] = None
        self.tracker: Optional[ImuTracker] = None
        """Checks the readings of the IMU; None unless the board has, or had, one that is read."""
        self.settled = False  # the stream has begun, so that the robot can be used
        self.powerless = False  # the battery is empty or off, so the robot must not drive
        self.model_tells = not any_id  # whether the robot is virtual
        self._primed, self._used_s, self._counted_s = 0, 0.0, -math.inf
        self._ignore_battery, self._any_id = ignore_battery, any_id
        self._monitor: Optional[battery.BatteryMonitor] = None
        self._new_readings, self._new_echoes = sonar.NewReadings(), sonar.NewReadings(ECHO_INPUTS, 0.0)
        self._repeated = sonar.RepeatedReadings()
        self._late: Tuple[str, ...] = ()  # sonars with readings that came in frames of their own

    @property
    def has_sonars(self) -> bool:
        """The board measures ranges.  2013 boards do not report it; for them the model and the robot id decide."""
        model, info = self.model, self.info
        if model is None or info is None or not model.sonars:
            return False
        if info.capabilities:
            return "sonars" in info.capabilities
        return not models.has_environment(model, info.robot_id)

    @property
    def has_ranges(self) -> bool:
        """The board has HC-SR04 that this robot has too."""
        if self.model is None or self.info is None or "wiring" not in self.info.capabilities:
            return False
        return any(mount.input in ECHO_INPUTS for mount in self.model.sonars.values())

    @property
    def build_warning(self) -> str:
        """A warning if the board has another build than its model names or its id implies; empty if it has that."""
        model, board = self.model, self.info
        if model is None or board is None:
            return ""
        if board.version < 2:
            if not models.has_environment(model, board.robot_id) or board.capabilities:
                return ""
            return (
                "the board does not send its environment sensors, as none with firmware of January 2013 does: there "
                "are no sensor values and no ranges"
            )
        names = {"sonars": models.SONAR, "environment": models.ENVIRONMENT}
        there = next((build for name, build in names.items() if name in board.capabilities), "")
        if not model.build or not there or there == model.build:
            return ""
        lost = "its ranges are not used" if there == models.SONAR else "there are no ranges"
        return (
            f"the board has the build {there}, expected {model.build}, which the robot model or the parameter build "
            f"names: {lost}; change the name, or flash with: mrl flash --build {model.build} --port PORT"
        )

    @property
    def imu_state(self) -> str:
        """The state of the board's IMU, one of `imu.STATES`."""
        return imu.state_of(self.tracker, self.info.capabilities if self.info else frozenset())

    def admit(self, board: Board) -> Optional[str]:
        """Accept the board, choose its model if none was given, return the table row of its stream; None for the usual.

        A board may be asked for its identity more than once before it is ready; the last answer counts.  ConfigError if
        it cannot move the base of this model, WrongRobot if another robot answers, BatteryDead if the battery is too
        low to start, which is not checked again after the start.
        """
        if self._robot_id not in (None, board.robot_id) and not self._any_id:
            raise WrongRobot(
                f"robot id {board.robot_id} answers, expected {self._robot_id}: another board is on this port; "
                "find the robot with: mrl ports --probe"
            )
        if self._auto and self.info is None:
            self.model = models.with_build(model_of(board), self._build)
        assert self.model is not None
        if board.robot_id not in self.model.ids and not self._any_id:
            raise _wrong(board, self.model)
        if self.info is not None and board.robot_id != self.info.robot_id and not self._any_id:
            raise WrongRobot(
                f"robot id {board.robot_id} answers, expected {self.info.robot_id}, the robot of before: "
                "connect that one, or start again"
            )
        self._require_kind(board)
        if not self.model.drives:
            return SENSOR_STREAM
        if self.odometry is None and not self._ignore_battery and not _may_lack_battery(board):
            battery.require_charge(board.battery_v, self.model.battery)
        require_supported(self.model)
        bridged = "bridge" in board.capabilities
        answers = bridged or (board.motor_board_version > 0 and board.capabilities)
        if answers and bridged != bool(self.model.board.get("bridge")) and not self._any_id:
            motors = "an OMNI-3MD", "H-bridges"
            raise WrongRobot(
                f"the firmware of the board drives {motors[bridged]}, expected {motors[not bridged]} for "
                f"{self.model.name}: flash it with: mrl flash --port PORT, or set the board's id with: mrl set-id"
            )
        stream = STREAMS.get(len(kinematics_of(self.model.base).wheels))
        if not stream and board.version < 2 and models.has_environment(self.model, board.robot_id):
            return SENSOR_STREAM
        return stream

    def _require_kind(self, board: Board) -> None:
        """Raise WrongRobot if the robot is virtual and a real one is expected, or real and a virtual one is.

        A model says whose it is, see `models.is_virtual`; no option lets that of a virtual robot drive a real one.
        """
        if board.version >= 2 and not board.capabilities:
            return  # the board was not asked yet
        of_model = models.is_virtual(self.model) if self.model is not None and self.model_tells else None
        told = self._virtual, self.info.virtual if self.info is not None else None, of_model
        require_kind(board.virtual, next((each for each in told if each is not None), None))
        if of_model:
            require_kind(board.virtual, True)

    def digest(self, event: SessionEvent, now: float) -> List[RobotEvent]:
        """Process an event; return the events for the listeners."""
        if isinstance(event, Counts):
            events: List[RobotEvent] = []
            telemetry = self.on_counts(event, events)
            return [*events, telemetry] if telemetry else []
        if isinstance(event, ImuReading):
            return self.on_imu(event)
        if isinstance(event, Sonars):
            if self.info is not None:  # otherwise the model is not known yet
                self._late += self._on_new(self._new_readings.update(event.values, now), event.values)
            return []
        if isinstance(event, Ranges):
            if self.info is not None:
                self._late += self._on_new(
                    self._new_echoes.update(event.values, now), event.values, ECHO_INPUTS
                )
            return []
        if isinstance(event, Info):
            return self._on_info(event.board, now)
        if isinstance(event, Ready):
            event = event._replace(board=self._used(event.board))
            changed = self._on_ready(event)
            return [event, changed] if changed else [event]
        if isinstance(event, Status):
            return [self.told(event)]
        return [] if isinstance(event, OwnStop) else [event]  # the core reports what follows

    def _used(self, board: Board) -> Board:
        """Return what of a board is used: without odometry not its IMU, whose heading would need it."""
        if self.model is None or self.model.has_odometry:
            return board
        board = board._replace(capabilities=board.capabilities - {"imu"})
        return board if self.model.drives else without_motor_board(board)

    def told(self, status: Status) -> Status:
        """Return a status as it applies to this robot: a board without motors needs no motor board."""
        if self.model is None or self.model.drives:
            return status
        return status._replace(faults=tuple(name for name in status.faults if name != "motor_board"))

    def _on_ready(self, event: Ready) -> Optional[ImuChanged]:
        assert self.model is not None
        self.info = event.board
        if not self.has_sonars:
            self.model, self.ranges = self.model._replace(sonars={}), {}
        if not self.model.drives:
            return None
        self._new_echoes = sonar.NewReadings(ECHO_INPUTS, SURELY_NEW * models.echo_cycle_s(self.model.board))
        if self.odometry is None:
            self.odometry = odometry_of(self.model, event.checked)
            self._monitor = battery.BatteryMonitor(self.model.battery)
        elif event.restarted:
            self.odometry.reset()
        self.odometry.baseline.coast_s = event.coast_s
        return self._begin_imu(event, self.odometry)

    def _begin_imu(self, event: Ready, odometry: Odometry) -> Optional[ImuChanged]:
        """Let gyro and wheels give the heading if the board's IMU is read, else the wheels alone."""
        assert self.model is not None
        tracker = self.tracker
        if tracker is None and event.imu:
            tracker = self.tracker = ImuTracker(self.model)
        odometry.heading = tracker.heading if tracker is not None and event.imu else None
        if tracker is None:
            return None
        if event.restarted:
            tracker.reset()
        return None if event.imu else tracker.end()

    def on_imu(self, event: ImuReading) -> List[RobotEvent]:
        """Process one reading of the IMU; return the events for the listeners."""
        tracker, odometry = self.tracker, self.odometry
        if tracker is None or odometry is None:
            return []
        found = tracker.update(event, self._counted_s, odometry)
        return [found] if tracker.changed is None else [tracker.changed, found]

    def on_counts(self, event: Counts, events: List[Any]) -> Optional[Telemetry]:
        """Process one frame of the stream; add what has happened besides to `events`.

        Return the telemetry, or None before the first greeting and from boards without motors: their counters are not
        odometry.
        """
        odometry, self.settled = self.odometry, self.info is not None
        if odometry is None:
            return None
        right, left, sonars, time_s, stamp_s, arrival_s, sequence, others = event
        used, tracker = False, self.tracker
        changed = tracker.check(time_s) if tracker is not None else None
        if len(others) + 2 == len(odometry.travel):
            used = odometry.update(right, left, time_s, *others)
        if used:
            self._used_s, self._counted_s = arrival_s, time_s
        elif odometry.baseline.primed != self._primed:
            self._begin_baseline(odometry, arrival_s, events)
        if changed is not None:
            events.append(changed)
        if sonars and self.info is not None and self.info.version < 2:
            sonars = self._repeated.update(sonars)
        fresh, self._late = self._late, ()
        if sonars and (sonars != self._new_readings.values or arrival_s >= self._new_readings.due_s):
            fresh += self._on_new(self._new_readings.update(sonars, arrival_s), sonars)
        pose, twist, travel = odometry.pose, odometry.twist, odometry.travel
        uncertainty, heading = odometry.uncertainty, odometry.heading
        assert uncertainty is not None
        gyro = heading is not None and heading.in_use
        fields = stamp_s, arrival_s, pose, twist, self.ranges, fresh, travel, sequence, gyro
        telemetry = tuple.__new__(Telemetry, (*fields, uncertainty.spread, uncertainty.variances))
        self.telemetry = telemetry  # made without a call in Python
        return telemetry

    def _begin_baseline(self, odometry: Odometry, now: float, events: List[Any]) -> None:
        """A new baseline begins here; the movement since the last reading is unknown."""
        assert self.model is not None
        if self._primed:
            gap_s, limits = now - self._used_s, self.model.limits
            moving_s = min(gap_s, odometry.baseline.coast_s)
            turn_rad = min(math.pi, limits.angular_rad_s * moving_s)
            unknown = PathUnknown(gap_s, limits.linear_m_s * moving_s, turn_rad)
            events.append(unknown)
            if odometry.uncertainty is not None:
                odometry.uncertainty.widen(unknown.distance_m, unknown.turn_rad)
        self._primed, self._used_s = odometry.baseline.primed, now

    def _on_new(
        self, new: Tuple[str, ...], values: Tuple[int, ...], inputs: Tuple[str, ...] = sonar.NAMES
    ) -> Tuple[str, ...]:
        """Process values of the inputs, of which those in `new` are new; return the names of their sonars."""
        assert self.model is not None
        names = {mount.input_of(name): name for name, mount in self.model.sonars.items()}
        fresh = tuple(names[each] for each in new if each in names)
        if fresh:
            read = {names[each]: value for each, value in zip(inputs, values) if each in names}
            self.ranges = {**self.ranges, **{name: self._metres(name, read[name]) for name in read}}
        return fresh

    def _metres(self, name: str, value: int) -> float:
        """Return the range of a sonar [m] for its value of the wire."""
        assert self.model is not None
        mount = self.model.sonars[name]
        if mount.input in ECHO_INPUTS:
            return sonar.input_range_m(value, mount.kind)
        return sonar.range_m(value, self.info.version if self.info else 2)

    def _on_info(self, board: Board, now: float) -> List[RobotEvent]:
        if self.info is None or self._monitor is None:
            return []
        board = with_measured(board, self.info.capabilities)
        if _lacks_motor_board(board, self.info.capabilities):
            board = board._replace(battery_v=math.nan, temperature_c=math.nan)
        self.info = self.info._replace(battery_v=board.battery_v, temperature_c=board.temperature_c)
        self.battery_state = self._monitor.update(board.battery_v, now)
        self.powerless = not self._ignore_battery and self.battery_state in (battery.EMPTY, battery.OFF)
        return [self.info]


def without_motor_board(board: Board) -> Board:
    """Return the board with NaN in place of each value that a motor board measures."""
    return board._replace(motor_board_version=math.nan, battery_v=math.nan, temperature_c=math.nan)


def _lacks_motor_board(board: Board, capabilities: FrozenSet[str]) -> bool:
    """Return whether the motor board, which measures the battery, does not answer: its values are 0, with its version.

    An H-bridge board has no motor board and measures by itself; one of 2013 reports no capabilities.
    """
    return bool(capabilities) and "bridge" not in capabilities and board.motor_board_version == 0.0


def _may_lack_battery(board: Board) -> bool:
    """Return whether 0 V may mean that the board does not measure its battery: it has not reported its capabilities."""
    return board.version >= 2 and board.protocol < 2 and board.battery_v == 0.0


def odometry_of(model: RobotModel, exact_time: bool) -> Odometry:
    """Return the odometry for a robot of this model; `exact_time` says that the times come from the board."""
    if not model.has_odometry:
        return NoOdometry(model)
    if len(kinematics_of(model.base).wheels) in STREAMS:
        made: Odometry = WheelOdometry(model.base, fastest_m_s(model), exact_time)
        made.uncertainty = WheelUncertainty(model, exact_time=exact_time)
    else:
        made = Odometry(model.base, fastest_m_s(model), exact_time)
        made.uncertainty = Uncertainty(model, exact_time=exact_time)
    return made


def assumes_sonars(model: RobotModel, board: Board) -> bool:
    """Return whether a 2013 board is taken to have sonars, because neither model nor `Options.build` names its build.

    `model` is that of a connected driver.
    """
    return bool(model.sonars) and board.version < 2 and not model.build


def require_kind(virtual: bool, expected: Optional[bool]) -> None:
    """Raise WrongRobot unless a robot is as virtual as expected; None expects any."""
    if expected is None or virtual == expected:
        return
    kinds = "a virtual one", "a real one"
    got, wanted = kinds if virtual else kinds[::-1]
    raise WrongRobot(
        f"the robot on this port is {got}, expected {wanted}: connect the other board, or give this one a "
        "name with: mrl names add NAME --port PORT"
    )


def model_of(board: Board) -> RobotModel:
    """Return the model that lists the board's id; raise WrongRobot if no model lists it."""
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
    return fastest_wheel_m_s(*ceilings, model.base.wheel_separation_m)


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
