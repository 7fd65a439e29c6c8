"""The actions of the node's services: each takes nothing or a switch, and returns (success, message).  No ROS."""

import math
from typing import Any, Callable, Dict, Tuple

from mrl_driver.errors import MrlError
from mrl_driver.protocol.table import BY_NAME, PARAMETER_BY_NAME
from ros1_bridge.control.commander import Commander

Answer = Tuple[bool, str]
STILL_M_S, STILL_RAD_S = 0.005, 0.02
"""Slower than this counts as standing still."""
GAINS = ("kp", "ki", "kd")
UNDER_WAY = "the robot moves, or drives to a pose"


class Services:
    """The services of one robot; `forget_path` resets the covariance of the pose."""

    def __init__(self, driver: Any, commander: Commander, forget_path: Callable[[], None]) -> None:
        self._driver, self._commander, self._forget_path = driver, commander, forget_path

    def reset_odometry(self) -> Answer:
        """Set the pose to the origin of odom."""
        if not self._still():
            return False, f"{UNDER_WAY}; stop it first, for a pose that jumps in motion misleads filters"
        self._driver.reset_pose()
        self._forget_path()
        return True, "the pose is 0, 0, 0"

    def stop(self) -> Answer:
        """Latch the emergency stop."""
        try:
            self._commander.latch()
        except MrlError as error:
            return False, f"latched, but the robot cannot be reached: {error}"
        return True, "stopped; release_stop lets the robot follow commands again"

    def release_stop(self) -> Answer:
        """End the emergency stop."""
        if not self._commander.latched:
            return True, "no emergency stop was latched"
        self._commander.release()
        return True, "released; the robot stands until the next command"

    def enable_motors(self, enabled: bool) -> Answer:
        """Follow commands, or stop and refuse them."""
        try:
            self._commander.enable(enabled)
        except MrlError as error:
            return False, f"disabled, but the robot cannot be reached: {error}"
        return True, "enabled" if enabled else "stopped and disabled"

    def calibrate(self) -> Answer:
        """Let the motor board calibrate itself; the wheels turn."""
        if not self._commander.ready:
            return False, f"refused: {self._commander.refusal()}"
        if not self._still():
            return False, f"refused: {UNDER_WAY}; stop it first"
        try:
            self._driver.request(BY_NAME["calibrate"].code)
        except MrlError as error:
            return False, str(error)
        return True, "the motor board calibrates, the wheels turn; reset_odometry afterwards"

    def gains(self) -> Dict[str, int]:
        """The gains kp, ki and kd of the motor board; the model's if the board does not tell them (2013).

        Raises:
            MrlError: the board does not answer.
        """
        driver = self._driver
        if "config" not in driver.board.capabilities:
            return {name: driver.model.board[name] for name in GAINS}
        read = BY_NAME["read_config"].code
        return {name: driver.ask(read, PARAMETER_BY_NAME[name].number)[1] for name in GAINS}

    def set_gains(self, kp: int, ki: int, kd: int) -> Answer:
        """Set the gains of the motor board's speed control; the board stores them."""
        try:
            self._driver.request(BY_NAME["set_pid_gains"].code, kp, ki, kd)
        except MrlError as error:
            return False, str(error)
        return True, f"gains are {kp}, {ki}, {kd}"

    def _still(self) -> bool:
        twist = self._driver.twist
        fast = math.hypot(twist[0], *twist[2:]) > STILL_M_S or math.fabs(twist[1]) > STILL_RAD_S
        return not (fast or self._commander.moving or self._commander.seeking)
