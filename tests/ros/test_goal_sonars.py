"""`go_to_goal` on a robot whose odometry and sonars begin late or end: what it offers, and when it stands."""

import contextlib
import math
import threading

import pytest
import rospy
from actionlib_msgs.msg import GoalStatusArray
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import MoveBaseActionResult
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range
from tf2_msgs.msg import TFMessage

from mrl_driver.robot.models import SonarMount
from ros1_bridge.navigation.go_to_goal_node import SILENT_S, Ranges
from ros1_bridge.topics.messages import mounts_of
from tests.waiting import wait_until

PERIOD_S = 0.05
ENTERED_S = 0.1  # A call that need not wait is over long before


def test_range_of_a_sonar_counts_until_it_has_been_silent_for_a_while():
    ranges = Ranges()
    ranges.hear("front", math.inf, "sonar_front", 10.0)
    assert ranges.now(10.0 + SILENT_S) == {"front": math.inf}
    assert math.isnan(ranges.now(10.01 + SILENT_S)["front"])


class Intruder(str):
    """A sonar's name that another thread's range interrupts where the ranges are looked at."""

    def __new__(cls, ranges):
        made = super().__new__(cls, "front")
        made.ranges, made.threads = ranges, []
        return made

    def __hash__(self):
        if self.ranges is not None:
            ranges, self.ranges = self.ranges, None
            self.threads = [threading.Thread(target=ranges.hear, args=("left", 1.0, "sonar_left", 10.0))]
            self.threads[0].start()
            self.threads[0].join(ENTERED_S)
        return super().__hash__()


@pytest.mark.parametrize("look", [lambda ranges: ranges.now(10.0), Ranges.frames], ids=["now", "frames"])
def test_range_that_comes_while_the_ranges_are_looked_at_waits(look):
    ranges = Ranges()
    name = Intruder(None)
    ranges.hear(name, 1.0, "sonar_front", 10.0)
    name.ranges = ranges
    assert set(look(ranges)) == {"front"}
    name.threads[0].join()
    assert set(look(ranges)) == {"front", "left"}


class Robot:
    """A robot that stands, with a sonar that always measures the same; `locates` and `hears` say what it publishes, and
    `odom_late_s` and `sonar_late_s` how old its stamps are."""

    def __init__(self, rig, frame, range_m=math.inf):
        self._odom = rospy.Publisher(f"{rig.ns}/odom", Odometry, queue_size=1)
        self._sonar = rospy.Publisher(f"{rig.ns}/sonar/front", Range, queue_size=1)
        self._odometry = Odometry(child_frame_id=f"{rig.name}/base_link")
        self._odometry.header.frame_id = f"{rig.name}/odom"
        self._odometry.pose.pose.orientation.w = 1.0
        self._range = Range(range=range_m)
        self._range.header.frame_id = frame
        self.locates = self.hears = True
        self.odom_late_s = self.sonar_late_s = self.x_m = 0.0
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def _publish(self):
        while not self._end.wait(PERIOD_S):
            self._odometry.pose.pose.position.x = self.x_m
            if self.locates:
                self._odometry.header.stamp = rospy.Time.now() - rospy.Duration(self.odom_late_s)
                self._odom.publish(self._odometry)
            if self.hears:
                self._range.header.stamp = rospy.Time.now() - rospy.Duration(self.sonar_late_s)
                self._sonar.publish(self._range)

    def close(self):
        self._end.set()
        self._thread.join()


@pytest.fixture
def robot(rig):
    mounts = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    places = {"front": SonarMount(0.1, 0.0, 0.0), "back": SonarMount(-0.1, 0.0, 180.0)}
    mounts.publish(TFMessage(mounts_of(f"{rig.name}/base_link", places, rospy.Time.now())))
    robots = []

    def make(frame="sonar_front", range_m=math.inf, patience_s=3):
        robots.append(Robot(rig, f"{rig.name}/{frame}", range_m))
        rig.program("go_to_goal", f"_patience:={patience_s}")
        rig.commands, rig.results = (
            rig.topic("cmd_vel", Twist),
            rig.topic("move_base/result", MoveBaseActionResult),
        )
        for topic in (rig.commands, rig.results):
            topic.wait_for_publisher()
        seek(rig)
        return robots[-1]

    yield make
    for each in robots:
        each.close()
    mounts.unregister()


def seek(rig):
    """Send a goal as rviz does."""
    goal = PoseStamped()
    goal.pose.position.x, goal.pose.orientation.w = 3.0, 1.0
    rig.publisher("move_base_simple/goal", PoseStamped).publish(goal)


def ended_for(rig, why):
    """A goal has ended, and said why."""
    return any(why in each.status.text for each in rig.results.messages)


def test_action_is_offered_after_the_first_odometry(rig):
    """A goal before it could only be refused."""
    node, status = rig.program("go_to_goal"), rig.topic("move_base/status", GoalStatusArray)
    rig.publisher("odom", Odometry)
    wait_until(lambda: any("no odometry on" in line for line in node.output()))
    assert not status.messages
    with contextlib.closing(Robot(rig, f"{rig.name}/sonar_front")):
        status.wait()


@pytest.mark.parametrize(
    "fault, why",
    [
        ({"locates": False}, "odometry has stopped"),
        ({"odom_late_s": 10.0}, "odometry has stopped"),
        ({"x_m": math.nan}, "odometry has stopped"),
        ({"hears": False}, "no valid reading of sonar front"),
        ({"sonar_late_s": 10.0}, "no valid reading of sonar front"),
    ],
    ids=["odometry silent", "odometry late", "odometry not finite", "sonar silent", "sonar late"],
)
def test_robot_stands_when_its_odometry_stops_and_the_goal_is_given_up(rig, robot, fault, why):
    """Or its sonar."""
    fitted = robot()
    wait_until(lambda: any(twist.linear.x > 0 for twist in rig.commands.messages))
    vars(fitted).update(fault)
    wait_until(lambda: rig.commands.messages[-1].linear.x == 0.0)
    wait_until(lambda: ended_for(rig, why))
    wait_until(lambda: rig.commands.messages[-1] == Twist())


def test_sonar_that_looks_back_by_tf_does_not_turn_the_robot(rig, robot):
    """Ahead, 0.58 m would make it go around something."""
    robot(frame="sonar_back", range_m=0.58, patience_s=300)
    seen = rig.commands.wait_for_more(20)
    assert all(twist.linear.x > 0 and twist.angular.z == 0 for twist in seen)


def test_sonar_without_a_place_on_the_robot_holds_it(rig, robot):
    robot(frame="nowhere")
    wait_until(lambda: ended_for(rig, "no valid reading of sonar front"))
