"""ROS node `teleop_joystick`: sensor_msgs/Joy on `joy` to `cmd_vel` while the dead-man button is held.

Let go, it sends one stop and is silent, so that others may drive; a joystick that falls silent ends in the
robot's own command timeout.
"""

import sys
from typing import List, Optional

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import Joy

from .joystick import LAYOUTS, read


class TeleopJoystick:
    """Passes on what one joystick says."""

    def __init__(self) -> None:
        """Reads the private parameters.

        Raises:
            ValueError: a parameter is wrong; the text says which.
        """
        name = rospy.get_param("~layout", "ps3")
        if name not in LAYOUTS:
            raise ValueError(
                f"parameter {rospy.get_name()}/layout is {name!r}, expected one of {', '.join(LAYOUTS)}"
            )
        self._layout = LAYOUTS[name]
        self._linear_m_s = float(rospy.get_param("~linear_speed", 0.25))
        self._angular_rad_s = float(rospy.get_param("~angular_speed", 0.9))
        self._driving = False
        self._out = rospy.Publisher("cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
        rospy.Subscriber("joy", Joy, self._on_joy, queue_size=1, tcp_nodelay=True)

    def _on_joy(self, message: Joy) -> None:
        shares = read(self._layout, message.axes, message.buttons)
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
    rospy.init_node("teleop_joystick", argv=argv or sys.argv)
    try:
        node = TeleopJoystick()
    except ValueError as error:
        rospy.logfatal(str(error))
        return 2
    rospy.spin()
    del node
    return 0
