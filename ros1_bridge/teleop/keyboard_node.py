"""ROS node `teleop_keyboard`: converts keys of the terminal to `cmd_vel`; silent while no key is held."""

import math
import sys
import time
from typing import Any, Dict

import rospy
from geometry_msgs.msg import Twist

from mrl_driver.errors import ConfigError
from mrl_driver.safety.message_age import clock_s
from mrl_driver.terminal.keyboard import Keyboard
from mrl_driver.terminal.teleop_keys import ANGULAR_RAD_S, LINEAR_M_S, Teleop
from ros1_bridge.node.cmd_vel import DELAY_ROW, OperatorCmdVel, twist_of
from ros1_bridge.node.parameters import speed_rows
from ros1_bridge.node.run_node import node

PERIOD_S, SHOW_S = 0.05, 0.2
HELP = "arrow keys or w a s d drive, space stops, q ends"
PARAMETERS = (*speed_rows("Speed forward and back", "Yaw rate", LINEAR_M_S, ANGULAR_RAD_S), DELAY_ROW)
"""The node's private parameters."""


class TeleopKeyboard:
    """Drives from one terminal."""

    def __init__(self, given: Dict[str, Any]) -> None:
        self._linear, self._angular = (
            given["linear_speed"] / LINEAR_M_S,
            given["angular_speed"] / ANGULAR_RAD_S,
        )
        self._out = OperatorCmdVel(given["max_delay"])
        self._shown_s = -math.inf

    def run(self, keyboard: Keyboard) -> None:
        """Drive until `q` or the shutdown."""
        teleop = Teleop()
        while not rospy.is_shutdown():
            keys, input_s = keyboard.read(PERIOD_S), clock_s()
            for key in keys:
                if key in ("q", "escape", "\x03"):
                    return
                input_s = clock_s() - (time.monotonic() - keyboard.pressed_s)
                teleop.press(key, keyboard.pressed_s)
                if key == "space":
                    self._out.hold(Twist(), input_s)
            now_s = time.monotonic()
            self._publish(*teleop.command(now_s), teleop.slide(now_s), input_s)
            self._show(now_s)

    def _publish(self, linear: float, angular: float, lateral: float, input_s: float) -> None:
        twist = twist_of(linear * self._linear, angular * self._angular, lateral * self._linear)
        self._out.hold(twist if twist != Twist() else None, input_s)

    def _show(self, now_s: float) -> None:
        """Show the delay on the last line of the terminal."""
        if now_s >= self._shown_s + SHOW_S and sys.stdout.isatty():
            self._shown_s = now_s
            sys.stdout.write(f"\r{self._out.words()}\x1b[K")
            sys.stdout.flush()


def _run(given: Dict[str, Any]) -> None:
    if not sys.stdin.isatty():
        raise ConfigError("stdin is not a terminal; start the node in one, not in the background")
    teleop = TeleopKeyboard(given)
    rospy.loginfo(HELP)
    with Keyboard() as keyboard:
        teleop.run(keyboard)


main = node("teleop_keyboard", PARAMETERS, _run)
