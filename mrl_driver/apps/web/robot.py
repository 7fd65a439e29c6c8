"""What the server of the page needs of a robot; `driver_robot` has it over a driver, the ROS bridge over topics."""

import contextlib
import math
import os
import time
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, Callable, List, NamedTuple, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.files import create_unused
from mrl_driver.geometry import Pose
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.view.live_model import LiveModel
from mrl_driver.view.series import Series
from mrl_driver.view.shown_state import Shown

from .helm import Goal, Why, why_of

Vector = Tuple[float, float, float]
REMEDY = "release the control and press it again"
NO_MOTORS = Why(StopReason.MOTORS_DISABLED, "this board has no motors")
NO_ODOMETRY = Why(StopReason.GOAL_BLOCKED, "the motors have no encoders: the robot does not know where it is")
UNKNOWN = Why(StopReason.NO_TELEMETRY, "the robot's model is not known yet; start the node with robot:=NAME")
LOOK_RAD = 4 * math.pi
"""The robot turns twice on the spot in search of a free path before the goal counts as blocked, as in `mrl goto`."""


class Recorded(NamedTuple):
    """A recording that the page can download."""

    name: str  # name of its file, without a folder
    size: int  # [byte]
    on: bool  # it is being written


class Recordings(ABC):
    """The recordings of one robot in a folder, whose names end with `suffix`.

    `active` follows the name of a file while it is written; it can be downloaded then only if this is empty.
    """

    def __init__(self, folder: Path, suffix: str, active: str = "") -> None:
        self._folder, self._suffix, self._active = folder, suffix, active

    @property
    @abstractmethod
    def name(self) -> str:
        """File of the recording that is being written; empty without one."""

    @abstractmethod
    def start(self) -> str:
        """Begin a recording and return its name; raise MrlError if it cannot be written, or one is being written."""

    @abstractmethod
    def stop(self) -> str:
        """End the recording; return what it lacks in words, empty if it is complete."""

    def files(self) -> List[Recorded]:
        """Return the recordings: the one that is being written, then the newest first."""
        now, found = self.name, []
        with contextlib.suppress(OSError):
            for path in self._folder.iterdir():
                on = bool(now) and path.name == now + self._active
                name = now if on else path.name
                if name.endswith(self._suffix) and path.is_file() and not path.is_symlink():
                    seen = path.stat()
                    found.append((on, seen.st_mtime, Recorded(name, seen.st_size, on)))
        return [each for *_, each in sorted(found, reverse=True)]

    def path(self, name: str) -> str:
        """Return the path of a recording; raise ConfigError if none that can be downloaded has this name."""
        if not any(each.name == name and not (each.on and self._active) for each in self.files()):
            raise ConfigError(
                f"there is no recording {name!r} in {self._folder}, expected one of those in the list"
            )
        return str(self._folder / name)

    def _new(self, stem: str) -> str:
        """Make the folder, and in it an empty file for a new recording; return its name, which no other has."""
        with contextlib.suppress(OSError):  # the program that opens the file says why
            self._folder.mkdir(0o700, parents=True, exist_ok=True)
        return os.path.basename(create_unused(str(self._folder / (stem + self._suffix)), self._active))


class PhoneReading(NamedTuple):
    """What the sensors of the driving person's phone measure, as browsers report it."""

    t_s: float  # time of the reading [s, the page's clock]
    alpha_deg: float
    """Turn about the vertical axis, counter-clockwise from north if `absolute` [deg]; NaN: unknown, as the next two."""
    beta_deg: float  # turn about the phone's x [deg]
    gamma_deg: float  # turn about the phone's y [deg]
    absolute: bool  # `alpha_deg` is counted from north; otherwise from where the phone pointed at the start
    acceleration_m_s2: Optional[Vector]
    """Along the phone's x, y, z, with gravity: z is +9.8 when it lies face up [m/s2]."""
    rotation_deg_s: Optional[Vector]
    """Rates as `DeviceMotionEvent.rotationRate` has them: alpha, beta, gamma [deg/s]."""


class PageRobot(ABC):
    """A robot behind the page.  The server's loop calls all of it, and nothing may block for long.

    `source` is a Driver, or an object with the attributes of one that live views use; then it needs a `state`.
    """

    def __init__(
        self, source: Any, recordings: Recordings, state: Optional[Callable[[], Shown]] = None
    ) -> None:
        self.source, self.recordings = source, recordings
        self._live = LiveModel(source, time.monotonic(), state, "page", REMEDY)
        self._series = Series(source)
        self._goal: Optional[Goal] = None
        self._seeker: Optional[GoalSeeker] = None
        """Searches the way to the goal; None after a stop or another command."""
        self._age_s = math.nan  # age of the last command that drove [s]

    def drive(
        self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float
    ) -> Optional[Why]:
        """Drive at these speeds until the command timeout.

        `age_s` is an upper bound of the command's age.  Return why the robot does not drive; None if the command is in
        force.
        """
        self._seeker = None
        return self._drive(linear_m_s, angular_rad_s, lateral_m_s, age_s)

    def go(self, goal: Goal, age_s: float) -> Optional[Why]:
        """Drive one step towards a goal in the odom frame; without a yaw, in the direction from here to the goal.

        A new goal, and the first step after a stop, begin a new search with an empty map.  Return why the robot does
        not drive, which may be that it is there; None if the step's command is in force.
        """
        source = self.source
        if source.model is None or source.limits is None:
            return UNKNOWN
        why = self._refusal() if source.model.drives else NO_MOTORS
        why = why or (None if source.model.has_odometry else NO_ODOMETRY)
        if why is not None:
            return why
        seeker = self._seeker
        if seeker is None or goal != self._goal:
            self._goal, seeker = goal, self._search(goal)
            self._seeker = seeker
        linear_m_s, angular_rad_s = seeker.command(source.pose, source.ranges, source.now_s)
        if seeker.reached:
            why = why_of(StopReason.GOAL_REACHED)
        elif seeker.blocked:
            why = Why(StopReason.GOAL_BLOCKED, f"the goal was not reached: {seeker.why}")
        waits = f"waits: {seeker.why}" if seeker.blind else ""
        self._live.notice = waits if why is None else why.words
        return why or self._drive(linear_m_s, angular_rad_s, 0.0, age_s)

    def _search(self, goal: Goal) -> GoalSeeker:
        source, (x_m, y_m, yaw_rad) = self.source, goal
        if yaw_rad is None:
            yaw_rad = math.atan2(y_m - source.pose.y_m, x_m - source.pose.x_m)
        target = Pose(x_m, y_m, yaw_rad)
        return GoalSeeker(target, source.limits, source.now_s, source.model.sonars, look_rad=LOOK_RAD)

    @abstractmethod
    def _drive(
        self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float
    ) -> Optional[Why]:
        """As `drive`; the goal stays."""

    @abstractmethod
    def _refusal(self) -> Optional[Why]:
        """Return why the robot would not follow a command now."""

    @abstractmethod
    def stop(self) -> None:
        """Stop at once, and forget the goal.  Any thread and any signal handler may call it."""

    @abstractmethod
    def latch(self) -> None:
        """Stop, and refuse all commands until `release`."""

    @abstractmethod
    def release(self) -> None:
        """End the latched stop; the robot waits for a new command."""

    @property
    @abstractmethod
    def latched(self) -> bool:
        """A latched stop is in force; another program may have set it."""

    @property
    @abstractmethod
    def stands(self) -> bool:
        """Since the last `stop` or `latch`, measurements have confirmed that the robot stands still."""

    @property
    @abstractmethod
    def stopped_by(self) -> Optional[Why]:
        """Why the robot has stopped by itself since the last `drive` or `go`; None if it has not."""

    def shown(self, now_s: float) -> Shown:
        """What a live view shows of the robot."""
        return self._live.shown(now_s, self._age_s)

    def series(self) -> List[Tuple[str, str]]:
        """Name and unit of each number of `sample`."""
        if self._series.outdated():
            self._series = Series(self.source)
        return self._series.names

    def sample(self) -> List[float]:
        """The numbers of `series` now; NaN: not known."""
        return self._series.values()

    @abstractmethod
    def listen(self, changed: Callable[[], None]) -> None:
        """Call `changed` after each telemetry frame, from any thread."""

    @abstractmethod
    def phone(self, reading: PhoneReading) -> None:
        """Pass on, or record, a reading of the phone's sensors."""
