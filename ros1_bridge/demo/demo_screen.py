"""The live view of the demonstration: also drives a square, and ends after a time.  Imports no ROS."""

import math
from typing import Optional

from mrl_driver.navigation.line_follower import Square
from mrl_driver.terminal.live_view import Screen, Settings
from mrl_driver.terminal.teleop_keys import HOLD_S, Teleop
from mrl_driver.view.shown_state import SILENT_S, Shown, moves_sideways
from mrl_driver.view.words import STOPS, remedied_text
from ros1_bridge.topics.topic_robot import TopicRobot

CORNERS = 4  # A square ends where it began


class DemoScreen(Screen):
    """The view of a robot behind ROS topics.  Keys drive from the start; `r` drives a square.

    While nothing drives it publishes nothing, so that other nodes can drive.
    """

    keys = (("r", "square"),)

    def __init__(self, robot: TopicRobot, port: str, square: bool, duration_s: float = 0.0) -> None:
        """`duration_s`: the view ends after that much odometry; 0 means no end."""
        super().__init__(robot, Settings(port, keys_drive=True), None)
        self._robot = robot
        self.square = Square() if square else None  # The square that is driven; None if none is
        self.duration_s = duration_s
        self._first_s: Optional[float] = None
        self._now_s = 0.0

    @property
    def elapsed_s(self) -> float:
        """Time from the first odometry to the last step [s]."""
        return self._now_s - self._first_s if self._first_s is not None else 0.0

    def press(self, key: str, now_s: float) -> None:
        """Handle a key; a key that drives or stops ends the square.

        An `r` older than `HOLD_S` starts none: it was typed while the program was suspended.
        """
        if key == "r":
            if self._clock() < now_s + HOLD_S:
                self.square = Square()
            return
        if key in ("space", "\r", "\n") or Teleop.moves(key, moves_sideways(self._robot.model)):
            self.square = None
        super().press(key, now_s)

    def steer(self, now_s: float) -> None:
        """Drive the square or as the keys say, until the time is over; ConfigError if the board has no motors."""
        if self._robot.model is not None:
            self._robot.model.require_odometry()
        self._now_s = now_s
        if self._first_s is None and self.live.frames:
            self._first_s = now_s
        if self.duration_s and self.elapsed_s >= self.duration_s:
            self.ended = True
        if self.square is None:
            super().steer(now_s)
        elif self.square.corner == CORNERS:
            self.square = None
            self._robot.stop()
        elif self._robot.age_s < SILENT_S:
            self._robot.drive(*self.square.command(self._robot.pose))
        elif self._robot.command is not None:
            self._robot.stop()

    def state(self) -> Shown:
        """Return the robot's state now."""
        return self._robot.state()

    def warning(self) -> str:
        """Return why the robot or the keys do not drive, and what to do; empty if they may."""
        robot, reason = self._robot, self._robot.stop_reason
        refused = robot.command is not None and not robot.driving and STOPS[reason].remedy
        return (remedied_text(reason) if refused else robot.notice) or super().warning()

    def summary(self) -> str:
        """The last line of a run."""
        (x_m, y_m, yaw_rad), live = self._robot.pose, self.live
        return (
            f"ran {self.elapsed_s:.1f} s: pose x {x_m:+.3f} m, y {y_m:+.3f} m, yaw {math.degrees(yaw_rad):+.1f} deg; "
            f"distance {live.trail.distance_m:.3f} m; {live.frames} odometry frames; {self._robot.errors} link errors"
        )
