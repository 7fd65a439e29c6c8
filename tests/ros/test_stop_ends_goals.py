"""On an emulated robot: what still drives when a stop was released, a link has come back, a board or node restarted."""

import signal
import threading
import time

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalID, GoalStatus
from geometry_msgs.msg import PoseStamped, Twist, Vector3
from move_base_msgs.msg import MoveBaseAction, MoveBaseGoal
from nav_msgs.msg import Odometry
from std_srvs.srv import Trigger

from tests.waiting import wait_until

from .rig import START_S

MOVE, STOP = 11, 13
PAUSE_S = 0.5
PERIOD_S = 0.05


class Planner:
    """A stand-in for a planner: it sends the same command all the time, whatever happens."""

    def __init__(self, rig):
        self._out = rospy.Publisher(f"{rig.ns}/cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
        self.speed_m_s, self._end = 0.2, threading.Event()
        self._thread = threading.Thread(target=self._publish)
        self._thread.start()

    def _publish(self):
        while not self._end.wait(PERIOD_S):
            if self.speed_m_s is not None:
                self._out.publish(Twist(Vector3(self.speed_m_s, 0, 0), Vector3()))

    def close(self):
        self._end.set()
        self._thread.join()
        self._out.unregister()


@pytest.fixture
def robot(rig):
    """A robot on a board that may be cut off, with all that it is sent."""
    rig.child = rig.board()
    rig.wire, rig.odom = rig.tap(rig.child.port), rig.topic("odom", Odometry)
    rig.cancels = rig.topic("move_base/cancel", GoalID)
    rig.process = rig.node(rig.wire.port)
    rig.odom.wait()
    return rig


@pytest.fixture
def planner(robot):
    made = Planner(robot)
    wait_until(lambda: robot.wire.first(MOVE, 0.0) < float("inf"))
    yield made
    made.close()


def refuses(node):
    """The node has said that it does not follow somebody who goes on sending."""
    return any("cmd_vel refused: its source has sent" in line for line in node.output())


def call(robot, name):
    assert rospy.ServiceProxy(f"{robot.ns}/{name}", Trigger)().success


def moves_nothing(robot, node, since_s):
    """The planner is refused, and has not moved the robot since."""
    wait_until(lambda: refuses(node))
    return robot.wire.first(MOVE, since_s) == float("inf")


def all_cancelled(robot):
    """Wait until all goals are cancelled."""
    wait_until(lambda: GoalID() in robot.cancels.messages)


def test_planner_that_goes_on_publishing_moves_nothing_after_a_stop_until_it_pauses(robot, planner):
    since_s = time.monotonic()
    call(robot, "stop")
    all_cancelled(robot)
    robot.wire.wait_for(STOP, since_s)
    released_s = time.monotonic()
    call(robot, "release_stop")
    assert moves_nothing(robot, robot.process, released_s)
    planner.speed_m_s = None
    time.sleep(PAUSE_S + PERIOD_S)
    planner.speed_m_s = 0.1
    robot.wire.wait_for(MOVE, released_s)


def test_planner_that_goes_on_publishing_moves_nothing_when_the_link_is_back(robot, planner):
    robot.child.child.signal(signal.SIGSTOP)
    try:
        all_cancelled(robot)
        since_s = time.monotonic()
    finally:
        robot.child.child.signal(signal.SIGCONT)
    wait_until(lambda: any("answers again" in line for line in robot.process.output()))
    assert moves_nothing(robot, robot.process, since_s)


@pytest.mark.parametrize("restarted", ["node", "board"])
def test_planner_that_goes_on_publishing_moves_nothing_when_the_other_end_starts_again(rig, restarted):
    fault = ("--fault", "reset:at=6") if restarted == "board" else ()
    rig.wire = rig.tap(rig.board("--robot", "traxbot", *fault).port)
    rig.cancels, odom = rig.topic("move_base/cancel", GoalID), rig.topic("odom", Odometry)
    node = rig.node(rig.wire.port)
    odom.wait()
    planner = Planner(rig)
    try:
        wait_until(lambda: rig.wire.first(MOVE, 0.0) < float("inf"))
        if restarted == "node":
            node.signal(signal.SIGKILL)
            assert node.wait(START_S)
            since_s, node = time.monotonic(), rig.node(rig.wire.port)
        else:
            wait_until(lambda: any("the board has restarted" in line for line in node.output()))
            since_s = time.monotonic()
            all_cancelled(rig)
        assert moves_nothing(rig, node, since_s)
    finally:
        planner.close()


@pytest.fixture
def client(robot):
    """A client of go_to_goal, which drives the robot to a goal."""
    robot.program("go_to_goal")
    made = actionlib.SimpleActionClient(f"{robot.ns}/move_base", MoveBaseAction)
    assert made.wait_for_server(rospy.Duration(START_S))
    drive(robot, made)
    return made


def drive(robot, client):
    """Send a goal, and wait until the robot drives to it."""
    goal, since_s = PoseStamped(), time.monotonic()
    goal.header.frame_id = f"{robot.name}/odom"
    goal.pose.position.x, goal.pose.orientation.w = 5.0, 1.0
    client.send_goal(MoveBaseGoal(goal))
    robot.wire.wait_for(MOVE, since_s)


def test_stop_ends_the_goal_and_a_new_goal_drives_after_the_release(robot, client):
    call(robot, "stop")
    assert client.wait_for_result(rospy.Duration(START_S)) and client.get_state() == GoalStatus.PREEMPTED
    call(robot, "release_stop")
    time.sleep(2 * PAUSE_S)  # the planner must have been silent
    drive(robot, client)


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


def test_wheel_that_does_not_follow_ends_the_goals(rig):
    """A planner's next command of zero would clear the fault, and the one after it drive on."""
    port = rig.board("--robot", "traxbot", "--fault", "wheel_blocked:at=6").port
    rig.cancels, odom = rig.topic("move_base/cancel", GoalID), rig.topic("odom", Odometry)
    rig.node(port)
    odom.wait()
    planner = Planner(rig)
    try:
        all_cancelled(rig)
    finally:
        planner.close()
