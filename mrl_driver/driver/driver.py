"""The robot as an object: SI units in and out, one reading thread, no output to the terminal.

    with Driver("/dev/ttyACM0") as robot:
        for _ in range(20):
            robot.drive(0.2, 0.0)
            robot.wait(0.1)
        print(robot.pose)

The robot stops 0.5 s after the last `drive`; `Options(command_timeout_s=...)` changes that time.  The robot also stops
at the end of the `with` block, at the end of the program, and when the program has lost its `Driver`: a driver that
nothing refers to is closed, with a ResourceWarning.  All methods may be called from any thread.  Callbacks run
on the reading thread and must not call `ask` or `wait`.  `lock_order` has the threads and the order of the locks.
"""

import warnings
from typing import Any, Callable, Dict, Optional, Tuple, Type, TypeVar, Union, cast

from mrl_driver.arguments import require_function, require_kind, require_numbers, require_text, shown
from mrl_driver.errors import BoardTimeout, ConfigError, MrlError
from mrl_driver.geometry import FARTHEST_M, ORIGIN, Pose, wrap_angle
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BAUD
from mrl_driver.robot import models
from mrl_driver.robot.covariance import AT_START, LARGEST_VARIANCE, Spread, is_covariance
from mrl_driver.robot.imu import Imu
from mrl_driver.robot.inputs import CAPABILITY as INPUTS
from mrl_driver.robot.inputs import RELEASE, Inputs
from mrl_driver.robot.models import Limits, RobotModel
from mrl_driver.robot.odometry import AnyTwist, OmniTwist, Twist
from mrl_driver.robot.robot_state import Telemetry
from mrl_driver.safety.speed_limiter import Speeds
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import MAY_MOVE, SensorRead, Status
from mrl_driver.session.handshake import Board
from mrl_driver.session.motion_command import Motion
from mrl_driver.session.sensor_polling import Reading
from mrl_driver.transport.address import require_port
from mrl_driver.transport.baud_rates import require_raisable
from mrl_driver.transport.link import Link

from .connection import ANSWER_S, Connection
from .driver_recorder import DriverRecorder
from .link_source import LinkSource
from .link_status import LinkStatus
from .options import DEFAULTS, RANGES, Options, require_limits, require_options, require_range
from .parameters import Parameters
from .radio import Radio
from .robot_core import Core, DriverEvent
from .servos import Servos

AnyDriver = TypeVar("AnyDriver", bound="Driver")
Heard = TypeVar("Heard", Board, Imu, SensorRead, Status)


def _require_spread(spread: Any) -> Spread:
    """Return a covariance of the pose; raise ConfigError if it is none."""
    parts = ("xx", "xy", "x-yaw", "yy", "y-yaw", "yaw-yaw")
    numbers = cast(Spread, require_numbers("covariance", spread, parts))
    if not is_covariance(numbers):
        raise ConfigError(
            f"the covariance of the pose is {numbers}, expected {' '.join(parts)} with variances from "
            f"0 to {LARGEST_VARIANCE:g} and covariances that fit them; the odometry continues as before"
        )
    return numbers


class Driver:
    """A robot on a serial port.

    Args:
        port: device name, URL (`tcp://host:port`, `udp://host:port`, or a pyserial URL), or an open `Link`.
        robot: name of a packaged model, path of a YAML file, a `RobotModel`, or `auto`: the model that lists
            the robot id reported by the board.
        baud: baud rate of the serial port [Bd]; with a network address, baud rate of the serial link behind it.
            Below 115200 the board streams only as fast as the line allows.
        options: see `Options`.

    Attributes:
        link: speed, delays and counters of the link to the board.
        radio: the board's XBee radio.
        recorder: recordings of this driver.
        parameters: the board's parameters, and its EEPROM.
        servos: servos on the board's pins.

    Raises:
        ConfigError: the robot model is unknown or invalid, or an option is out of range.  Raised before the
            port is opened.
    """

    _core_kind: Type[Core] = Core
    _connection_kind: Type[Connection] = Connection

    def __init__(
        self,
        port: Union[str, Link],
        robot: Union[str, RobotModel] = "auto",
        baud: int = BAUD,
        options: Options = DEFAULTS,
    ) -> None:
        baud, options = require_range("baud", baud, *RANGES["line_baud"]), require_options(options)
        if isinstance(port, str):
            require_port(port)
        elif not hasattr(port, "read"):
            raise ConfigError(f"port is {shown(port)}, expected a name, or an open Link")
        elif options.record is not None:
            raise ConfigError("record is given with an open link, expected a port by name")
        if options.fast:
            require_raisable(port, baud)
        require_kind("robot", robot, (str, RobotModel), "a name, the path of a file, or a RobotModel")
        options = options._replace(line_baud=min(baud, options.line_baud))
        model = robot if isinstance(robot, RobotModel) else None if robot == "auto" else models.load(robot)
        self._core = self._core_kind(model, options)
        self._connection = self._connection_kind(
            self._core, LinkSource(port, baud, options), options.line_baud, options.identify
        )
        self.link = LinkStatus(self._connection, baud)
        self.radio = Radio(self._connection)
        self.recorder = DriverRecorder(self._connection)
        self.parameters = Parameters(self._connection)
        self.servos = Servos(self._connection)

    # -- the connection

    def connect(self) -> Board:
        """Open the port, greet the board and start its stream.  The robot gets a stop and stays still.

        Returns:
            The board's identity, after the first frame of its stream has arrived.

        Raises:
            ConfigError: the recording cannot be written.
            PortMissing, PortDenied, PortBusy, LinkError: the port cannot be opened.
            NotARobot: nothing answers, or the answer is not made of frames.
            WrongRobot: another robot answers, or the board speaks another protocol.
            BatteryDead: motor power is off, or the battery is too low to start (unless `ignore_battery`).
            BoardTimeout, LinkLost: the board stopped answering, or the port went away, during the greeting.
            LinkLost: the driver was closed while it connected.
        """
        self._connection.connect()
        return self.board

    def close(self) -> None:
        """Stop the robot, wait at most a second for telemetry to confirm the stop, and close the port.

        Signal handlers may call it as well.
        """
        self._connection.close()

    def __enter__(self: AnyDriver) -> AnyDriver:
        self.connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        connection = getattr(self, "_connection", None)  # an argument may have been refused before
        if connection is not None and connection.thread is not None and not connection.closing:
            connection.close_aside()
            lost = f"a driver was lost before it was closed: {self!r}"
            warnings.warn(lost, ResourceWarning, stacklevel=2, source=self)

    def wait(self, timeout_s: Optional[float] = None) -> bool:
        """Sleep until the driver is closed or has failed; False if `timeout_s` ended first.

        Raises:
            ConfigError: `timeout_s` is not a number, or NaN.
            MrlError: the driver failed; this is the error, such as LinkLost.  Or it was called on the reading thread
                without `timeout_s`.
        """
        return self._connection.wait(timeout_s)

    # -- commands

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> bool:
        """Drive at these speeds for at most 0.5 s; call again before then to keep driving.

        The option `command_timeout_s` sets another time.  **With `command_timeout_s=None` the robot keeps driving while
        the program hangs.**  Speeds above the model's limits are scaled down together, so the arc stays the same.  The
        latest command wins; commands are never queued.  If the board falls silent or restarts, the command is dropped
        and the robot waits for a new one.

        Args:
            linear_m_s: forward speed.
            angular_rad_s: yaw rate, counter-clockwise.
            lateral_m_s: speed to the left, if the base can move sideways.

        Returns:
            True if the port has accepted the command, or does so as soon as the pace of commands allows (5 ms, with
            boards of 2013 0.15 s).  False if the board is silent or being greeted, the port is lost, the battery is
            empty, a wheel does not follow its command (see `mismatch`), another robot holds this one (see
            `radio.hold`), commands are inhibited, the program has just gone on after a pause (with the option
            `queued_s`), or the driver is being closed.  Also False if telemetry is older than 0.1 s, or the port
            accepts no data for 0.1 s: then the command may still be in force (see `command`) and is sent as soon as
            possible.

        Raises:
            FrameError: a speed is not a finite number, or the base cannot move sideways; the robot was stopped.
            ConfigError: the board has no motors, or the function of `restrict` has not returned finite speeds.
            LinkLost: the port went away.
        """
        core = self._core
        if self._connection.error is not None or self._connection.closing or not core.begun:
            self._connection.refuse()
        try:
            with self._connection.lock:
                taken = core.drive(linear_m_s, angular_rad_s, self._connection.clock(), lateral_m_s)
                if self._connection.writer is not None and not self._connection.may_write():
                    self._connection.await_writer(self._connection.may_write)
        finally:
            accepted = self._connection.flush()
        return taken and accepted

    def stop(self) -> None:
        """Stop at once; the stop is repeated until telemetry confirms it.

        If another thread's write is blocked, the stop is sent as soon as the port accepts bytes again.

        Raises:
            BoardTimeout: the link was lost while the robot moved, and its board has no watchdog: it may drive on.  The
                stop is repeated when the board is back.
            LinkLost: the port went away.
        """
        core = self._connection.connected()
        with self._connection.lock:
            core.stop(self._connection.clock(), StopReason.USER)
        self._connection.flush()
        if self.may_be_moving:
            raise BoardTimeout(f"no telemetry arrives: {MAY_MOVE}")

    def inhibit(self, reason: str) -> None:
        """Stop, and refuse commands and requests that turn motors until `allow` is called with each reason; none
        overtakes this.

        Raises:
            BoardTimeout, LinkLost: as `stop`; commands are refused nevertheless.
            ConfigError: the reason is not a text; the robot was stopped.
        """
        with self._connection.stop_if_refused():
            require_text("reason", reason)
        with self._connection.lock:
            self._core.inhibited.add(reason)
        self.stop()

    def allow(self, reason: str) -> None:
        """End an `inhibit` with this reason; the robot waits for a new command.

        Raises:
            ConfigError: the reason is not a text.
        """
        with self._connection.stop_if_refused():
            require_text("reason", reason)
        with self._connection.lock:
            self._core.inhibited.discard(reason)

    def restrict(self, allowed: Optional[Callable[[Speeds, float], Speeds]]) -> None:
        """Let `allowed(speeds, now)` reduce every command, and again with every frame; such as protective zones.

        Speeds are linear, angular and, if the base can, lateral [m/s, rad/s, m/s]; `now` is `now_s`.  The function is
        called with the driver's lock held: it must be quick and must not call the driver.  `limits` hold for what
        it returns; if that is not finite speeds, the robot stops.  None ends the restriction.

        Raises:
            ConfigError: `allowed` is not a function; the robot was stopped.
        """
        if allowed is not None:
            with self._connection.stop_if_refused():
                require_function("allowed", allowed)
        with self._connection.lock:
            self._core.limiter.restrict = allowed
            self._core.on_new_limits(self._connection.clock())

    def limit_again(self) -> None:
        """Apply `limits` and `restrict` to the command in force now, instead of with the next frame.

        Raises:
            LinkLost: the port went away.
        """
        core = self._connection.connected()
        with self._connection.lock:
            core.limit_again(self._connection.clock())
        self._connection.flush()

    def request(self, code: int, *args: int) -> None:
        """Send any other request of the command table; `on_event` gets the reply.  The request of a stop is `stop()`.

        What a request turns is stopped 3 s after the last such request, at the latest.  Boards without a watchdog
        (2013) go on.  The board would not keep lower `limits` than the model's, nor what `restrict` allows: while one
        of them is in force, a request that would turn motors is refused, and what one turns already is stopped.

        The requests 4 and 14 set the board's counters: the pose may jump by some cm, or is less sure.  After 3 it is
        wrong until the next greeting.  `reset_pose` needs none of them.

        Raises:
            FrameError: the command table does not allow the request; the robot was stopped.
            BoardTimeout: the request would turn motors, and the board is silent; it was not sent.
            LinkLost: the port went away.
            ConfigError: the request would turn motors, and the board has none.
            MrlError: the request would turn motors, and commands are limited or inhibited, the driver is being closed,
                or a stop came while the request waited for the line; it was not sent.
        """
        self._connection.request(code, *args)

    def ask(self, code: int, *args: int, timeout_s: float = ANSWER_S) -> Tuple[int, ...]:
        """Send a request, wait for its `Reply` and return the reply's fields; repeat the request if no reply comes.

        Do not use it for `robot_info`, `read_status`, the wheel counters and the IMU, which arrive without a request,
        nor on the reading thread.

        Raises:
            FrameError: the command table does not allow the request; the robot was stopped.
            ConfigError: `timeout_s` is not a number, or NaN.
            BoardTimeout: no reply within `timeout_s`, in each of three attempts.
            LinkLost: the port went away.
            MrlError: it was called on the reading thread.
        """
        return self._connection.ask(code, *args, timeout_s=timeout_s)

    # -- what may be read at any time, from any thread

    @property
    def _motion(self) -> Optional[Motion]:
        return self._core.session.motion if self._core.begun else None

    @property
    def now_s(self) -> float:
        """The driver's clock: `time.monotonic()`, or simulated time."""
        return self._connection.clock()

    @property
    def model(self) -> Optional[RobotModel]:
        """The robot's model; None until `connect` if the driver was created with `auto`.

        After `connect` it has no sonars if the board measures no ranges.
        """
        return self._core.state.model

    @property
    def limits(self) -> Optional[Limits]:
        """Limits of speed and acceleration in force; None until `connect` if the driver was created with `auto`.

        At first those of the model, but without a limit of acceleration unless the model limits braking: the board has
        its own ramp.  They may be replaced at any time, and hold from the next command or frame on.  A command in force
        is only lowered; after an increase, the next command may be faster.

        Raises:
            ConfigError: on setting, a speed is not positive or does not fit into a frame, or an acceleration is not
                positive; the robot was stopped.
        """
        return self._core.limiter.limits or (self.model.limits if self.model else None)

    @limits.setter
    def limits(self, limits: Limits) -> None:
        with self._connection.stop_if_refused():
            limits = require_limits(limits)
        with self._connection.lock:
            self._core.limiter.change(limits)
            self._core.on_new_limits(self._connection.clock())

    @property
    def ready(self) -> bool:
        """The board is greeted, its telemetry is not stale, and the driver is not closed."""
        return self._connection.ready

    @property
    def stopped(self) -> bool:
        """No command is in force, and telemetry has confirmed the last stop."""
        return self._connection.stopped

    @property
    def may_be_moving(self) -> bool:
        """The board was cut off while the robot moved, and it has no watchdog to stop it (2013 boards)."""
        return self._core.begun and self._core.session.may_be_moving

    @property
    def stop_reason(self) -> StopReason:
        """Why the robot was last stopped, as far as is known; `none` before the first stop.

        Reasons of the board are known within half a second.
        """
        motion = self._motion
        return motion.stop_reason if motion else StopReason.NONE

    @property
    def mismatch(self) -> Optional[Mismatch]:
        """The wheel that did not follow its command, or why a board with an H-bridge has stopped the robot for a wheel
        (`wheel_blocked`, `encoder`); or None.  Only `stop` or a command of zero clears it; until then all other
        commands are refused.
        """
        return self._core.mismatch

    @property
    def inputs(self) -> Optional[Inputs]:
        """Bumpers, cliff sensors and emergency stop; None if the board has no such inputs, or has not said so yet.

        The board stops by itself, and refuses moves towards an active input; after an emergency stop, it and the driver
        refuse all until `release_emergency`, also if the board restarts meanwhile.  They are not safety devices: a real
        emergency stop cuts the motors' power.
        """
        return self._core.inputs if self._core.inputs is not None and self._core.inputs.connected else None

    def release_emergency(self) -> bool:
        """Stop, and release the emergency stop of the board's input; False while the input is still active.

        Raises:
            ConfigError: the board has no such inputs.
            BoardTimeout: the board does not answer.
            LinkLost: the port went away.
        """
        if INPUTS not in self.board.capabilities:
            raise ConfigError("the board has no input of an emergency stop, expected one with an H-bridge")
        self.stop()
        return self.ask(RELEASE) == (0,)

    @property
    def command(self) -> Optional[AnyTwist]:
        """The command in force, after limiting; None while stopped."""
        motion = self._motion
        target = motion.target if motion else None
        if target is None:
            return None
        speeds = [speed / 1000 for speed in target]
        return OmniTwist(*speeds) if len(speeds) == 3 else Twist(*speeds)

    def limited(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> AnyTwist:
        """The speeds that `drive` would use: scaled down to the limits, on the same arc.

        Raises:
            BoardTimeout: not connected yet.
            ConfigError: the board has no motors.
        """
        if self._core.state.info is None:
            raise BoardTimeout("not connected; call connect() first")
        with self._connection.stop_if_refused():
            return self._core.limited(linear_m_s, angular_rad_s, lateral_m_s)

    @property
    def error(self) -> Optional[MrlError]:
        """The error that ended the driver, or None."""
        return self._connection.error

    @property
    def board(self) -> Board:
        """The board's identity; its battery voltage and temperature are at most 2 s old.

        Raises:
            BoardTimeout: not connected yet.
        """
        return self._connection.board

    @property
    def warning(self) -> str:
        """A warning for the user about this board; empty if there is none."""
        return "; ".join(filter(None, (self.build_warning, self._firmware_warning)))

    @property
    def build_warning(self) -> str:
        """A part of `warning`: the board has another build than the model or `Options.build` names; or empty."""
        return self._core.state.build_warning

    @property
    def _firmware_warning(self) -> str:
        info, status = self._core.state.info, self.status
        if status is not None and "wiring" in status.faults:
            return "the board refuses to move, because its bridge, pins or wiring are not set; see mrl doctor"
        if info is None or info.protocol >= 2 or not (self.model and self.model.drives):
            return ""
        name = "1 (2013)" if info.version < 2 else f"{info.version} without protocol"
        return (
            f"board firmware {name} has no watchdog: the robot drives on when the program dies or the cable is "
            "pulled; flash with: mrl flash --port PORT"
        )

    @property
    def telemetry(self) -> Optional[Telemetry]:
        """The last telemetry; None before the first, and with a board without motors."""
        return self._core.state.telemetry

    @property
    def pose(self) -> Pose:
        """Pose in the odom frame; (0, 0, 0) at the start, and always with a board without motors; NaN for motors
        without encoders.  The yaw is in (-pi, pi]: for larger turns, sum up its changes.  It has no jump when the board
        restarts, or when the heading changes from gyro and wheels to the wheels alone.
        """
        return self._core.state.odometry.pose if self._core.state.odometry else ORIGIN

    @property
    def twist(self) -> AnyTwist:
        """Measured speeds in base_link; zero while the board is not ready, NaN for motors without encoders."""
        odometry = self._core.state.odometry
        return odometry.twist if odometry and self.ready else Twist(0.0, 0.0)

    @property
    def imu(self) -> Optional[Imu]:
        """The last reading of the board's IMU, however old; None before the first."""
        tracker = self._core.state.tracker
        return tracker.last if tracker is not None else None

    @property
    def imu_state(self) -> str:
        """Whether the gyro gives the heading together with the wheels, or why not; one of `robot.imu.STATES`."""
        return self._core.state.imu_state

    @property
    def ranges(self) -> Dict[str, float]:
        """Range of each sonar by name [m], by REP 117; empty if telemetry is stale."""
        return dict(self._core.state.ranges) if self.ready else {}

    @property
    def sensors(self) -> Dict[str, Reading]:
        """Readings of the sensors of `table.SENSORS` that answer, by name, without old readings."""
        with self._connection.lock:
            return self._core.session.sensors.fresh(self.now_s) if self._core.begun and self.ready else {}

    @property
    def battery_state(self) -> str:
        """`ok`, `low`, `empty` or `off`, see `robot.battery`; `ok` if the board does not measure its battery."""
        return self._core.state.battery_state

    @property
    def status(self) -> Optional[Status]:
        """Uptime, stop reason, faults and clamped commands; None with 2013 boards."""
        status = self._core.session.status if self._core.begun else None
        return self._core.state.told(status) if status is not None else None

    def reset_pose(self, pose: Pose = ORIGIN, spread: Spread = AT_START) -> None:
        """Continue the odometry from `pose`, which has the covariance `spread`; counters and speeds do not change.

        Raises:
            ConfigError: a part of the pose is not finite or beyond 1e8 m, `spread` is not a covariance, or the robot
                has no odometry.
        """
        if self.model is not None:
            self.model.require_odometry()
        with self._connection.stop_if_refused():
            x_m, y_m, yaw_rad = require_numbers("pose", pose, Pose._fields)
            for name, at_m in (("x_m", x_m), ("y_m", y_m)):  # far away, steps would be lost by rounding
                require_range(f"{name} of the pose", at_m, -FARTHEST_M, FARTHEST_M, "m", whole=False)
            spread = _require_spread(spread)
        with self._connection.lock:
            if self._core.state.odometry is not None:
                pose = Pose(x_m, y_m, wrap_angle(yaw_rad))
                self._core.state.odometry.set_pose(pose, spread)
                if self._connection.links.recording is not None:
                    self._connection.links.recording.pose(pose, spread)

    # -- callbacks: they run on the reading thread, one after the other, without a lock

    def on_telemetry(self, callback: Callable[[Telemetry], None]) -> None:
        """Call `callback` for each telemetry frame; boards without motors have none.

        A callback must not block: meanwhile nothing is read, and no command is repeated.
        """
        self._connection.listen(self._connection.listeners[Telemetry], callback)

    def on(self, kind: Type[Heard], callback: Callable[[Heard], None]) -> None:
        """Call `callback` for each event of one kind.

        Args:
            kind: `Imu`, a reading of the board's IMU, also while the gyro is not used (see `Imu.state`); `SensorRead`,
                the answer of a sensor of `table.SENSORS`; `Status`, the board's status, twice a second; or `Board`, a
                new battery voltage and temperature.
            callback: takes the event.

        Raises:
            ConfigError: there are no such events, or `callback` is not a function; the robot was stopped.
        """
        with self._connection.stop_if_refused():
            if not (isinstance(kind, type) and kind in self._connection.listeners):
                names = " or ".join(each.__name__ for each in self._connection.listeners)
                raise ConfigError(f"kind is {shown(kind)}, expected {names}")
        self._connection.listen(self._connection.listeners[kind], callback)

    def on_event(self, callback: Callable[[Union[DriverEvent, MrlError]], None]) -> None:
        """Call `callback` for each `Awaited`, `Ready`, `Stale`, `Lost`, `Reconnected`, `Slowed`, `PathUnknown`,
        `ImuChanged` and `Reply` of `session.events`, for a wheel's `Mismatch`, a changed `Hold`, changed
        `Inputs`, and for the `MrlError` that ends the driver.
        """
        self._connection.listen(self._connection.on_state, callback)
