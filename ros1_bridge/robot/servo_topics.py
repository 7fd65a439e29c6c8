"""The servos of the robot's file: a topic with angles for each."""

from functools import partial

import rospy
from std_msgs.msg import Float64

from mrl_driver.driver import Driver
from mrl_driver.errors import MrlError

WARN_EVERY_S = 1.0


def subscribe_servos(driver: Driver) -> None:
    """Subscribe to a topic for each servo, which turns it on rospy's threads."""
    for name in driver.servos.mounts:
        rospy.Subscriber(f"servo/{name}/command", Float64, partial(_turn, driver, name), queue_size=1)


def _turn(driver: Driver, name: str, message: Float64) -> None:
    try:
        driver.servos.move(name, message.data)
    except MrlError as error:
        rospy.logwarn_throttle(WARN_EVERY_S, f"servo/{name}/command: {error}")
