"""Fills ROS messages from driver values.  Plain functions: no node, no clock, no robot maths.
`serialized_messages` has the messages that are published with frames.
"""

import math
from typing import List, Mapping, Optional, Tuple

from genpy import Time
from geometry_msgs.msg import Transform, TransformStamped, Twist
from sensor_msgs.msg import BatteryState, Range
from std_msgs.msg import Header

from mrl_driver.geometry import Pose, quaternion_of
from mrl_driver.robot.models import Battery, SonarMount
from ros1_bridge.node.tf_names import SONAR_HEIGHT_M, sonar_frame


def transform_of(
    parent: str, child: str, pose: Pose, z_m: float = 0.0, stamp: Optional[Time] = None
) -> TransformStamped:
    """The transform from `parent` to a frame at a pose and a height [m]."""
    transform = TransformStamped(Header(0, stamp, parent), child, Transform())
    translation, rotation = transform.transform.translation, transform.transform.rotation
    translation.x, translation.y, translation.z = pose.x_m, pose.y_m, z_m
    rotation.z, rotation.w = quaternion_of(pose.yaw_rad)
    return transform


def mounts_of(base_frame: str, sonars: Mapping[str, SonarMount], stamp: Time) -> List[TransformStamped]:
    """Static transforms from `base_frame` to each sonar, x along its beam."""
    return [
        transform_of(base_frame, sonar_frame(base_frame, name), mount.pose, SONAR_HEIGHT_M, stamp)
        for name, mount in sonars.items()
    ]


def battery_state(frame: str, stamp: Time, voltage_v: float, battery: Battery) -> BatteryState:
    """A message for a NiMH battery; values that the board does not measure are NaN or unknown.

    The percentage is linear between empty and full, 0 to 1.  If the voltage [V] is NaN, it is not measured: the
    percentage is NaN as well, and the health is unknown.
    """
    message = BatteryState(current=math.nan, charge=math.nan, capacity=math.nan, percentage=math.nan)
    message.header.frame_id, message.header.stamp = frame, stamp
    message.voltage, message.design_capacity = voltage_v, battery.capacity_ah
    message.power_supply_technology = BatteryState.POWER_SUPPLY_TECHNOLOGY_NIMH
    message.power_supply_status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    if hasattr(message, "temperature"):  # Noetic has the field, older releases of the message do not
        message.temperature = math.nan
    message.present = not voltage_v < battery.off_v
    if not math.isnan(voltage_v):
        message.percentage = min(1.0, max(0.0, battery.charge(voltage_v)))
        dead, good = BatteryState.POWER_SUPPLY_HEALTH_DEAD, BatteryState.POWER_SUPPLY_HEALTH_GOOD
        message.power_supply_health = dead if voltage_v < battery.empty_v else good
    return message


def range_of(message: Range) -> float:
    """The range of a sonar [m] (REP 117): +Inf also at max_range, which says that nothing is closer."""
    return math.inf if 0.0 < message.max_range <= message.range else message.range


def field_not_finite(message: Twist) -> str:
    """Say which of the six fields of a command is NaN or infinite; empty if none is."""
    for part in ("linear", "angular"):
        for axis in "xyz":
            value = getattr(getattr(message, part), axis)
            if not math.isfinite(value):
                return f"cmd_vel {part}.{axis} is {value}, expected a finite number"
    return ""


def unused_axes(message: Twist, sideways: bool = False) -> Tuple[str, ...]:
    """Names of the nonzero fields that the drive cannot follow; `sideways`: the drive can follow linear.y."""
    linear, angular = message.linear, message.angular
    if not ((linear.y and not sideways) or linear.z or angular.x or angular.y):
        return ()
    fields = {"linear.y": linear.y, "linear.z": linear.z, "angular.x": angular.x, "angular.y": angular.y}
    return tuple(name for name, value in fields.items() if value and not (sideways and name == "linear.y"))
