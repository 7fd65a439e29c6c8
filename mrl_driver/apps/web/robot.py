"""What the server of the page needs of a robot; `driver_robot` has it over a driver, the ROS bridge over topics."""

from typing import Callable, List, Mapping, NamedTuple, Optional, Protocol, Tuple

from mrl_driver.geometry import Pose
from mrl_driver.robot.models import Limits, RobotModel
from mrl_driver.view.live_model import Shown

Vector = Tuple[float, float, float]


class Recorded(NamedTuple):
    """A recording that the page can download."""

    name: str
    """Name of its file, without a folder."""
    size: int
    """Size [byte]."""
    on: bool
    """It is being written."""


class PhoneReading(NamedTuple):
    """What the sensors of the driving person's phone measure, as browsers report it."""

    t_s: float
    """Time of the reading [s, the page's clock]."""
    alpha_deg: float
    """Turn about the vertical axis, counter-clockwise from north if `absolute` [deg]; NaN: unknown, as the next two."""
    beta_deg: float
    """Turn about the phone's x [deg]."""
    gamma_deg: float
    """Turn about the phone's y [deg]."""
    absolute: bool
    """`alpha_deg` is counted from north; otherwise from where the phone pointed at the start."""
    acceleration_m_s2: Optional[Vector]
    """Along the phone's x, y, z, with gravity: z is +9.8 when it lies face up [m/s2]."""
    rotation_deg_s: Optional[Vector]
    """Rates as `DeviceMotionEvent.rotationRate` has them: alpha, beta, gamma [deg/s]."""


class PageRobot(Protocol):
    """A robot behind the page.  The server's loop calls all of it, and nothing may block for long."""

    @property
    def model(self) -> Optional[RobotModel]:
        """The robot's model; None while it is unknown."""

    @property
    def limits(self) -> Optional[Limits]:
        """Largest speeds; None while they are unknown."""

    @property
    def pose(self) -> Pose:
        """Pose in the odom frame."""

    @property
    def ranges(self) -> Mapping[str, float]:
        """Range of each sonar by name [m], by REP 117."""

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float) -> str:
        """Drive at these speeds until the command timeout.

        `age_s` is an upper bound of the command's age.  Return why the robot does not drive; empty if the command is in
        force.
        """

    def go(self, goal: Pose, has_yaw: bool, age_s: float) -> str:
        """Drive one step towards a goal in the odom frame; without `has_yaw` any yaw will do.

        Return why the robot does not drive; empty if the step's command is in force, or the goal is reached, of which
        `shown` has a notice.
        """

    def stop(self) -> None:
        """Stop at once, and forget the goal."""

    def latch(self, by: str) -> None:
        """Stop, and refuse all commands until `release`; `by` names the person or program."""

    def release(self) -> None:
        """End the latched stop; the robot waits for a new command."""

    @property
    def latched(self) -> bool:
        """A latched stop is in force; another program may have set it."""

    @property
    def stands(self) -> bool:
        """Since the last `stop` or `latch`, measurements have confirmed that the robot stands still."""

    @property
    def stopped_by(self) -> str:
        """Why the robot has stopped by itself since the last `drive` or `go`; empty if it has not."""

    def shown(self, now_s: float) -> Shown:
        """What a live view shows of the robot."""

    def series(self) -> List[Tuple[str, str]]:
        """Name and unit of each number of `sample`."""

    def sample(self) -> List[float]:
        """The numbers of `series` now; NaN: not known."""

    def listen(self, changed: Callable[[], None]) -> None:
        """Call `changed` after each telemetry frame, from any thread."""

    def start_recording(self) -> str:
        """Begin a recording and return its name.

        Raises:
            MrlError: it cannot be written, or one is being written already.
        """

    def stop_recording(self) -> str:
        """End the recording; return what it lacks in words, empty if it is complete."""

    def recordings(self) -> List[Recorded]:
        """The recordings that can be downloaded, the newest first."""

    def recording_path(self, name: str) -> str:
        """Return the path of a recording.

        Raises:
            ConfigError: no recording has this name.
        """

    def phone(self, reading: PhoneReading) -> None:
        """Pass on, or record, a reading of the phone's sensors."""

    def close(self) -> None:
        """Stop the robot and release what it uses."""
