"""What a driver tells: its properties and its callbacks, apart from what it does."""

import math
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Tuple, Union

from mrl_driver.errors import BoardTimeout, MrlError
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.odometry import ORIGIN, AnyTwist, OmniTwist, Pose, Twist
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
        """The driver's clock: that of `time.monotonic()`, or simulated time."""
        return time.monotonic()

    @property
    def model(self) -> Optional[RobotModel]:
        """The robot's model; with `auto` it is None until `connect`."""
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
        """Nothing is known of the robot, which moved, and its board does not stop by itself: those of 2013."""
        return self._core.begun and self._core.session.may_be_moving

    @property
    def stop_reason(self) -> str:
        """Why the robot was last stopped, as far as is known.

        By this program, `motion.STOPS`: `user`, `not_a_number`, `command_timeout`, `battery`, `wheel_mismatch`,
        `stale` (no telemetry), `restarted` (the board did), `link_lost`, `closed`.  By the board,
        `table.STOP_REASONS`: `link_watchdog`, `stall`, `motor_board`, `boot`, `check_ended`; those are known within
        half a second.  `none` before the first.
        """
        motion = self._motion
        return motion.stop_reason if motion else "none"

    @property
    def mismatch(self) -> Optional[Mismatch]:
        """The wheel that did not do what it was told; until `stop` or a command of zero no other is taken."""
        return self._core.mismatch

    @property
    def command(self) -> Optional[AnyTwist]:
        """The command in force, after limits; None while stopped."""
        motion = self._motion
        target = motion.target if motion else None
        if target is None:
            return None
        speeds = [speed / 1000 for speed in target]
        return OmniTwist(*speeds) if len(speeds) == 3 else Twist(*speeds)

    def limited(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> AnyTwist:
        """The speeds that `drive` scales these down to, on the same arc, once connected."""
        return self._core.limited(linear_m_s, angular_rad_s, lateral_m_s)

    @property
    def error(self) -> Optional[MrlError]:
        """What ended the driver, or None."""
        return self._error

    @property
    def board(self) -> Board:
        """Who answers; battery and temperature are at most 2 s old.

        Raises:
            BoardTimeout: not connected yet.
        """
        if self._state.info is None:
            raise BoardTimeout("not connected; call connect() first")
        return self._state.info

    @property
    def warning(self) -> str:
        """What a user should know about the board that answers; empty where there is nothing."""
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
        """The last one, or None before the first."""
        return self._state.telemetry

    @property
    def pose(self) -> Pose:
        """Pose in the odom frame, (0, 0, 0) at the start; continuous over restarts of the board."""
        return self._state.odometry.pose if self._state.odometry else ORIGIN

    @property
    def twist(self) -> AnyTwist:
        """Speeds in base_link, measured."""
        return self._state.odometry.twist if self._state.odometry and self.ready else Twist(0.0, 0.0)

    @property
    def has_sonars(self) -> bool:
        """The board measures ranges; False before it is connected."""
        return self._state.has_sonars

    @property
    def ranges(self) -> Dict[str, float]:
        """Sonar name to range [m], REP-117; empty when telemetry is stale."""
        return dict(self._state.ranges) if self.ready else {}

    @property
    def sensors(self) -> Dict[str, Reading]:
        """Sensors of `table.SENSORS` that answer, by name; old readings are left out."""
        with self._lock:
            return self._core.session.sensors.fresh(self.now_s) if self._core.begun and self.ready else {}

    @property
    def battery_v(self) -> float:
        """Battery voltage, at most 2 s old; NaN before it is known."""
        return self._state.info.battery_v if self._state.info else math.nan

    @property
    def battery_state(self) -> str:
        """`ok`, `low`, `empty` or `off`, see `battery`."""
        return self._state.battery_state

    @property
    def temperature_c(self) -> float:
        """Temperature of the motor board; NaN before it is known."""
        return self._state.info.temperature_c if self._state.info else math.nan

    @property
    def status(self) -> Optional[Status]:
        """Uptime, stop reason, faults, clamped commands; None from 2013 boards."""
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
        """Let the odometry go on from `pose`; counts and speeds stay as they are."""
        with self._lock:
            if self._state.odometry is not None:
                self._state.odometry.pose = pose

    # -- callbacks: run on the reading thread, one after the other, without a lock held

    def on_telemetry(self, callback: Callable[[Telemetry], None]) -> None:
        """Call for each frame of the stream."""
        self._listeners["telemetry"].append(callback)

    def on_status(self, callback: Callable[[Status], None]) -> None:
        """Call for each status of the board, twice a second."""
        self._listeners["status"].append(callback)

    def on_battery(self, callback: Callable[[Board], None]) -> None:
        """Call for each new battery voltage and temperature."""
        self._listeners["battery"].append(callback)

    def on_sensor(self, callback: Callable[[Tuple[str, Reading]], None]) -> None:
        """Call for each answer of a sensor of `table.SENSORS`, with its name and reading."""
        self._listeners["sensor"].append(callback)

    def on_event(self, callback: Callable[[Union[SessionEvent, Mismatch, MrlError]], None]) -> None:
        """Call for `Ready`, `Stale`, `Lost`, `Reconnected`, `WayLost` and `Reply` of `events`, for a wheel's
        `Mismatch`, and for the `MrlError` that ends the driver.
        """
        self._listeners["state"].append(callback)

    def _call(self, notices: List[Notice]) -> None:
        for kind, value in notices:
            for listener in self._listeners[kind]:
                listener(value)
