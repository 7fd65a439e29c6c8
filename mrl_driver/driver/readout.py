"""The readable side of a driver: its properties and its callbacks."""

import math
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Tuple, Union

from mrl_driver.errors import BoardTimeout, MrlError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.odometry import AnyTwist, OmniTwist, Twist
from mrl_driver.robot.robot_state import Notice, RobotState, Telemetry
from mrl_driver.robot.wheel_monitor import Mismatch
from mrl_driver.session.handshake import Board
from mrl_driver.session.link_counters import Statistics
from mrl_driver.session.motion_command import Motion
from mrl_driver.session.sensor_polling import Reading
from mrl_driver.session.session import SessionEvent, Status

from .robot_core import Core

Listener = Callable[[Any], None]


class Readout:
    """The part of a driver that may be read at any time, from any thread."""

    def __init__(self, core: Core) -> None:
        self._lock = threading.RLock()
        self._core = core
        self._error: Optional[MrlError] = None
        self._listeners: Dict[str, List[Listener]] = {
            "telemetry": [],
            "status": [],
            "battery": [],
            "state": [],
            "sensor": [],
        }

    @property
    def _state(self) -> RobotState:
        return self._core.state

    @property
    def _motion(self) -> Optional[Motion]:
        return self._core.session.motion if self._core.begun else None

    @property
    def now_s(self) -> float:
        """The driver's clock: `time.monotonic()`, or simulated time."""
        return time.monotonic()

    @property
    def model(self) -> Optional[RobotModel]:
        """The robot's model; None until `connect` if the driver was created with `auto`."""
        return self._state.model

    @property
    def ready(self) -> bool:
        """The board is greeted, and its telemetry is not stale."""
        return self._core.begun and self._core.session.ready and self._error is None

    @property
    def stopped(self) -> bool:
        """No command is in force, and telemetry has confirmed the last stop."""
        with self._lock:
            motion = self._motion
            return motion is None or not (motion.target or motion.stopping or self.may_be_moving)

    @property
    def may_be_moving(self) -> bool:
        """The board was cut off while the robot moved, and it has no watchdog to stop it (2013 boards)."""
        return self._core.begun and self._core.session.may_be_moving

    @property
    def stop_reason(self) -> str:
        """Why the robot was last stopped, as far as is known; `none` before the first stop.

        Reasons of this program (`motion_command.STOPS`): `user`, `not_a_number`, `command_timeout`, `battery`,
        `wheel_mismatch`, `stale` (no telemetry), `restarted` (the board restarted), `link_lost`, `host_paused` (this
        program stood still), `closed`.  Reasons of the board (`table.STOP_REASONS`): `link_watchdog`, `stall`,
        `motor_board`, `boot`, `check_ended`; these are known within half a second.
        """
        motion = self._motion
        return motion.stop_reason if motion else "none"

    @property
    def mismatch(self) -> Optional[Mismatch]:
        """The wheel that did not follow its command, or None.  Only `stop` or a command of zero clears it; until then
        all other commands are refused.
        """
        return self._core.mismatch

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
        """The speeds that `drive` would use: scaled down to the limits, on the same arc.  Needs a connection."""
        return self._core.limited(linear_m_s, angular_rad_s, lateral_m_s)

    @property
    def error(self) -> Optional[MrlError]:
        """The error that ended the driver, or None."""
        return self._error

    @property
    def board(self) -> Board:
        """The board's identity; its battery voltage and temperature are at most 2 s old.

        Raises:
            BoardTimeout: not connected yet.
        """
        if self._state.info is None:
            raise BoardTimeout("not connected; call connect() first")
        return self._state.info

    @property
    def warning(self) -> str:
        """A warning for the user about this board; empty if there is none."""
        info = self._state.info
        if info is None or info.protocol >= 2:
            return ""
        name = "1 (2013)" if info.version < 2 else f"{info.version} without protocol"
        return (
            f"board firmware {name} has no watchdog: the robot drives on when the program dies or the cable is "
            "pulled; flash with: mrl flash --port PORT"
        )

    @property
    def telemetry(self) -> Optional[Telemetry]:
        """The last telemetry; None before the first."""
        return self._state.telemetry

    @property
    def pose(self) -> Pose:
        """Pose in the odom frame; (0, 0, 0) at the start.  It has no jump when the board restarts."""
        return self._state.odometry.pose if self._state.odometry else ORIGIN

    @property
    def twist(self) -> AnyTwist:
        """Measured speeds in base_link; zero while the board is not ready."""
        return self._state.odometry.twist if self._state.odometry and self.ready else Twist(0.0, 0.0)

    @property
    def has_sonars(self) -> bool:
        """The board measures ranges; False before `connect`."""
        return self._state.has_sonars

    @property
    def ranges(self) -> Dict[str, float]:
        """Range of each sonar by name [m], by REP 117; empty if telemetry is stale."""
        return dict(self._state.ranges) if self.ready else {}

    @property
    def sensors(self) -> Dict[str, Reading]:
        """Readings of the sensors of `table.SENSORS` that answer, by name, without old readings."""
        with self._lock:
            return self._core.session.sensors.fresh(self.now_s) if self._core.begun and self.ready else {}

    @property
    def battery_v(self) -> float:
        """Battery voltage, at most 2 s old; NaN before it is known."""
        return self._state.info.battery_v if self._state.info else math.nan

    @property
    def battery_state(self) -> str:
        """`ok`, `low`, `empty` or `off`, see `robot.battery`."""
        return self._state.battery_state

    @property
    def temperature_c(self) -> float:
        """Temperature of the motor board; NaN before it is known."""
        return self._state.info.temperature_c if self._state.info else math.nan

    @property
    def status(self) -> Optional[Status]:
        """Uptime, stop reason, faults and clamped commands; None with 2013 boards."""
        return self._core.session.status if self._core.begun else None

    @property
    def age_s(self) -> float:
        """Time since the last telemetry arrived; infinity before the first."""
        return self.now_s - self._core.session.heard_s if self._core.begun else math.inf

    @property
    def statistics(self) -> Statistics:
        """Counters of the link.

        Raises:
            BoardTimeout: not connected yet.
        """
        with self._lock:
            if not self._core.begun:
                raise BoardTimeout("not connected; call connect() first")
            counters = self._core.session.counters
            counters.refused_counts = self._state.odometry.baseline.refused if self._state.odometry else 0
            return counters.snapshot()

    def reset_pose(self, pose: Pose = ORIGIN) -> None:
        """Continue the odometry from `pose`; counters and speeds do not change."""
        with self._lock:
            if self._state.odometry is not None:
                self._state.odometry.pose = pose

    # -- callbacks: they run on the reading thread, one after the other, without a lock

    def on_telemetry(self, callback: Callable[[Telemetry], None]) -> None:
        """Call `callback` for each telemetry frame."""
        self._listeners["telemetry"].append(callback)

    def on_status(self, callback: Callable[[Status], None]) -> None:
        """Call `callback` for each status of the board, twice a second."""
        self._listeners["status"].append(callback)

    def on_battery(self, callback: Callable[[Board], None]) -> None:
        """Call `callback` for each new battery voltage and temperature."""
        self._listeners["battery"].append(callback)

    def on_sensor(self, callback: Callable[[Tuple[str, Reading]], None]) -> None:
        """Call `callback` with name and reading for each answer of a sensor of `table.SENSORS`."""
        self._listeners["sensor"].append(callback)

    def on_event(self, callback: Callable[[Union[SessionEvent, Mismatch, MrlError]], None]) -> None:
        """Call `callback` for each `Ready`, `Stale`, `Lost`, `Reconnected`, `Slowed`, `WayLost` and `Reply` of
        `session.events`, for a wheel's `Mismatch`, and for the `MrlError` that ends the driver.
        """
        self._listeners["state"].append(callback)

    def _call(self, notices: List[Notice]) -> None:
        for kind, value in notices:
            for listener in self._listeners[kind]:
                listener(value)
