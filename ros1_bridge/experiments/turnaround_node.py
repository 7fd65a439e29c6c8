"""The node that measures the delay between a board and a topic, in both directions.

An emulated board in its own process logs the bytes at its port with their times.  This node records when it published
each command, and when each Odometry message came.
"""

import time
from typing import Dict, List

import rospy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from mrl_driver.errors import MrlError
from ros1_bridge.demo.processes import wait_until
from sim_arduino.experiments import turnaround
from sim_arduino.experiments.experiment_report import Result
from sim_arduino.experiments.experiment_robot import Setting
from sim_arduino.experiments.turnaround import Topics

from .experiment_processes import START_S, Parts
from .wire_log import command_s, commanded, odometry_s, read, sent

SPACE = "robot"
RATE_HZ, MESSAGES = 50, 200
FASTEST_MM_S = 300
RAMP_S, TICK_S = 1.5, 0.05
"""The robot reaches its speed within the ramp time; later, slower commands are not limited."""
SETTLE_S = 0.3


class Timed:
    """Times of published commands, and of odometry received meanwhile [s, monotonic]."""

    def __init__(self, parts: Parts) -> None:
        self.arrived: List[float] = []
        self.published: Dict[int, float] = {}
        rospy.Subscriber(f"/{SPACE}/odom", Odometry, self._take, tcp_nodelay=True)
        self._cmd_vel = rospy.Publisher(f"/{SPACE}/cmd_vel", Twist, queue_size=10, tcp_nodelay=True)
        if not wait_until(lambda: self._ready(parts), START_S):
            raise MrlError(f"no odometry after {START_S:g} s; see what robot_node says of the port")

    def _ready(self, parts: Parts) -> bool:
        parts.check()
        return bool(self.arrived) and self._cmd_vel.get_num_connections() > 0

    def _take(self, _: Odometry) -> None:
        self.arrived.append(time.monotonic())

    def run(self, messages: int) -> None:
        """Reach full speed, then send the commands; each is slower than the last, and so can be identified."""
        for _ in range(round(RAMP_S / TICK_S)):
            self._cmd_vel.publish(_twist(FASTEST_MM_S))
            time.sleep(TICK_S)
        self.arrived.clear()
        for speed_mm_s in range(FASTEST_MM_S - 1, FASTEST_MM_S - 1 - messages, -1):
            self.published[speed_mm_s] = time.monotonic()
            self._cmd_vel.publish(_twist(speed_mm_s))
            time.sleep(1.0 / RATE_HZ)
        time.sleep(SETTLE_S)


def _twist(speed_mm_s: int) -> Twist:
    return Twist(Vector3(speed_mm_s / 1000, 0, 0), Vector3())


def measure(parts: Parts, robot: str, messages: int = MESSAGES) -> Topics:
    """Drives an emulated board through topics, and measures the delays of the messages [ms].

    Raises:
        MrlError: a part has failed.
    """
    log, truth = parts.folder / "wire.json", parts.folder / "truth.json"
    options = ("--robot", robot, "--world", "square", "--log", str(log), "--truth", str(truth))
    parts.robot(SPACE, parts.board(SPACE, *options), robot, RATE_HZ)
    timed = Timed(parts)
    timed.run(messages)
    rows = read(log, truth)
    return Topics(
        1000 * odometry_s(sent(rows), timed.arrived),
        1000 * command_s(timed.published, commanded(rows, min(timed.published.values()))),
    )


def play(_: str, parts: Parts, setting: Setting) -> Result:
    """Measures the delays through ROS, in the driver's default mode, then those on the simulated chip."""
    topics = measure(parts, setting.robot)
    parts.close()
    return turnaround.run(setting, topics)
