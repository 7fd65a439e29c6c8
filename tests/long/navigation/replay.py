"""Replays odometry to the real ekf_localization_node in simulated time.  Imports ROS, and robot_localization."""

import struct
import threading
import time
from typing import Any, Iterable, Tuple

import rospy
from genpy import Time
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import Odometry
from robot_localization.srv import SetPose
from rosgraph_msgs.msg import Clock

from mrl_driver.geometry import ORIGIN, Pose
from mrl_driver.robot import models
from mrl_driver.robot.covariance import AT_START, Spread
from mrl_driver.robot.robot_state import Telemetry
from ros1_bridge.node.plane_poses import planar, write_pose
from ros1_bridge.node.robot_parameters import check
from ros1_bridge.topics.message_covariance import pose_matrix, spread_of
from ros1_bridge.topics.publishers import Publishers
from tests.driver.test_covariance import PERIOD_S

from .stack import LAUNCH, START_S, Master, StackError

LATE_S = 0.002  # a message reaches the filter so long after its stamp
WINDOW = 5
"""So many messages come before the filter takes them, as on a busy computer: half of odom0_queue_size."""
PATIENCE_S = 0.1
"""The filter answers within this time."""
GAP_S, SILENCE_S = 0.1, 0.01
"""In a gap, the filter predicts after this time, and has so long to answer."""
ORDER_S = 0.001
"""Messages and /clock have connections of their own; the messages have this start."""
BETWEEN_S = 10  # between two robots


class Replay:
    """Publishes what a robot measured, in simulated time; this node's own time stays that of the machine."""

    def __init__(self, robot: str, **parameters: Any) -> None:
        """`parameters`: those of robot_node that differ from their defaults."""
        if not rospy.core.is_initialized():
            rospy.init_node("replay", disable_signals=True)
        rospy.set_param("/use_sim_time", True)
        self._now_s = 0.0
        self._clock = rospy.Publisher("/clock", Clock, queue_size=1, tcp_nodelay=True)
        given = check({"port": "none", **parameters}, "replay")
        model, clocks = models.load(robot), (lambda: self._now_s,) * 2
        self._publishers = Publishers(rospy.Publisher, rospy.ROSException, given, model, *clocks)
        self._answered = threading.Event()
        self._answer = b""
        self._answer_stamp = self._awaited = Time()

    def _tick(self, patience_s: float) -> None:
        """Time goes on; wait so long for an answer [s].  It goes on once more if /clock has overtaken a message."""
        self._answered.clear()
        for late_s in (LATE_S, LATE_S + PERIOD_S, LATE_S + 2 * PERIOD_S):
            self._clock.publish(Clock(stamp_of(self._now_s + late_s)))
            if self._answered.wait(patience_s):
                return

    def _on_answer(self, message: rospy.AnyMsg) -> None:
        """A message with a header."""
        self._answer = message._buff
        _, *stamp = struct.unpack_from("<3I", self._answer)
        self._answer_stamp = Time(*stamp)
        if self._answer_stamp >= self._awaited:
            self._answered.set()


class Filter(Replay):
    """The node of ekf.launch for one kind of robots, and what publishes their odometry; a context manager.

    Messages of the odometry and /clock follow each other, and then comes the filter's answer.
    """

    def __init__(self, master: Master, robot: str, gyro: bool) -> None:
        super().__init__(robot, publish_tf=False)
        self._master = master
        self._arguments = (f"robot:={robot}", f"gyro:={str(gyro).lower()}")
        self._answers = rospy.Subscriber("odometry/filtered", rospy.AnyMsg, self._on_answer, tcp_nodelay=True)

    def __enter__(self) -> "Filter":
        command = ("roslaunch", str(LAUNCH / "ekf.launch"), *self._arguments)
        self._node = self._master.start("ekf", *command)
        self._master.require(self._ticking, self._node)
        rospy.wait_for_service("set_pose", START_S)
        return self

    def _ticking(self) -> bool:
        """Time goes on until the filter can hear and be heard."""
        self._now_s += PERIOD_S
        self._tick(SILENCE_S)
        return self._answers.get_num_connections() > 0

    def __exit__(self, *_: Any) -> None:
        self._master.end(self._node)

    def replay(self, messages: Iterable[Telemetry]) -> Tuple[Pose, Spread]:
        """The filter's pose and its covariance after the last message, of a robot that begins at the origin."""
        self._begin()
        start_s = self._now_s
        for number, message in enumerate(messages, 1):
            while self._now_s - start_s < message.stamp_s - GAP_S:
                self._now_s += GAP_S
                self._tick(SILENCE_S)
            self._now_s = start_s + message.stamp_s
            self._publishers.telemetry(message._replace(stamp_s=self._now_s))
            self._awaited = stamp_of(self._now_s - PERIOD_S / 2)
            if number % WINDOW == 0:
                time.sleep(ORDER_S)
                self._tick(PATIENCE_S)
        self._tick(PATIENCE_S)
        if self._answer_stamp < self._awaited:
            raise StackError(f"the filter has not answered to the last message, see {self._node.log}")
        pose = Odometry().deserialize(self._answer).pose
        return planar(pose.pose), spread_of(pose.covariance)

    def _begin(self) -> None:
        self._now_s = BETWEEN_S * (self._now_s // BETWEEN_S + 2)
        self._tick(SILENCE_S)
        start = PoseWithCovarianceStamped()
        start.header.frame_id, start.header.stamp = "odom", stamp_of(self._now_s)
        write_pose(ORIGIN, start.pose.pose)
        start.pose.covariance = pose_matrix(AT_START)
        rospy.ServiceProxy("set_pose", SetPose)(start)


def stamp_of(time_s: float) -> Time:
    """To the millisecond, so that periods are equal."""
    return Time(0, round(1000 * time_s) * 1000000)
