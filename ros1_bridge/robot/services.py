"""The actions of the node's services and of `set_pose`: each returns (success, message).  No ROS."""

import math
from typing import Any, Callable, Collection, Dict, Tuple

from mrl_driver.errors import MrlError
from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from mrl_driver.robot.covariance import AT_START, Spread
from mrl_driver.yaml_file import short
from ros1_bridge.control.commander import Commander
from ros1_bridge.control.wheel_motion import STILL_M_S
from ros1_bridge.node.plane_poses import planar
from ros1_bridge.topics.message_covariance import spread_of

Answer = Tuple[bool, str]
STILL_RAD_S = 0.02  # A slower turn counts as standing still
GAINS = ("kp", "ki", "kd")
UNDER_WAY = "the robot moves, or drives to a pose"


class Services:
    """The services of one robot.

    `localisers`: returns the names of nodes that localise the robot in a map by its odometry.
    """

    def __init__(
        self, driver: Any, commander: Commander, localisers: Callable[[], Collection[str]] = tuple
    ) -> None:
        self._driver, self._commander, self._localisers = driver, commander, localisers

    def reset_odometry(self) -> Answer:
        """Set the pose to the origin of odom."""
        return self._set_pose(ORIGIN, AT_START)

    def set_pose(self, message: Any, odom_frame: str) -> Answer:
        """Set the pose in `odom_frame`, and its covariance, to those of a geometry_msgs/PoseWithCovarianceStamped."""
        frame = message.header.frame_id
        if frame not in ("", odom_frame):
            return False, f"the pose is in {short(frame)}, expected {odom_frame}"
        try:
            return self._set_pose(planar(message.pose.pose), spread_of(message.pose.covariance))
        except ValueError as error:
            return False, str(error)

    def _set_pose(self, pose: Pose, spread: Spread) -> Answer:
        if not self._still():
            return False, f"{UNDER_WAY}; stop it first, for a pose that jumps in motion misleads filters"
        localisers = ", ".join(sorted(self._localisers()))
        if localisers:
            return False, (
                f"{localisers} would take the jump for motion; publish the robot's pose in the map on initialpose "
                "(rviz: 2D Pose Estimate) instead, or end that node first"
            )
        self._driver.reset_pose(pose, spread)
        return True, f"the pose is {pose.x_m:g}, {pose.y_m:g}, {pose.yaw_rad:g}"

    def stop(self) -> Answer:
        """Latch the emergency stop."""
        done = "stopped; release_stop lets the robot follow commands again"
        return _answer(self._commander.latch, done, "latched, but the robot cannot be reached: ")

    def release_stop(self) -> Answer:
        """End the emergency stop."""
        latched = self._commander.emergency
        self._commander.release()
        if not latched:
            return True, "no emergency stop was latched"
        try:
            if not self._commander.release_input():
                return False, f"{self._driver.inputs}; release the button at the robot first"
        except MrlError as error:
            return False, str(error)
        return True, "released; the robot stands until the next command"

    def release_hold(self) -> Answer:
        """Drop the robots that hold this one by radio and have fallen silent."""
        radio = self._driver.radio
        try:
            free = radio.release_hold()
        except MrlError as error:
            return False, str(error)
        return free, "released; the robot stands until the next command" if free else str(radio.hold)

    def enable_motors(self, enabled: bool) -> Answer:
        """Follow commands, or stop and refuse them."""
        done = "enabled" if enabled else "stopped and disabled"
        failed = "disabled, but the robot cannot be reached: "
        return _answer(lambda: self._commander.enable(enabled), done, failed)

    def calibrate(self) -> Answer:
        """Let the motor board calibrate itself; the wheels turn."""
        if not self._commander.ready:
            return False, f"refused: {self._commander.refusal()}"
        if not self._still():
            return False, f"refused: {UNDER_WAY}; stop it first"
        if self._commander.manual:
            return False, "refused: the motor board turns the wheels faster than manual mode allows"
        done = "the motor board calibrates, the wheels turn; reset_odometry afterwards"
        return _answer(lambda: self._driver.request(BY_NAME["calibrate"].code), done)

    def gains(self) -> Dict[str, int]:
        """The gains kp, ki and kd of the motor board, or of the model (2013); MrlError if the board does not answer."""
        driver = self._driver
        if "config" not in driver.board.capabilities:
            return {name: driver.model.board[name] for name in GAINS}
        read = BY_NAME["read_config"].code
        return {name: driver.ask(read, PARAMETER_BY_NAME[name].number)[1] for name in GAINS}

    def set_gains(self, kp: int, ki: int, kd: int) -> Answer:
        """Set the gains of the motor board's speed control; the board stores them."""
        code = BY_NAME["set_pid_gains"].code
        return _answer(lambda: self._driver.request(code, kp, ki, kd), f"gains are {kp}, {ki}, {kd}")

    def _still(self) -> bool:
        twist = self._driver.twist
        fast = math.hypot(twist[0], *twist[2:]) > STILL_M_S or math.fabs(twist[1]) > STILL_RAD_S
        return not (fast or self._commander.driving or self._commander.seeking)


def _answer(act: Callable[[], Any], done: str, failed: str = "") -> Answer:
    """Call `act`; answer `done`, or why it has failed, after the words `failed`."""
    try:
        act()
    except MrlError as error:
        return False, f"{failed}{error}"
    return True, done
