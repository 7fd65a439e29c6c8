"""The robot behind the page, over a driver."""

import contextlib
import json
import os
import time
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Mapping, Optional, Tuple

from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.files import create_unused
from mrl_driver.geometry import Pose
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.models import Limits, RobotModel
from mrl_driver.session.events import SensorRead
from mrl_driver.view.live_model import LiveModel, Shown
from mrl_driver.view.series import Series
from mrl_driver.view.words import stopped_by, why_refused

from .goal_drive import GoalDrive
from .robot import PhoneReading, Recorded

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

REMEDY = "release the control and press it again"
SUFFIX = ".mrl"
AGE_S = 1.0
"""The age of the last command is shown for this time [s]."""


class DriverRobot:
    """Shows and drives the robot of a connected driver; recordings go to files of a folder."""

    def __init__(self, driver: "Driver", folder: str) -> None:
        self._driver, self._folder = driver, folder
        self._live = LiveModel(driver, time.monotonic(), input_name="page", remedy=REMEDY)
        self._series = Series(driver)
        self._goal = GoalDrive()
        self._driven = False
        """A command of the page was in force, and `stop` has not ended it."""
        self._age_s, self._driven_s = 0.0, -AGE_S
        self._latched = False

    @property
    def model(self) -> Optional[RobotModel]:
        """The robot's model."""
        return self._driver.model

    @property
    def limits(self) -> Optional[Limits]:
        """Largest speeds."""
        return self._driver.limits

    @property
    def pose(self) -> Pose:
        """Pose in the odom frame."""
        return self._driver.pose

    @property
    def ranges(self) -> Mapping[str, float]:
        """Range of each sonar by name [m], by REP 117; empty while no telemetry arrives."""
        return self._driver.ranges

    # -- driving

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float) -> str:
        """Drive until the command timeout; return why the robot does not, empty if the command is in force."""
        self._goal.end()
        return self._drive(linear_m_s, angular_rad_s, lateral_m_s, age_s)

    def _drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float) -> str:
        driver = self._driver
        if self._latched:
            return "the emergency stop is on; release it first"
        why = self.stopped_by
        if why:  # between two commands, and the server has not seen it yet
            return why
        try:
            if driver.drive(linear_m_s, angular_rad_s, lateral_m_s) or driver.command is not None:
                self._driven, self._age_s, self._driven_s = True, age_s, time.monotonic()
                return ""
            return why_refused(driver, REMEDY)
        except MrlError as error:
            return str(error)

    def go(self, goal: Pose, has_yaw: bool, age_s: float) -> str:
        """Drive one step towards a goal; return why the robot does not, which may be that it is there."""
        driver = self._driver
        model, limits = driver.model, driver.limits
        if model is None or limits is None or not model.drives:
            return "this robot cannot drive to a goal: its board has no motors"
        if not driver.ready:
            return why_refused(driver, REMEDY)
        step = self._goal.step(goal, has_yaw, driver.pose, driver.ranges, limits, model.sonars, driver.now_s)
        self._live.notice = step.ended or step.notice
        if step.ended:
            return step.ended
        return self._drive(step.linear_m_s, step.angular_rad_s, 0.0, age_s)

    def stop(self) -> None:
        """Stop at once, and forget the goal.  Any thread and any signal handler may call it."""
        self._driven = False
        self._goal.end()
        try:
            self._driver.stop()
        except (
            MrlError
        ) as error:  # the driver sends it again when the board is back, or has ended and says why
            self._live.notice = str(error)

    def latch(self, by: str) -> None:
        """Stop, and refuse all commands until `release`."""
        self._latched, self._driven = True, False
        self._goal.end()
        try:
            self._driver.inhibit(StopReason.EMERGENCY_STOP)
        except MrlError as error:
            self._live.notice = str(error)

    def release(self) -> None:
        """End the latched stop; the robot waits for a new command."""
        self._latched = False
        self._driver.allow(StopReason.EMERGENCY_STOP)

    @property
    def latched(self) -> bool:
        """A latched stop is in force."""
        return self._latched

    @property
    def stands(self) -> bool:
        """Telemetry has confirmed the stop."""
        return self._driver.stopped

    @property
    def stopped_by(self) -> str:
        """Why the robot has stopped by itself since the last command; empty if it has not."""
        if not self._driven or self._driver.command is not None:
            return ""
        return stopped_by(self._driver)

    # -- what is shown

    def shown(self, now_s: float) -> Shown:
        """Return what a live view shows."""
        age_s = self._age_s if now_s - self._driven_s < AGE_S else float("nan")
        return self._live.shown(now_s, age_s)

    def series(self) -> List[Tuple[str, str]]:
        """Name and unit of each number of `sample`."""
        if self._series.outdated():
            self._series = Series(self._driver)
        return self._series.names

    def sample(self) -> List[float]:
        """Return the numbers of `series` now."""
        return self._series.values()

    def listen(self, changed: Callable[[], None]) -> None:
        """Call `changed` for whatever the board sends, on the reading thread."""

        def wake(_: object) -> None:
            changed()

        driver = self._driver
        if driver.model is not None and driver.model.drives:
            driver.on_telemetry(wake)
        else:
            driver.on(SensorRead, wake)
        driver.on_event(wake)

    # -- recordings

    def start_recording(self) -> str:
        """Begin a recording and return its name.

        Raises:
            MrlError: it cannot be written, or one is being written already.
        """
        with contextlib.suppress(OSError):  # `start_recording` raises if the file cannot be made
            os.makedirs(self._folder, 0o700, exist_ok=True)
        path = create_unused(os.path.join(self._folder, time.strftime("%Y-%m-%d_%H%M%S") + SUFFIX))
        try:
            self._driver.recorder.start(path)
        except MrlError:
            with contextlib.suppress(OSError):
                os.unlink(path)
            raise
        self._live.record = os.path.basename(path)
        return self._live.record

    def stop_recording(self) -> str:
        """End the recording; return what it lacks in words, empty if it is complete."""
        self._live.record = ""
        return self._driver.recorder.stop()

    def recordings(self) -> List[Recorded]:
        """Return the recordings of the folder, the newest first."""
        recorder = self._driver.recorder.file
        now = os.path.abspath(recorder.path) if recorder is not None else ""
        found = []
        with contextlib.suppress(OSError), os.scandir(self._folder) as entries:
            for entry in entries:
                if entry.name.endswith(SUFFIX) and entry.is_file(follow_symlinks=False):
                    seen = entry.stat()
                    found.append(
                        (
                            seen.st_mtime,
                            Recorded(entry.name, seen.st_size, os.path.abspath(entry.path) == now),
                        )
                    )
        return [each for _, each in sorted(found, reverse=True)]

    def recording_path(self, name: str) -> str:
        """Return the path of a recording.

        Raises:
            ConfigError: no recording has this name.
        """
        if name not in {each.name for each in self.recordings()}:
            raise ConfigError(f"there is no recording {name!r} in {self._folder}")
        return os.path.join(self._folder, name)

    def phone(self, reading: PhoneReading) -> None:
        """Write a reading of the phone's sensors into the recording, if there is one."""
        if self._driver.recorder.file is None:
            return
        facts: Dict[str, Any] = {
            name: list(value) if isinstance(value, tuple) else None if value != value else value
            for name, value in reading._asdict().items()
        }
        with contextlib.suppress(MrlError):  # the driver has ended; it says so itself
            self._driver.recorder.remark(f"phone {json.dumps(facts)}")

    def close(self) -> None:
        """Stop the robot; the driver stays open."""
        self.stop()
