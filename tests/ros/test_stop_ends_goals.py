"""Goals: on a robot whose odometry and sonars begin late or end, and after a stop, which ends them."""

import contextlib
import math
import threading
import time

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus, GoalStatusArray
from geometry_msgs.msg import PoseStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseActionResult, MoveBaseGoal
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Range
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from mrl_driver.robot.models import SonarMount
from ros1_bridge.topics.messages import mounts_of
from tests.waiting import wait_until

from .rig import START_S

PERIOD_S = 0.05


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


MOVE = 11
PAUSE_S = 0.5


@pytest.fixture
def goal_robot(rig):
    """A robot, and the tap on its wire."""
    rig.wire, odom = rig.tap(rig.board().port), rig.topic("odom", Odometry)
    rig.node(rig.wire.port)
    odom.wait()
    return rig


def call(goal_robot, name):
    assert rospy.ServiceProxy(f"{goal_robot.ns}/{name}", Trigger)().success


@pytest.fixture
def client(goal_robot):
    """A client of go_to_goal, which drives the robot to a goal."""
    goal_robot.program("go_to_goal")
    made = actionlib.SimpleActionClient(f"{goal_robot.ns}/move_base", MoveBaseAction)
    assert made.wait_for_server(rospy.Duration(START_S))
    drive(goal_robot, made)
    return made


def drive(goal_robot, client):
    """Send a goal, and wait until the robot drives to it."""
    goal, since_s = PoseStamped(), time.monotonic()
    goal.header.frame_id = f"{goal_robot.name}/odom"
    goal.pose.position.x, goal.pose.orientation.w = 5.0, 1.0
    client.send_goal(MoveBaseGoal(goal))
    goal_robot.wire.wait_for(MOVE, since_s)


def test_stop_ends_the_goal_and_a_new_goal_drives_after_the_release(goal_robot, client):
    call(goal_robot, "stop")
    assert client.wait_for_result(rospy.Duration(START_S)) and client.get_state() == GoalStatus.PREEMPTED
    call(goal_robot, "release_stop")
    time.sleep(2 * PAUSE_S)  # the planner must have been silent
    drive(goal_robot, client)


def test_node_that_starts_ends_the_goals_of_before_and_no_later_ones(rig):
    """As one that respawns; with a server whose goals never end."""
    handles = []

    def take(handle):
        handle.set_accepted()
        handles.append(handle)

    server = actionlib.ActionServer(
        f"{rig.ns}/move_base", MoveBaseAction, take, lambda handle: handle.set_canceled(), auto_start=False
    )
    server.start()
    client = actionlib.ActionClient(f"{rig.ns}/move_base", MoveBaseAction)
    assert client.wait_for_server(rospy.Duration(START_S))
    before = client.send_goal(MoveBaseGoal())
    wait_until(lambda: handles)
    rig.node(rig.board().port)
    wait_until(lambda: before.get_goal_status() == GoalStatus.PREEMPTED)
    client.send_goal(MoveBaseGoal())
    wait_until(lambda: len(handles) == 2)
    rig.topic("odom", Odometry).wait(20)
    assert handles[1].get_goal_status().status == GoalStatus.ACTIVE
