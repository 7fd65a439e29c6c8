"""The robot of a page, behind ROS topics.  No rospy: `web_node` brings the messages, and sends what this asks for."""

import math
import threading
import time
from typing import Callable, List, Mapping, Optional, Protocol, Tuple

from mrl_driver.apps.web.driver_robot import REMEDY
from mrl_driver.apps.web.goal_drive import GoalDrive
from mrl_driver.apps.web.robot import PhoneReading, Recorded
from mrl_driver.geometry import Pose
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.models import Limits, RobotModel
from mrl_driver.robot.odometry import OmniTwist, Twist
from mrl_driver.view.live_model import LiveModel, Shown
from mrl_driver.view.series import Series
from mrl_driver.view.shown_state import SILENT_S, moves_sideways
from mrl_driver.view.words import STOPS, stopped_text
from ros1_bridge.topics.topic_robot import NO_STOP, TopicRobot

from .bag_recording import BagRecording
from .emergency_stop import EmergencyStop

FOLLOWED_S = 0.5
"""A robot that stood for a reason follows a new command within this time, or the reason still holds: `status` shows a
change after 0.2 s at most [s].
"""
STANDS_S = 0.1
"""A robot that has stood for this time stands [s]."""
PAUSE_S = 0.3
"""A command after a longer pause begins a new press: the page sends one every 50 ms [s]."""
SILENT = "no odometry arrives; look whether the robot's node runs"
NO_MOTORS = "this board has no motors"
UNKNOWN = "the robot's model is not known yet; start the node with robot:=NAME"


class Commands(Protocol):
    """Sends the page's commands; no method blocks."""

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float) -> str:
        """Send speeds of an input that is `age_s` old; returns why the robot was stopped instead, or ''."""

    def stop(self) -> None:
        """Send a stop; after it commands count again."""


class _Press:
    """Commands from the first one until a stop: what the robot's node has said of them."""

    def __init__(self, now_s: float) -> None:
        self.begun_s = self.last_s = now_s
        self.followed = False
        self.ended = ""
        """Why these commands count no longer; empty while they do."""

    def look(self, robot: TopicRobot, now_s: float) -> str:
        """Return why the robot has stopped by itself since the first command; empty if it has not."""
        cause = robot.stop_reason
        if self.ended:
            return self.ended
        if cause in NO_STOP:
            self.followed = True
        elif self.followed or now_s - self.begun_s > FOLLOWED_S:
            self.ended = _with_remedy(stopped_text(cause), cause)
        return self.ended


class TopicPageRobot:
    """A `mrl_driver.apps.web.robot.PageRobot` of topics.

    Callbacks of ROS and the page's server may call it at the same time.

    Args:
        robot: keeps the newest messages.
        commands: sends the page's commands.
        emergency: the emergency stop of the robot's node.
        recording: records the robot's topics.
        phone: publishes a reading of the phone.
        warning: returns what the user must know of how the node was started; empty if nothing.
    """

    def __init__(
        self,
        robot: TopicRobot,
        commands: Commands,
        emergency: EmergencyStop,
        recording: BagRecording,
        phone: Callable[[PhoneReading], None],
        warning: Callable[[], str] = lambda: "",
    ) -> None:
        self._robot, self._commands, self._emergency = robot, commands, emergency
        self._recording, self._phone, self._warning = recording, phone, warning
        self._lock = threading.RLock()
        self._goal = GoalDrive()
        self._press: Optional[_Press] = None
        self._age_s, self._stopped_s, self._notice = math.nan, -math.inf, ""
        self._live = LiveModel(robot, time.monotonic(), robot.state, "page", REMEDY)
        self._series = Series(robot)
        robot.after_status(self._on_status)

    # -- what the robot is and does

    @property
    def model(self) -> Optional[RobotModel]:
        """The robot's model; None before the board's id is known."""
        return self._robot.model

    @property
    def limits(self) -> Optional[Limits]:
        """The speed limits that the robot's node applies."""
        return self._robot.limits

    @property
    def pose(self) -> Pose:
        """Pose in the frame of `odom`."""
        return self._robot.pose

    @property
    def ranges(self) -> Mapping[str, float]:
        """Range of each sonar (REP 117) [m]."""
        return self._robot.ranges

    @property
    def latched(self) -> bool:
        """The emergency stop is on; any program may have latched it."""
        return self._emergency.latched

    @property
    def stands(self) -> bool:
        """Odometry says that the robot stands, also since the last stop."""
        since_s = time.monotonic() - self._robot.age_s - self._stopped_s
        return self._press is None and min(self._robot.stands_s, since_s) >= STANDS_S

    @property
    def stopped_by(self) -> str:
        """Why the robot stopped by itself since the first command after a stop of this page; empty if it did not."""
        with self._lock:
            return self._press.look(self._robot, time.monotonic()) if self._press is not None else ""

    def shown(self, now_s: float) -> Shown:
        """Return what the page shows now."""
        self._live.record = self._recording.name
        news = (
            self._emergency.trouble,
            self._robot.notice,
            self._notice,
            self._recording.loss,
            self._warning(),
        )
        return self._live.shown(now_s, self._age_s, next(filter(None, news), ""))

    def series(self) -> List[Tuple[str, str]]:
        """Return names and units of the numbers of `sample`."""
        if self._series.outdated():
            self._series = Series(self._robot)
        return self._series.names

    def sample(self) -> List[float]:
        """Return the numbers now."""
        return self._series.values()

    def listen(self, changed: Callable[[], None]) -> None:
        """Call `changed` after each message of odometry or status, from any thread."""
        self._robot.on_telemetry(lambda _: changed())
        self._robot.after_status(changed)

    def _on_status(self) -> None:
        """Look at each status: a stop that the next command ends is in one of them alone."""
        self._emergency.on_status(self._robot.status.get("mode") == StopReason.EMERGENCY_STOP)
        with self._lock:
            if self._press is not None:
                self._press.look(self._robot, time.monotonic())

    # -- commands

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float) -> str:
        """Send speeds of an input that is `age_s` old; returns why the robot does not drive, or an empty string."""
        with self._lock:
            self._goal.end()
            return self._begin() or self._send(linear_m_s, angular_rad_s, lateral_m_s, age_s)

    def go(self, goal: Pose, has_yaw: bool, age_s: float) -> str:
        """Send speeds of one step towards a goal in the frame of `odom`; returns why the robot does not drive."""
        with self._lock:
            model, limits = self.model, self.limits
            why = self._begin() or ("" if model and limits else UNKNOWN)
            if why:
                return why
            assert model is not None and limits is not None
            now_s = time.monotonic()
            step = self._goal.step(goal, has_yaw, self.pose, self.ranges, limits, model.sonars, now_s)
            self._notice = step.ended or step.notice
            if step.ended:
                return self._refuse(step.ended)
            return self._send(step.linear_m_s, step.angular_rad_s, 0.0, age_s)

    def stop(self) -> None:
        """Send a stop, if this page has driven since the last one."""
        with self._lock:
            pressed, self._press, self._robot.command, self._age_s = self._press, None, None, math.nan
            self._goal.end()
            if pressed is not None:
                self._stopped_s = time.monotonic()
                self._commands.stop()

    def latch(self, by: str) -> None:
        """Stop, and latch the emergency stop of the robot's node."""
        self.stop()
        self._emergency.latch()

    def release(self) -> None:
        """Release the emergency stop; the robot stands until the next command."""
        self._emergency.release()

    def _begin(self) -> str:
        """Take the next command of a press, or the first of a new one; returns why it is refused."""
        now_s = time.monotonic()
        press = self._press
        if press is None or now_s - press.last_s > PAUSE_S:
            press = self._press = _Press(now_s)
            self._notice = ""
        press.last_s = now_s
        return self._refuse(press.look(self._robot, now_s) or self._refusal())

    def _refuse(self, why: str) -> str:
        """Stop the robot, and refuse the rest of the press, if there is a reason."""
        if why and self._press is not None:
            self._press.ended = why
            if self._robot.command is not None:
                self._robot.command = None
                self._commands.stop()
        return why

    def _refusal(self) -> str:
        """Return why the robot would not follow a command; empty if it would."""
        robot = self._robot
        if self.latched:
            return _with_remedy(STOPS[StopReason.EMERGENCY_STOP].why, StopReason.EMERGENCY_STOP)
        if robot.age_s >= SILENT_S:
            return SILENT
        if robot.status.get("ready") == "false":
            return _with_remedy(STOPS[robot.stop_reason].why, robot.stop_reason)
        return "" if robot.model is None or robot.model.drives else NO_MOTORS

    def _send(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float) -> str:
        aside = moves_sideways(self.model)
        self._robot.command = (
            OmniTwist(linear_m_s, angular_rad_s, lateral_m_s) if aside else Twist(linear_m_s, angular_rad_s)
        )
        self._age_s = age_s
        return self._refuse(
            self._commands.drive(linear_m_s, angular_rad_s, lateral_m_s if aside else 0.0, age_s)
        )

    # -- recordings, phone

    def start_recording(self) -> str:
        """Begin a bag; returns its name."""
        return self._recording.start()

    def stop_recording(self) -> str:
        """End the bag; returns why it is incomplete, or an empty string."""
        return self._recording.stop()

    def recordings(self) -> List[Recorded]:
        """Return the bags, the newest first."""
        return [Recorded(*bag) for bag in self._recording.bags()]

    def recording_path(self, name: str) -> str:
        """Return the file of a bag."""
        return str(self._recording.path(name))

    def phone(self, reading: PhoneReading) -> None:
        """Publish a reading of the phone's sensors."""
        self._phone(reading)

    def close(self) -> None:
        """Stop the robot if this page drives it, and end the recording."""
        self.stop()
        self._emergency.close()
        self._recording.stop()


def _with_remedy(why: str, cause: StopReason) -> str:
    """Return why the robot does not drive, and what to do about this `stopped by` of its status."""
    remedy = STOPS[cause].remedy
    return f"{why}; {remedy}" if remedy else why
