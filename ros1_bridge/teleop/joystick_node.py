"""ROS node `teleop_joystick`: converts sensor_msgs/Joy on `joy` to `cmd_vel` while the dead-man button is held.

When the button is released, or the joystick is lost, the node sends one stop and then nothing, so that other nodes can
drive.  If the joystick falls silent, the command timeout of the robot stops it.
"""

import time
from typing import Any, Dict

import rospy
from sensor_msgs.msg import Joy

from mrl_driver.clocks import clock_s
from mrl_driver.safety.operator_delay import Lateness
from ros1_bridge.node.cmd_vel import DELAY_ROW, OperatorCmdVel, twist_of
from ros1_bridge.node.parameters import Row, speed_rows
from ros1_bridge.node.run_node import node

from .joystick_mapping import LAYOUTS, Joystick

CLOCK_STEP_S = 10.0  # if a message seems to be later than this, a clock was set [s]
PARAMETERS = (
    Row("layout", str, "ps3", "", "Which button does what", choices=tuple(LAYOUTS)),
    *speed_rows("Speed at full deflection", "Yaw rate at full deflection"),
    DELAY_ROW,
)
"""The node's private parameters."""


class TeleopJoystick:
    """Publishes the commands of one joystick."""

    def __init__(self, given: Dict[str, Any]) -> None:
        self._joystick, self._told = Joystick(LAYOUTS[given["layout"]]), ""
        self._linear_m_s, self._angular_rad_s = given["linear_speed"], given["angular_speed"]
        self._out = OperatorCmdVel(given["max_delay"])
        self._lateness = Lateness()
        rospy.Subscriber("joy", Joy, self._on_joy, queue_size=1, tcp_nodelay=True)

    def run(self) -> None:
        """Drive until the shutdown."""
        rospy.spin()

    def _on_joy(self, message: Joy) -> None:
        stamp_s = message.header.stamp.to_sec()
        input_s = clock_s() - self._late_s(stamp_s)
        shares = self._joystick.shares(message.axes, message.buttons, stamp_s, time.monotonic())
        self._tell()
        twist = shares and twist_of(shares[0] * self._linear_m_s, shares[1] * self._angular_rad_s)
        self._out.hold(twist, input_s)

    def _late_s(self, stamp_s: float) -> float:
        """How much later than the fastest the message has come from the joystick's node [s]."""
        if not stamp_s or not rospy.rostime.is_wallclock():
            return 0.0
        late_s = self._lateness.of(stamp_s, time.time())
        if late_s > CLOCK_STEP_S:  # this message may be as late as it seems, so it does not drive
            self._lateness = Lateness()
        return late_s

    def _tell(self) -> None:
        """Log once why a held button does not drive."""
        trouble = self._joystick.trouble
        if trouble and trouble != self._told:
            rospy.logwarn(f"{trouble}; then release the dead-man button and press it again")
        self._told = trouble


main = node("teleop_joystick", PARAMETERS, lambda given: TeleopJoystick(given).run())
