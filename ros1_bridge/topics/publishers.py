"""The topics of the node: one message and one publisher each.  The node supplies the publisher class."""

import math
import time
from types import SimpleNamespace
from typing import Any, Callable, Dict, List, Mapping, Optional, Tuple, Type, Union

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from genpy import Time
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, JointState, Range, Temperature
from std_msgs.msg import Bool, Header, String
from tf2_msgs.msg import TFMessage

from mrl_driver.driver import Telemetry
from mrl_driver.geometry import ORIGIN, Pose, advance
from mrl_driver.robot.kinematics import kinematics_of
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.models.drives import metres_per_count
from mrl_driver.session.handshake import Board
from ros1_bridge.node.robot_parameters import Parameters
from ros1_bridge.node.tf_names import (
    footprint_frame,
    imu_frame,
    joints_of,
    servo_joint,
    sonar_frame,
    wheel_radius_m,
)

from . import messages
from .fast_publisher import Fast, direct_publisher
from .imu_topics import ImuTopics
from .serialized_messages import PackedJoints, PackedOdometry, PackedRange, PackedTransform
from .typed_messages import numbers, typed

STEP_S = 1e-6
"""Smallest difference of two stamps; four times the resolution of a float with today's time in seconds."""
TOLERANCE_S = 1e-4
"""The difference of the two clocks stays the same until it is off by more than this in two readings [s]: a thread may
pause between the clocks.
"""
GAP_PERIODS = 2.5
"""After a longer gap, a message that is a period younger than the last has the speeds of the next one, which are means
over the gap: a filter that integrates twists then follows the pose.  Gaps of `JUMP_S` and longer stay gaps.
"""
JUMP_S = 1.0  # If the clock goes back further than this, it was set on purpose, and the stamps follow it
LATCHED = {
    "battery_state": BatteryState,
    "board_temperature": Temperature,
    "status": DiagnosticStatus,
    "mode": String,
    "moving": Bool,
    "safety_stop": Bool,
}
FIELD_TOPICS = ("warning_field_clear", "outer_warning_field_clear", "protective_field_clear")
"""Latched topics of a robot with zones."""


def _stamp_of(wall_s: float) -> Tuple[int, int]:
    """Seconds and nanoseconds."""
    secs = int(wall_s)
    return secs, int((wall_s - secs) * 1e9)


class Unpublished:
    """Replaces a topic if its part is switched off."""

    impl = SimpleNamespace(connections=())
    sequence = 0

    def send(self, data: bytes) -> None:
        """Never called."""

    def publish(self, message: Any) -> None:
        """Do nothing."""


class Publishers:
    """Topics that every board has, `/tf` included.

    A board without motors has none of those about motion and battery, and motors without encoders have no odometry.
    """

    def __init__(
        self,
        publisher_class: Callable[..., Any],
        lost: Type[Exception],
        parameters: Parameters,
        model: RobotModel,
        clock: Callable[[], float] = time.time,
        monotonic: Callable[[], float] = time.monotonic,
        note_clock: Callable[[float], None] = lambda ahead_s: None,
    ) -> None:
        """`lost`: rospy's exception for a broken connection; `clock`: the clock of the stamps [s]; `monotonic`: that of
        the telemetry [s].  `note_clock` is called with the difference of the two when it changes [s].
        """
        odom, base = parameters.odom_frame, parameters.base_frame
        self._class, self._lost = publisher_class, lost
        self._model, self._parameters = model, parameters
        self.clear_range_m = parameters.clear_range
        """The parameter `clear_range`; it may be changed at any time."""
        self._clock, self._monotonic = clock, monotonic
        self._ahead_s = -math.inf
        self._note_clock = note_clock
        self._least_s, self._period_s = 0.0, 1.0 / parameters.rate
        self._former: Optional[Telemetry] = None
        self._odometry_out: Union[Fast, Unpublished] = Unpublished()
        self._joints_out: Union[Fast, Unpublished] = Unpublished()
        self._counts_out: Union[Fast, Unpublished] = Unpublished()
        self._transform_out: Union[Fast, Unpublished, None] = None
        if model.has_odometry:
            self._add_wheels(odom, base)
        joined = model.has_odometry or not model.servos
        self._servos_out = self._joints_out if joined else self._sender("joint_states", JointState)
        servos = model.servos if typed("Servo") else ()
        self._servo_outs = {name: self._sender(f"servo/{name}/state", typed("Servo")) for name in servos}
        self._ranges = {
            name: PackedRange(sonar_frame(base, name), mount.kind) for name, mount in model.sonars.items()
        }
        self._ranges_out: Dict[str, Fast] = {}
        self._mounts: List[TransformStamped] = []
        self._mounts_out: Any = None
        with_status, kinds = parameters.has("status") and model.drives, dict(LATCHED)
        kinds["robot_status"] = typed("RobotStatus") or DiagnosticArray
        if parameters.zones != "none":
            kinds.update(dict.fromkeys(FIELD_TOPICS, Bool))
        self._latched = {
            name: direct_publisher(publisher_class, name, kind, latch=True) if with_status else Unpublished()
            for name, kind in kinds.items()
        }

    def _add_wheels(self, odom: str, base: str) -> None:
        """Advertise what the wheels tell."""
        model, drive = self._model, self._model.base
        joints, kinematics = joints_of(drive), kinematics_of(drive)
        self._joint_names = list(joints)
        self._odometry, self._odometry_out = PackedOdometry(odom, base), self._sender("odom", Odometry)
        self._transform = PackedTransform(odom, base)
        self._transform_out = self._sender("/tf", TFMessage) if self._parameters.publish_tf else None
        self._joints = PackedJoints(joints)
        self._joints_out = self._sender("joint_states", JointState)
        self._counts_out = self._sender("encoders", typed("WheelCounts") or JointState)
        counts_a_turn = model.board["gearbox"] / 10 * model.board["encoder_counts"] / 10
        self._rad_per_count = 2 * math.pi / counts_a_turn
        rows = dict(zip(kinematics.wheels, kinematics.rows))
        names = [joint[: -len("_wheel_joint")] for joint in joints]
        self._joint_rows = [
            tuple(self._rad_per_count / scale * each for each in rows[name])
            for name, scale in zip(names, metres_per_count(drive, names))
        ]

    def _sender(self, topic: str, kind: type) -> Union[Fast, Unpublished]:
        """A publisher for a topic of the part odometry."""
        return self._fast(topic, kind) if self._parameters.has("odometry") else Unpublished()

    def _fast(self, topic: str, kind: type) -> Fast:
        return Fast(direct_publisher(self._class, topic, kind), self._lost)

    def sonars(self, now: Time) -> None:
        """Advertise the sonars, and publish their mounts; for boards that have sonars."""
        base, model = self._parameters.base_frame, self._model
        self._ranges_out = {name: self._fast(f"sonar/{name}", Range) for name in model.sonars}
        if self._parameters.publish_mounts:
            self.mounts(*messages.mounts_of(base, model.sonars, now))

    def footprint(self, now: Time) -> None:
        """Publish the frame below `base_frame` on the floor, for programs that want a robot's pose there."""
        base = self._parameters.base_frame
        self.mounts(
            messages.transform_of(base, footprint_frame(base), ORIGIN, -wheel_radius_m(self._model), now)
        )

    def imu(self, now: Time) -> ImuTopics:
        """Advertise the IMU's topics, and publish its mount; for boards that have an IMU."""
        base, mount = self._parameters.base_frame, self._model.imu
        if self._parameters.publish_imu_mount:
            place = Pose(mount.x_m, mount.y_m, 0.0)  # the axes are parallel: readings arrive already rotated
            self.mounts(messages.transform_of(base, imu_frame(base), place, mount.z_m, now))
        return ImuTopics(self._fast, imu_frame(base), mount, lambda: self._ahead_s)

    def servos(self, angles: Mapping[str, float], now: Time) -> None:
        """Publish the joints of the servos whose angles [rad] are known; on the thread of the telemetry."""
        if angles and self._servos_out.impl.connections:
            joints = [servo_joint(name) for name in angles]
            self._servos_out.publish(JointState(Header(0, now, ""), joints, list(angles.values()), [], []))
        made = typed("Servo")
        for name, out in self._servo_outs.items():
            if name in angles:
                mount = self._model.servos[name]
                out.publish(made(Header(0, now, ""), angles[name], mount.low_rad, mount.high_rad))

    def mounts(self, *more: TransformStamped) -> None:
        """Publish static transforms, together with those of before: a latched topic keeps only its last message."""
        if self._mounts_out is None:
            self._mounts_out = direct_publisher(self._class, "/tf_static", TFMessage, latch=True)
        self._mounts += more
        self._mounts_out.publish(TFMessage(list(self._mounts)))

    def telemetry(self, telemetry: Telemetry) -> None:
        """Publish pose, twist, wheels, and the sonars with a new reading."""
        stamp_s, _, (x_m, y_m, yaw_rad), twist, _, fresh, *_, spread, variances = telemetry
        former, self._former = self._former, telemetry
        ahead_s = self._clock() - self._monotonic()
        if not -TOLERANCE_S < ahead_s - self._ahead_s < TOLERANCE_S:
            self._follow(ahead_s)
        wall_s = max(0.0, self._ahead_s + stamp_s)  # simulated time begins at 0
        if self._least_s - JUMP_S < wall_s < self._least_s:
            wall_s = self._least_s
        if former is not None and GAP_PERIODS * self._period_s < wall_s - self._least_s < JUMP_S:
            self._tell_speeds_of_gap(former, telemetry)
        self._least_s = wall_s + STEP_S
        secs, nsecs = _stamp_of(wall_s)
        z, w = math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)  # as `geometry.quaternion_of`, without a call
        out = self._odometry_out
        if out.impl.connections:
            out.send(self._odometry.pack(out.sequence, secs, nsecs, x_m, y_m, z, w, spread, twist, variances))
        tf_out = self._transform_out
        if tf_out is not None and tf_out.impl.connections:
            tf_out.send(self._transform.pack(secs, nsecs, x_m, y_m, z, w))
        if self._joints_out.impl.connections:
            self._publish_joints(telemetry, secs, nsecs)
        if self._counts_out.impl.connections:
            self._publish_counts(telemetry, secs, nsecs)
        for name in fresh:
            range_out = self._ranges_out.get(name)
            if range_out is not None and range_out.impl.connections:
                range_m, pack = telemetry.ranges[name], self._ranges[name].pack
                range_out.send(pack(range_out.sequence, secs, nsecs, range_m, self.clear_range_m))

    def _tell_speeds_of_gap(self, former: Telemetry, telemetry: Telemetry) -> None:
        out, twist, period_s = self._odometry_out, telemetry.twist, self._period_s
        if out.impl.connections:
            secs, nsecs = _stamp_of(self._least_s - STEP_S + period_s)
            steps = twist.linear_m_s * period_s, twist.angular_rad_s * period_s, twist.lateral_m_s * period_s
            x_m, y_m, yaw_rad = advance(former.pose, *steps)
            z, w = math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)
            sure = former.spread, twist, telemetry.twist_variances
            out.send(self._odometry.pack(out.sequence, secs, nsecs, x_m, y_m, z, w, *sure))

    def _follow(self, ahead_s: float) -> None:
        """The clock of the stamps was set, or this thread paused between the two clocks, which makes it too small."""
        ahead_s = max(ahead_s, self._clock() - self._monotonic())
        if not -TOLERANCE_S < ahead_s - self._ahead_s < TOLERANCE_S:
            self._ahead_s = ahead_s
            self._note_clock(ahead_s)

    def _publish_counts(self, telemetry: Telemetry, secs: int, nsecs: int) -> None:
        header, made = Header(0, Time(secs, nsecs), ""), typed("WheelCounts")
        counts = self._joint_names, telemetry.counts
        self._counts_out.publish(made(header, *counts) if made else JointState(header, *counts, [], []))

    def _publish_joints(self, telemetry: Telemetry, secs: int, nsecs: int) -> None:
        twist, out, rad_per_count = telemetry.twist, self._joints_out, self._rad_per_count
        linear, lateral, angular = twist.linear_m_s, twist.lateral_m_s, twist.angular_rad_s
        positions = [count * rad_per_count for count in telemetry.counts]
        velocities = [x * linear + y * lateral + t * angular for x, y, t in self._joint_rows]
        out.send(self._joints.pack(out.sequence, secs, nsecs, positions, velocities))

    def battery(self, board: Board, now: Time) -> None:
        """Publish the battery and the motor board's temperature."""
        base = self._parameters.base_frame
        battery = messages.battery_state(base, now, board.battery_v, self._model.battery)
        self._latched["battery_state"].publish(battery)
        warm = Temperature(Header(0, now, base), board.temperature_c, 0.0)  # a variance of 0 is unknown
        self._latched["board_temperature"].publish(warm)

    def status(self, status: DiagnosticStatus, values: Mapping[str, Any], fields: Mapping[str, Any]) -> None:
        """Publish the robot's state; `values` are those of its topics that have changed, `fields` of `RobotStatus`."""
        self._latched["status"].publish(status)
        header, made = Header(stamp=Time.from_sec(self._clock())), typed("RobotStatus")
        self._latched["robot_status"].publish(
            made(header=header, **numbers("RobotStatus", fields))
            if made
            else DiagnosticArray(header, [status])
        )
        for topic, value in values.items():
            self._latched[topic].publish(value)
