"""Changes the operation mode of a robot, and announces it: to the multiplexer, and for a respawn of the node.

A respawn also needs the emergency stop and the disabled motors.
"""

import contextlib
from typing import Any, Callable

from std_msgs.msg import Bool

from mrl_driver.errors import MrlError
from mrl_driver.safety.speed_limiter import AUTOMATIC, MANUAL
from ros1_bridge.control.commander import Commander
from ros1_bridge.topics.fast_publisher import direct_publisher

from .services import Answer


class ModeSwitch:
    """The operation mode of one robot; any thread may set it.  `ros` is the module rospy."""

    def __init__(self, commander: Commander, ros: Any) -> None:
        self._commander, self._ros = commander, ros
        self._mode_out = direct_publisher(ros.Publisher, "manual_mode", Bool, latch=True)
        self._mode_out.publish(commander.manual)

    def set(self, manual: bool) -> Answer:
        """Take a mode; the commander cancels all goals, so that no change makes a robot set off by itself."""
        commander, changes, trouble = self._commander, True, ""
        try:
            changes = commander.set_manual(manual)
        except MrlError as error:
            trouble = f", but the robot cannot be reached: {error}"
        announce(lambda: commander.manual, self._mode_out.publish)
        with contextlib.suppress(OSError, self._ros.ROSException):  # without a master there is no respawn
            announce(
                lambda: commander.manual,
                lambda now: self._ros.set_param("~operation_mode", MANUAL if now else AUTOMATIC),
            )
        limits = commander.in_force
        speeds = f"at most {limits.linear_m_s:.3g} m/s and {limits.angular_rad_s:.3g} rad/s"
        goals = "; goals are cancelled" if changes else ""
        return not trouble, f"{MANUAL if manual else AUTOMATIC} mode: {speeds}{goals}{trouble}"


def keep_stops(commander: Commander, ros: Any) -> None:
    """Store for a respawn whether the emergency stop is latched and the motors are enabled.

    A master that hangs delays this, so no answer of a stop may wait for it.
    """
    with contextlib.suppress(OSError, ros.ROSException):  # without a master there is no respawn
        announce(lambda: commander.latched, lambda now: ros.set_param("~emergency_stop", now))
        announce(lambda: commander.enabled, lambda now: ros.set_param("~motors_enabled", now))


def announce(present: Callable[[], bool], tell: Callable[[bool], Any]) -> None:
    """Call `tell` with the present value, again if another thread has changed it meanwhile: the last word is true.

    A lock would let a change wait for another one's call of the master.
    """
    told = None
    while told != present():
        told = present()
        tell(told)
