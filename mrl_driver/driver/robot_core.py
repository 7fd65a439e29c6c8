"""The driver without I/O and without a thread: one robot's session, state and guards.

Bytes and time go in; bytes and notices come out.  `Driver` runs it on a port in real time, `SteppedDriver` on an
emulated board in simulated time.  All times are seconds of one monotonic clock, which the caller reads.
"""

import math
from typing import Dict, List, Optional, Tuple

from mrl_driver.errors import FrameError, LinkLost
from mrl_driver.protocol.table import COMMANDS
from mrl_driver.robot import battery
from mrl_driver.robot.kinematics import cannot_sideways
from mrl_driver.robot.models import OmniDrive, RobotModel, kind_of, require_drivable
from mrl_driver.robot.odometry import AnyTwist, AnyWheels, Twist
from mrl_driver.robot.omni_odometry import OmniCommands
from mrl_driver.robot.robot_state import Notice, RobotState, Telemetry, limit
from mrl_driver.robot.wheel_monitor import Mismatch, WheelWatch, wheel_watch
from mrl_driver.session.handshake import Board, Plan
from mrl_driver.session.motion_command import Motion
from mrl_driver.session.session import Counts, Info, Ready, Reply, Session, SessionEvent
from mrl_driver.transport.baud_rates import command_gap_s, least_period_ms

from .options import Options

GENTLE_S = 3.0
"""Longest duration of a gentle stop [s]."""
SLOWEST_MS = 50
"""Longest stream period [ms], so that the driver notices silence in time.  Listeners that want fewer frames get every
n-th one.
"""

INDEXED = {
    row.code
    for row in COMMANDS
    if row.request and row.reply and row.request[0].name == row.reply[0].name == "index"
}
"""Codes of requests whose reply repeats their index."""


class Core:
    """One robot.  If `model` is None, the packaged model that lists the board's robot id is used."""

    def __init__(self, model: Optional[RobotModel], options: Options) -> None:
        if model is not None:
            require_drivable(model)
        self._options = options
        self._omni: Optional[OmniCommands] = None
        self.state = RobotState(model, options.ignore_battery, options.any_id)
        self.mismatch: Optional[Mismatch] = None
        """The wheel that did not follow its command, or None."""
        self.replies: Dict[int, Tuple[int, ...]] = {}
        """Fields of the last `Reply`, by command code."""
        self.leaving = False
        """The driver is closing: it refuses new commands."""
        self.due_s = -math.inf
        """Latest time of the next `turn` if no bytes arrive before [s]."""
        self._session: Optional[Session] = None
        self._watch: Optional[WheelWatch] = None
        least_ms = least_period_ms(options.line_baud)
        self._every = max(1, math.ceil(options.period_ms / max(SLOWEST_MS, least_ms)))
        self._period_ms = max(least_ms, round(options.period_ms / self._every))
        self._untold = 0
        self._fresh: Tuple[str, ...] = ()

    def begin(self, now: float) -> None:
        """Start to greet the board; `turn` returns the results."""
        options = self._options
        gap_s = command_gap_s(options.line_baud)
        plan = Plan(options.watchdog_ms, self._period_ms, options.check, gap_s)
        self._session = Session(self._admit, now, plan, options.command_timeout_s, options.greeting_s)

    def _admit(self, board: Board) -> Optional[str]:
        """Accept the board, and choose the motion request for the robot's drive type."""
        stream, model, motion = self.state.admit(board), self.state.model, self.session.motion
        if model is not None and isinstance(model.drive, OmniDrive):
            self._omni = OmniCommands(model, model.drive)
            motion.request_of = self._omni.spell
        else:
            self._omni = motion.request_of = None
        return stream

    def answer(self, code: int, args: Tuple[int, ...]) -> Optional[Tuple[int, ...]]:
        """The reply to a request, or None.  A late reply with another index does not count."""
        reply = self.replies.get(code)
        return None if reply is None or (code in INDEXED and reply[0] != args[0]) else reply

    @property
    def begun(self) -> bool:
        """`begin` was called: there is a session."""
        return self._session is not None

    @property
    def session(self) -> Session:
        """The conversation with the board.

        Raises:
            LinkLost: `begin` was not called yet.
        """
        if self._session is None:
            raise LinkLost("the driver is not connected; call connect() first")
        return self._session

    def turn(self, data: bytes, now: float) -> List[Notice]:
        """Process the bytes that arrived, do what is due, and return the notices for the listeners.

        Raises:
            BoardError: the board does not answer properly, or is not the right one.
        """
        session = self.session
        events = session.receive(data, now) if data else []
        due_s = session.deadline(now)
        if now >= due_s - (session.lead_s if data else 0.0):
            events += session.tick(now)
            due_s = session.deadline(now)
        self.due_s = due_s
        notices: List[Notice] = []
        for event in events:
            if type(event) is Counts:
                self._on_counts(event, session, now, notices)
            else:
                notices += self._digest(event, now)
        return notices

    def drive(self, linear_m_s: float, angular_rad_s: float, now: float, lateral_m_s: float = 0.0) -> bool:
        """Put a command in force, see `Driver.drive`.

        Raises:
            FrameError: a speed is NaN or infinite, or the base cannot move sideways; the robot was stopped.
        """
        session, model = self.session, self.state.model
        if not (math.isfinite(linear_m_s) and math.isfinite(angular_rad_s) and math.isfinite(lateral_m_s)):
            self.stop(now, "not_a_number")
            lateral = f", {lateral_m_s}" if lateral_m_s else ""
            raise FrameError(
                f"drive({linear_m_s}, {angular_rad_s}{lateral}): expected finite speeds; the robot was stopped"
            )
        if lateral_m_s and model is not None and self._omni is None:
            self.stop(now, "user")
            raise FrameError(f"{cannot_sideways(lateral_m_s, kind_of(model.drive))}; the robot was stopped")
        moves = bool(linear_m_s or angular_rad_s or lateral_m_s)
        if self.state.powerless and session.motion.target is not None and not moves:
            self.stop(now, "battery")  # at once: the gentle stop ends here
        if model is None or self.leaving or self.state.powerless:
            return False
        if self.mismatch is not None and moves:
            return False
        self.mismatch = None
        twist = self.limited(linear_m_s, angular_rad_s, lateral_m_s)
        linear_mm_s, angular_mrad_s, *lateral_mm_s = (round(speed * 1000) for speed in twist)
        return session.drive(linear_mm_s, angular_mrad_s, now, *lateral_mm_s)

    def limited(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float = 0.0) -> AnyTwist:
        """The speeds after limiting, on the same arc; a base that cannot move sideways ignores the lateral speed."""
        if self._omni is not None:
            return self._omni.limited(linear_m_s, angular_rad_s, lateral_m_s)
        assert self.state.model is not None
        return Twist(*limit(linear_m_s, angular_rad_s, self.state.model))

    def stop(self, now: float, reason: str) -> None:
        """Stop at once; `reason` is one of `motion_command.STOPS`."""
        self.mismatch = self._watch = None
        self.session.stop(now, reason)

    def _digest(self, event: SessionEvent, now: float) -> List[Notice]:
        """Update the robot's state from an event, and stop the robot if its battery is empty or off."""
        notices = self.state.digest(event, now)
        if isinstance(event, Ready):
            self._watch = None  # after a restart the board's time starts at zero again
        elif isinstance(event, Info) and self.state.powerless:
            self._spare_battery(now)
        elif isinstance(event, Reply):
            self.replies[event.frame.code] = event.frame.args
            name = self.session.sensors.name_of(event.frame.code)
            if name:
                notices.append(("sensor", (name, self.session.sensors.readings[name])))
        return notices

    def _on_counts(self, event: Counts, session: Session, now: float, notices: List[Notice]) -> None:
        """Update the robot's state from telemetry, and stop the robot if a wheel does not follow its command."""
        telemetry = self.state.on_counts(event)
        if telemetry is None:
            return
        if self.state.way_lost is not None:
            notices.append(("state", self.state.way_lost))
        if self._every == 1:
            notices.append(("telemetry", telemetry))
        else:
            notices += self._thin(telemetry)
        motion = session.motion
        if motion.target is None:
            self._watch = None
        else:
            self.mismatch = self._check_wheels(motion, telemetry.counts, event.time_s)
            if self.mismatch is not None:
                session.stop(now, "wheel_mismatch")
                self.due_s = now
                notices.append(("state", self.mismatch))

    def _thin(self, telemetry: Telemetry) -> List[Notice]:
        """Every n-th telemetry; its `fresh` includes the sonars that were new in the skipped ones."""
        self._fresh = tuple(dict.fromkeys(self._fresh + telemetry.fresh))
        self._untold = (self._untold + 1) % self._every
        if self._untold:
            return []
        telemetry, self._fresh = telemetry._replace(fresh=self._fresh), ()
        return [("telemetry", telemetry)]

    def _check_wheels(self, motion: Motion, travel: AnyWheels, time_s: float) -> Optional[Mismatch]:
        assert motion.target is not None and self.state.model is not None
        if self._watch is None:
            self._watch = wheel_watch(self.state.model, motion.pace)
        linear_mm_s, angular_mrad_s, *lateral_mm_s = motion.target
        lateral_m_s = lateral_mm_s[0] / 1000 if lateral_mm_s else 0.0
        return self._watch.update(linear_mm_s / 1000, angular_mrad_s / 1000, travel, time_s, lateral_m_s)

    def _spare_battery(self, now: float) -> None:
        """Stop to protect the battery: gently if it is empty; at once if motor power is off, so that the robot does
        not move when power returns.
        """
        motion, model = self.session.motion, self.state.model
        if motion.target is None or model is None:
            return
        if self.state.battery_state == battery.OFF:
            self.session.stop(now, "battery")
            self.due_s = now
        else:
            self.due_s = now
            slowing_s = (
                math.hypot(motion.target[0], *motion.target[2:])
                / 1000
                / model.limits.linear_acceleration_m_s2
            )
            motion.fade(now, min(GENTLE_S, slowing_s))
