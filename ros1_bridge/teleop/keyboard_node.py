"""ROS node `teleop_keyboard`: converts keys of the terminal to `cmd_vel`; silent while no key is held."""

import math
import sys
from typing import Any, Dict

import rospy
from geometry_msgs.msg import Twist

from mrl_driver.clocks import clock_s
from mrl_driver.errors import ConfigError
from mrl_driver.terminal.keyboard import Keyboard
from mrl_driver.terminal.teleop_keys import ANGULAR_RAD_S, LINEAR_M_S, Teleop
from ros1_bridge.node.cmd_vel import DELAY_ROW, OperatorCmdVel, twist_of
from ros1_bridge.node.parameters import speed_rows
from ros1_bridge.node.run_node import node

PERIOD_S, SHOW_S = 0.05, 0.2
HELP = "arrow keys or w a s d drive, space stops, q ends"
PARAMETERS = (*speed_rows("Speed forward and back", "Yaw rate", LINEAR_M_S, ANGULAR_RAD_S), DELAY_ROW)
"""The node's private parameters."""


def _run(given: Dict[str, Any]) -> None:
    if not sys.stdin.isatty():
        raise ConfigError("stdin is not a terminal; start the node in one, not in the background")
    out = OperatorCmdVel(given["max_delay"])
    rospy.loginfo(HELP)
    with Keyboard() as keyboard:
        _drive(keyboard, out, given["linear_speed"] / LINEAR_M_S, given["angular_speed"] / ANGULAR_RAD_S)


def _drive(keyboard: Keyboard, out: OperatorCmdVel, linear_share: float, angular_share: float) -> None:
    """Drive until `q` or the shutdown, with these shares of the usual speeds."""
    teleop, shown_s = Teleop(), -math.inf
    while not rospy.is_shutdown():
        keys, input_s = keyboard.read(PERIOD_S), clock_s()
        for key in keys:
            if key in ("q", "escape", "\x03"):
                return
            input_s = keyboard.pressed_s
            teleop.press(key, keyboard.pressed_s)
            if key == "space":
                out.hold(Twist(), input_s)
        now_s = clock_s()
        linear, angular = teleop.command(now_s)
        lateral = teleop.slide(now_s) * linear_share
        twist = twist_of(linear * linear_share, angular * angular_share, lateral)
        out.hold(twist if twist != Twist() else None, input_s)
        if now_s >= shown_s + SHOW_S and sys.stdout.isatty():
            shown_s = now_s
            sys.stdout.write(f"\r{out.words()}\x1b[K")  # the last line of the terminal shows the delay
            sys.stdout.flush()


main = node("teleop_keyboard", PARAMETERS, _run)
