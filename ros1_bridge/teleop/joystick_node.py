"""ROS node `teleop_joystick`: converts sensor_msgs/Joy on `joy` to `cmd_vel` while the dead-man button is held.

When the button is released, the node sends one stop and then nothing, so that other nodes can drive.  If the joystick
falls silent, the command timeout of the robot stops it.
"""

from typing import List, Optional

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy

from ros1_bridge.node.cmd_vel import CmdVel
from ros1_bridge.node.parameters import Row, read, speed_rows
from ros1_bridge.node.run_node import run_node

from .joystick_mapping import LAYOUTS, shares_of

PARAMETERS = (
    Row("layout", str, "ps3", "", "Which button does what", choices=tuple(LAYOUTS)),
    *speed_rows("Speed at full deflection", "Yaw rate at full deflection"),
)
"""The node's private parameters."""


class TeleopJoystick:
    """Publishes the commands of one joystick."""

    def __init__(self) -> None:
        """Reads the private parameters.

        Raises:
            ConfigError: a parameter is wrong.
        """
        given = read(PARAMETERS, rospy.get_param(rospy.get_name(), {}), rospy.get_name())
        self._layout = LAYOUTS[given["layout"]]
        self._linear_m_s, self._angular_rad_s = given["linear_speed"], given["angular_speed"]
        self._driving = False
        self._out = CmdVel()
        rospy.Subscriber("joy", Joy, self._on_joy, queue_size=1, tcp_nodelay=True)

    def _on_joy(self, message: Joy) -> None:
        shares = shares_of(self._layout, message.axes, message.buttons)
        if shares is None and not self._driving:
            return
        self._driving = shares is not None
        twist = Twist()
        if shares is not None:
            twist.linear.x = shares[0] * self._linear_m_s
            twist.angular.z = shares[1] * self._angular_rad_s
        self._out.publish(twist)


def main(argv: Optional[List[str]] = None) -> int:
    """Run the node; returns the exit code."""
    return run_node("teleop_joystick", _run, argv)


def _run() -> None:
    node = TeleopJoystick()  # noqa: F841 - its subscriber lives as long as the node
    rospy.spin()
