"""The robot of a page, behind ROS topics.  No rospy: `web_node` brings the messages, and sends what this asks for."""

import math
import threading
import time
from typing import Any, Callable, Optional

from mrl_driver.apps.web.helm import Goal, Why
from mrl_driver.apps.web.robot import NO_MOTORS, PageRobot, PhoneReading
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.odometry import OmniTwist, Twist
from mrl_driver.view.shown_state import SILENT_S, Shown, moves_sideways
from mrl_driver.view.words import STOPS, stopped_text
from ros1_bridge.topics.topic_robot import NO_STOP, TopicRobot

from .bag_recording import BagRecording
from .emergency_stop import EmergencyStop

FOLLOWED_S = 0.5
"""A robot that stood for a reason follows a new command within this time, or the reason still holds: `status` shows a
change after 0.2 s at most [s].
"""
STANDS_S = 0.1  # a robot that has stood for this time stands [s]
SILENT = Why(StopReason.NO_TELEMETRY, "no odometry arrives; look whether the robot's node runs")


class _Press:
    """Commands from the first one until a stop: what the robot's node has said of them."""

    def __init__(self, now_s: float) -> None:
        self.begun_s = now_s
        self.followed = False
        self.ended: Optional[Why] = None  # why these commands count no longer; None while they do

    def look(self, robot: TopicRobot, now_s: float) -> Optional[Why]:
        """Return why the robot has stopped by itself since the first command; None if it has not."""
        cause = robot.stop_reason
        if self.ended is not None:
            return self.ended
        if cause in NO_STOP:
            self.followed = True
        elif self.followed or now_s - self.begun_s > FOLLOWED_S:
            self.ended = _why(cause, stopped_text(cause))
        return self.ended


class TopicPageRobot(PageRobot):
    """The page's robot of topics.  Callbacks of ROS and the page's server may call it at the same time.

    `commands` sends the page's commands without blocking: `drive(linear, angular, lateral, age)` [m/s, rad/s, m/s, s],
    which returns why the robot was stopped instead, or an empty text; and `stop()`, after which commands count again.
    `warning` returns what the user must know of how the node was started; empty if nothing.
    """

    def __init__(
        self,
        robot: TopicRobot,
        commands: Any,
        emergency: EmergencyStop,
        recording: BagRecording,
        phone: Callable[[PhoneReading], None],
        warning: Callable[[], str] = lambda: "",
    ) -> None:
        super().__init__(robot, recording, robot.state)
        self._robot, self._commands, self._emergency = robot, commands, emergency
        self._recording, self._phone, self._warning = recording, phone, warning
        self._lock = threading.RLock()
        self._press: Optional[_Press] = None
        self._stopped_s = -math.inf
        robot.after_status(self._on_status)

    # -- what the robot is and does

    @property
    def latched(self) -> bool:
        return self._emergency.latched

    @property
    def stands(self) -> bool:
        since_s = time.monotonic() - self._robot.age_s - self._stopped_s
        return self._press is None and min(self._robot.stands_s, since_s) >= STANDS_S

    @property
    def stopped_by(self) -> Optional[Why]:
        with self._lock:
            return self._press.look(self._robot, time.monotonic()) if self._press is not None else None

    def shown(self, now_s: float) -> Shown:
        news = self._emergency.trouble, self._robot.notice, self._live.notice, self._recording.loss
        return super().shown(now_s)._replace(notice=next(filter(None, news), self._warning()))

    def listen(self, changed: Callable[[], None]) -> None:
        """Call `changed` after each message of odometry or status, from any thread."""
        self._robot.on_telemetry(lambda _: changed())
        self._robot.after_status(changed)

    def _on_status(self) -> None:
        """Look at each status: a stop that the next command ends is in one of them alone."""
        self._emergency.on_status(self._robot.status.get("mode") == StopReason.EMERGENCY_STOP)
        _ = self.stopped_by

    # -- commands

    def _drive(
        self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float
    ) -> Optional[Why]:
        aside = moves_sideways(self._robot.model)
        with self._lock:
            why = self._refusal()
            if why is not None:
                return why
            self._robot.command = (
                OmniTwist(linear_m_s, angular_rad_s, lateral_m_s)
                if aside
                else Twist(linear_m_s, angular_rad_s)
            )
            self._age_s = age_s
            late = self._commands.drive(linear_m_s, angular_rad_s, lateral_m_s if aside else 0.0, age_s)
            return self._refuse(Why(StopReason.COMMAND_TOO_LATE, late)) if late else None

    def go(self, goal: Goal, age_s: float) -> Optional[Why]:
        return self._refuse(super().go(goal, age_s))

    def stop(self) -> None:
        """Send a stop, if this page has driven since the last one."""
        with self._lock:
            pressed, self._press, self._robot.command, self._age_s = self._press, None, None, math.nan
            self._seeker = None
            if pressed is not None:
                self._stopped_s = time.monotonic()
                self._commands.stop()

    def latch(self) -> None:
        """Stop, and latch the emergency stop of the robot's node."""
        self.stop()
        self._emergency.latch()

    def release(self) -> None:
        self._emergency.release()

    def _refusal(self) -> Optional[Why]:
        """Take the next command of a press, or the first of a new one; return why it is refused."""
        now_s = time.monotonic()
        with self._lock:
            if self._press is None:
                self._press, self._live.notice = _Press(now_s), ""
            return self._refuse(self._press.look(self._robot, now_s) or self._hindrance())

    def _refuse(self, why: Optional[Why]) -> Optional[Why]:
        """Stop the robot, and refuse the rest of the press, if there is a reason."""
        if why is not None and self._press is not None:
            self._press.ended = why
            if self._robot.command is not None:
                self._robot.command = None
                self._commands.stop()
        return why

    def _hindrance(self) -> Optional[Why]:
        """Return why the robot would not follow a command; None if it would."""
        robot = self._robot
        if self.latched:
            return _why(StopReason.EMERGENCY_STOP)
        if robot.age_s >= SILENT_S:
            return SILENT
        if robot.status.get("ready") == "false" and STOPS[robot.stop_reason].why:
            return _why(robot.stop_reason)
        return None if robot.model is None or robot.model.drives else NO_MOTORS

    def phone(self, reading: PhoneReading) -> None:
        self._phone(reading)

    def close(self) -> None:
        """Stop the robot if this page drives it, and end the recording."""
        self.stop()
        self._emergency.close()
        self._recording.stop()


def _why(cause: StopReason, words: str = "") -> Why:
    """Return why the robot does not drive, and what to do about this `stopped by` of its status."""
    why, remedy, _ = STOPS[cause]
    return Why(cause, "; ".join(filter(None, (words or why, remedy))))
