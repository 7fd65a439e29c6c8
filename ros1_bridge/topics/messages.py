"""Fills ROS messages from driver values.  Plain functions: no node, no clock, no robot maths.

One message per topic is made once and filled again for each publication.  `serialized_messages` has the messages
that are published with every frame.
"""

import math
from typing import List, Mapping, Sequence, Tuple

from genpy import Time
from geometry_msgs.msg import TransformStamped, Twist
from sensor_msgs.msg import BatteryState, JointState, Range, Temperature
from tf2_msgs.msg import TFMessage

from mrl_driver.geometry import Pose, quaternion_of
from mrl_driver.robot.models import Battery, ImuMount, SonarMount
from mrl_driver.robot.sonar import FARTHEST_M, FIELD_OF_VIEW_RAD, NEAREST_M
from ros1_bridge.node.tf_names import JOINTS, SONAR_HEIGHT_M, imu_frame, sonar_frame


def new_transform(odom_frame: str, base_frame: str) -> TFMessage:
    """A message for /tf with one transform from odom_frame to base_frame."""
    return TFMessage([_transform(odom_frame, base_frame)])


def fill_transform(message: TFMessage, stamp: Time, pose: Pose) -> None:
    """Write a pose into a message of `new_transform`."""
    transform = message.transforms[0]
    transform.header.stamp = stamp
    translation, rotation = transform.transform.translation, transform.transform.rotation
    translation.x, translation.y, yaw = pose
    rotation.z, rotation.w = quaternion_of(yaw)


def new_mounts(base_frame: str, sonars: Mapping[str, SonarMount], stamp: Time) -> TFMessage:
    """Static transforms from `base_frame` to each sonar, x along its beam."""
    message = TFMessage()
    for name, mount in sonars.items():
        transform = _transform(base_frame, sonar_frame(base_frame, name), *mount.pose, SONAR_HEIGHT_M)
        transform.header.stamp = stamp
        message.transforms.append(transform)
    return message


def new_imu_mount(base_frame: str, mount: ImuMount, stamp: Time) -> TFMessage:
    """The static transform from `base_frame` to the IMU, whose axes are parallel: readings arrive already rotated."""
    transform = _transform(base_frame, imu_frame(base_frame), mount.x_m, mount.y_m, z_m=mount.z_m)
    transform.header.stamp = stamp
    return TFMessage([transform])


def new_range(base_frame: str, sonar: str) -> Range:
    """A Range message of an ultrasonic sonar in its own frame."""
    message = Range(radiation_type=Range.ULTRASOUND, field_of_view=FIELD_OF_VIEW_RAD)
    message.header.frame_id = sonar_frame(base_frame, sonar)
    message.min_range, message.max_range = NEAREST_M, FARTHEST_M
    return message


def fill_range(message: Range, stamp: Time, range_m: float, clear_m: float = 0.0) -> None:
    """Write a range [m]: -inf is too near, NaN is invalid, +inf is nothing in range (REP-117).

    With `clear_m`, that is the longest range, and what is farther reads as it: some costmap layers clear only then.
    """
    message.header.stamp = stamp
    message.max_range = clear_m or FARTHEST_M
    message.range = clear_m if 0 < clear_m < range_m else range_m


def new_joints(names: Sequence[str] = JOINTS) -> JointState:
    """A message for the wheels' state; effort is not measured."""
    return JointState(name=list(names))


def fill_joints(message: JointState, stamp: Time, angles: List[float], rates: List[float]) -> None:
    """Write the wheels' angles [rad] and rates [rad/s]."""
    message.header.stamp = stamp
    message.position, message.velocity = angles, rates


def new_temperature(base_frame: str) -> Temperature:
    """A message for the motor board's temperature; its variance is unknown."""
    message = Temperature(temperature=math.nan)
    message.header.frame_id = base_frame
    return message


def fill_temperature(message: Temperature, stamp: Time, temperature_c: float) -> None:
    """Write a temperature [degC]."""
    message.header.stamp = stamp
    message.temperature = temperature_c


def new_battery(base_frame: str, battery: Battery) -> BatteryState:
    """A message for a NiMH battery; values that the board does not measure are NaN or unknown."""
    message = BatteryState(current=math.nan, charge=math.nan, capacity=math.nan, percentage=math.nan)
    message.header.frame_id = base_frame
    message.voltage = math.nan
    message.design_capacity = battery.capacity_ah
    message.power_supply_technology = BatteryState.POWER_SUPPLY_TECHNOLOGY_NIMH
    message.power_supply_status = BatteryState.POWER_SUPPLY_STATUS_DISCHARGING
    if hasattr(message, "temperature"):  # Noetic has the field, older releases of the message do not
        message.temperature = math.nan
    return message


def fill_battery(message: BatteryState, stamp: Time, voltage_v: float, battery: Battery) -> None:
    """Write a voltage [V]; the percentage is linear between empty and full, 0 to 1.

    If the voltage is NaN, it is not measured: the percentage is NaN as well, and the health is unknown.
    """
    message.header.stamp = stamp
    message.voltage = voltage_v
    if math.isnan(voltage_v):
        message.present, message.percentage = True, math.nan
        message.power_supply_health = BatteryState.POWER_SUPPLY_HEALTH_UNKNOWN
        return
    message.present = voltage_v >= battery.off_v
    share = battery.charge(voltage_v)
    message.percentage = min(1.0, max(0.0, share))
    dead = voltage_v < battery.empty_v
    message.power_supply_health = (
        BatteryState.POWER_SUPPLY_HEALTH_DEAD if dead else BatteryState.POWER_SUPPLY_HEALTH_GOOD
    )


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


def _transform(
    parent: str, child: str, x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0, z_m: float = 0.0
) -> TransformStamped:
    transform = TransformStamped()
    transform.header.frame_id, transform.child_frame_id = parent, child
    translation, rotation = transform.transform.translation, transform.transform.rotation
    translation.x, translation.y, translation.z = x_m, y_m, z_m
    rotation.z, rotation.w = quaternion_of(yaw_rad)
    return transform
