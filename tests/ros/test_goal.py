"""Goals: the seeker on a point that moves as it is told, and the node on an emulated robot."""

import math
import signal

import actionlib
import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseArray, PoseStamped, Quaternion, Twist
from hypothesis import given, settings
from hypothesis import strategies as st
from move_base_msgs.msg import MoveBaseAction, MoveBaseActionResult, MoveBaseGoal
from nav_msgs.msg import Odometry, Path
from std_srvs.srv import SetBool, Trigger

from mrl_driver.geometry import Pose, advance
from mrl_driver.navigation import goal_seeker
from mrl_driver.navigation.goal_seeker import GoalSeeker
from mrl_driver.robot import models
from mrl_driver.robot.models import Limits
from ros1_bridge.navigation.go_to_goal_node import IN_MANUAL_MODE, OdometryGap
from ros1_bridge.node.plane_poses import planar, yaw_of
from ros1_bridge.node.robot_parameters import PAUSE_S
from sim_arduino.world.shapes import Footprint, Wall
from sim_arduino.world.world import World
from tests.long.navigation.drive import drive
from tests.long.navigation.goals import Judge
from tests.waiting import wait_until

from .rig import ROOT, START_S
from .tables import Offered, first_two, table

LIMITS = Limits(0.3, 1.0, 0.2, 1.0)
SONARS = models.load("traxbot").sonars
STEP_S, FRAME_HZ = 0.05, 50
FREE = {"front": math.inf, "left": math.inf, "right": math.inf}
PLACE_M, HEADING_RAD = 0.06, 0.1
SUCCEEDED = actionlib.GoalStatus.SUCCEEDED
UNDER_WAY = (actionlib.GoalStatus.PENDING, actionlib.GoalStatus.ACTIVE)


def round_obstacle(pose, middle, radius_m):
    """Ranges of three sonars that see one round thing."""
    ranges = {}
    for name, yaw in (("front", 0.0), ("left", math.pi / 4), ("right", -math.pi / 4)):
        dx, dy = middle[0] - pose[0], middle[1] - pose[1]
        off = abs(math.remainder(math.atan2(dy, dx) - pose[2] - yaw, 2 * math.pi))
        away = math.hypot(dx, dy)
        cone = math.radians(18) + math.asin(min(1.0, radius_m / max(away, radius_m)))
        ranges[name] = away - radius_m if off < cone else math.inf
    return ranges


def sought(goal, see=lambda pose: FREE, seconds=120.0):
    """Where the seeker ends, and the poses on the way."""
    seeker, pose, way = GoalSeeker(goal, LIMITS, 0.0, SONARS), Pose(0.0, 0.0, 0.0), []
    for i in range(round(seconds / STEP_S)):
        linear, angular = seeker.command(pose, see(pose), i * STEP_S)
        assert abs(linear) <= LIMITS.linear_m_s and abs(angular) <= LIMITS.angular_rad_s
        if seeker.reached or seeker.blocked:
            break
        pose = advance(pose, linear * STEP_S, angular * STEP_S)
        way.append(pose)
    return seeker, pose, way


@settings(max_examples=50, deadline=None)
@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-math.pi, math.pi))
def test_any_goal_on_a_free_floor_is_reached(x, y, yaw):
    seeker, pose, _ = sought((x, y, yaw))
    assert seeker.reached
    assert math.hypot(pose.x_m - x, pose.y_m - y) < PLACE_M
    assert abs(math.remainder(pose.yaw_rad - yaw, 2 * math.pi)) < HEADING_RAD


@pytest.mark.parametrize("offset_m", [-0.2, -0.05, 0.0, 0.05, 0.2])
def test_round_thing_on_the_way_is_passed(offset_m):
    middle, radius_m = (1.0, offset_m), 0.2
    seeker, _, way = sought((2.0, 0.0, 0.0), lambda pose: round_obstacle(pose, middle, radius_m))
    assert seeker.reached
    assert min(math.hypot(p.x_m - middle[0], p.y_m - middle[1]) for p in way) > radius_m + 0.1


def test_walled_in_robot_gives_up():
    near = {"front": 0.2, "left": 0.2, "right": 0.2}
    seeker, _, _ = sought((2.0, 0.0, 0.0), lambda pose: near)
    assert seeker.blocked and not seeker.reached


def test_sonar_without_reading_does_not_stop_the_robot():
    assert goal_seeker.room(math.nan) == goal_seeker.FARTHEST_M
    assert goal_seeker.room(-math.inf) == 0.0


@given(st.floats(-3, 3), st.floats(0.1, 10))
def test_yaw_of_a_quaternion_of_any_length(yaw, length):
    half = Quaternion(0, 0, length * math.sin(yaw / 2), length * math.cos(yaw / 2))
    assert yaw_of(half) == pytest.approx(yaw)


@pytest.mark.parametrize("w", [0.0, math.nan, math.inf])
def test_quaternion_without_direction_is_refused(w):
    with pytest.raises(ValueError, match="expected a quaternion of length 1"):
        yaw_of(Quaternion(0, 0, 0, w))


@pytest.fixture(scope="module")
def driven(module_rig, tmp_path_factory):
    """A robot on a floor without end, with a node that seeks goals and its client."""
    rig, world = module_rig, tmp_path_factory.mktemp("world") / "far.yaml"
    world.write_text("walls: [[99, -9, 99, 9]]\n")
    rig.node(rig.board("--robot", "traxbot", "--world", str(world)).port)
    rig.odom = rig.topic("odom", Odometry)
    rig.odom.wait()
    rig.plans = rig.topic("plan", Path)
    rig.seeker = rig.go_to_goal("_patience:=4")
    rig.client = client_of(rig.ns)
    node = Offered(rig, "go_to_goal")
    wait_until(lambda: "waypoints" in node.topics(1), step_s=0.05)  # the last that it takes, after its action
    return rig


@pytest.fixture
def robot(driven):
    """The robot at rest where its odometry begins, without a goal."""
    driven.client.cancel_goals_at_and_before_time(rospy.Time.now())  # may arrive after the next goal
    reset = rospy.ServiceProxy(f"{driven.ns}/reset_odometry", Trigger)

    def begins():
        """The cancel may come after the reset, and the robot drive on until then."""
        return reset().success and driven.odom.wait_for_more(2) and distance(driven, 0.0, 0.0) < 1e-3

    wait_until(begins, step_s=0.1)
    return driven


def gap_of(pose, heard_s, now_s):
    """The judgement of a pose, two seconds after odometry fell silent."""
    gap = OdometryGap(LIMITS)
    assert not gap.update(Pose(1.0, 0.0, 0.0), 0.0, 2.0)
    assert gap.waiting and not gap.why
    return gap, gap.update(pose, heard_s, now_s)


def test_goal_goes_on_when_odometry_comes_back():
    gap, drives_on = gap_of(Pose(1.2, 0.0, 0.5), 2.0, 2.05)
    assert drives_on and not gap.waiting


@pytest.mark.parametrize("pose", [Pose(0.0, 0.0, 0.0), Pose(1.0, 0.0, 3.0)], ids=["place", "heading"])
def test_goal_ends_when_odometry_began_anew(pose):
    gap, drives_on = gap_of(pose, 2.0, 2.05)
    assert not drives_on and gap.why.startswith("odometry began again")


def test_goal_ends_when_odometry_does_not_come_back():
    gap, drives_on = gap_of(Pose(1.0, 0.0, 0.0), 0.0, 3.1)
    assert not drives_on and gap.why == "odometry has stopped"


def client_of(ns):
    """A client of the node in a namespace, connected with it."""
    client = actionlib.SimpleActionClient(f"{ns}/move_base", MoveBaseAction)
    assert client.wait_for_server(rospy.Duration(START_S))
    return client


def goal(robot, x, y, frame=None):
    pose = PoseStamped()
    pose.header.frame_id = frame or f"{robot.name}/odom"
    pose.pose.position.x, pose.pose.position.y, pose.pose.orientation.w = x, y, 1.0
    return pose


def distance(robot, x, y):
    at = robot.odom.messages[-1].pose.pose.position
    return math.hypot(at.x - x, at.y - y)


def drives(client, twists):
    """Wait until a goal drives the robot."""
    wait_until(lambda: len(twists.arrived) >= 5 or client.get_state() not in UNDER_WAY)
    assert client.get_state() in UNDER_WAY, client.get_goal_status_text()


def test_client_of_move_base_reaches_its_goal(robot):
    state = robot.client.send_goal_and_wait(MoveBaseGoal(goal(robot, 0.2, 0.0)), rospy.Duration(START_S))
    assert state == SUCCEEDED, robot.client.get_goal_status_text()
    assert distance(robot, 0.2, 0.0) < PLACE_M


def test_goal_that_is_reached_is_logged(robot):
    """No other test has its goal at this place."""
    state = robot.client.send_goal_and_wait(MoveBaseGoal(goal(robot, 0.187, 0.0)), rospy.Duration(START_S))
    assert state == SUCCEEDED, robot.client.get_goal_status_text()
    reached = "goal reached: x 0.187 m, y 0.000 m"
    wait_until(lambda: any(reached in line for line in robot.seeker.output()))


@pytest.mark.parametrize(
    "x, frame, text",
    [(1.0, "nowhere", "no transform from nowhere"), (math.nan, None, "expected finite numbers")],
)
def test_goal_that_cannot_be_had_ends_the_one_before(robot, x, frame, text):
    twists = robot.topic("cmd_vel", Twist)
    robot.client.send_goal(MoveBaseGoal(goal(robot, 2.0, 0.1)))
    drives(robot.client, twists)
    state = robot.client.send_goal_and_wait(MoveBaseGoal(goal(robot, x, 1.0, frame)), rospy.Duration(START_S))
    assert state == actionlib.GoalStatus.ABORTED
    assert text in robot.client.get_goal_status_text()
    wait_until(lambda: twists.messages[-1] == Twist())


def test_manual_mode_cancels_the_goal_and_refuses_others(robot):
    twists, mode = robot.topic("cmd_vel", Twist), rospy.ServiceProxy(f"{robot.ns}/manual_mode", SetBool)
    far = MoveBaseGoal(goal(robot, 2.0, 0.1))
    robot.client.send_goal(far)
    drives(robot.client, twists)
    assert mode(True).success
    try:
        assert robot.client.wait_for_result(rospy.Duration(START_S))
        assert robot.client.get_state() == actionlib.GoalStatus.PREEMPTED
        wait_until(lambda: twists.messages[-1] == Twist())
        assert taken(robot, far) == (actionlib.GoalStatus.ABORTED, IN_MANUAL_MODE)
    finally:
        mode(False)
    state, text = taken(robot, MoveBaseGoal(goal(robot, 0.1, 0.0)), before=IN_MANUAL_MODE)
    assert state == SUCCEEDED, text


def taken(robot, target, before=None):
    """State and text of a goal after a change of mode; again if it overtook that, which cancels it or refuses it so."""

    def ended():
        state = robot.client.send_goal_and_wait(target, rospy.Duration(START_S))
        text = robot.client.get_goal_status_text()
        return None if state == actionlib.GoalStatus.PREEMPTED or text == before else (state, text)

    return wait_until(ended)


def test_goal_in_the_robots_frame_is_ahead_of_it(robot):
    at = robot.odom.messages[-1].pose.pose
    ahead = planar(at).compose(0.1, 0.0)
    target = goal(robot, 0.1, 0.0, f"{robot.name}/base_link")
    assert robot.client.send_goal_and_wait(MoveBaseGoal(target), rospy.Duration(START_S)) == SUCCEEDED
    assert distance(robot, *ahead[:2]) < PLACE_M


def test_goal_of_another_client_takes_the_place_of_the_first(robot):
    ended = []
    robot.client.send_goal(MoveBaseGoal(goal(robot, 2.0, 0.1)), done_cb=lambda state, _: ended.append(state))
    other = client_of(robot.ns)
    wait_until(lambda: robot.client.get_state() == actionlib.GoalStatus.ACTIVE)
    here = robot.odom.messages[-1].pose.pose
    target = PoseStamped(robot.odom.messages[-1].header, here)
    assert other.send_goal_and_wait(MoveBaseGoal(target), rospy.Duration(START_S)) == SUCCEEDED
    wait_until(lambda: ended == [actionlib.GoalStatus.PREEMPTED])


def test_goal_is_given_up_when_the_robot_comes_no_nearer(robot):
    assert rospy.ServiceProxy(f"{robot.ns}/stop", Trigger)().success
    state = robot.client.send_goal_and_wait(MoveBaseGoal(goal(robot, 2.0, 0.1)), rospy.Duration(START_S))
    assert rospy.ServiceProxy(f"{robot.ns}/release_stop", Trigger)().success
    robot.odom.wait_for_more(
        round(1.2 * PAUSE_S * FRAME_HZ)
    )  # the next goal must not look like this one's end
    assert state == actionlib.GoalStatus.ABORTED
    assert robot.client.get_goal_status_text().startswith("blocked: ")


def test_topics_of_the_node_are_those_of_the_table(robot):
    node = Offered(robot, "go_to_goal")
    rows = table("## Node `go_to_goal`", "topic")
    for index, way in enumerate(("out", "in")):
        topics = node.topics(index)
        assert topics["move_base/goal"] == "move_base_msgs/MoveBaseActionGoal"
        own = {name: kind for name, kind in topics.items() if not name.startswith("move_base/")}
        assert own == first_two([row for row in rows if row[2] == way])


def test_cancelled_goal_stops_the_robot(robot):
    twists = robot.topic("cmd_vel", Twist)
    robot.client.send_goal(MoveBaseGoal(goal(robot, 0.9, 0.1)))
    drives(robot.client, twists)
    robot.client.cancel_goal()
    assert robot.client.wait_for_result(rospy.Duration(START_S))
    wait_until(lambda: twists.messages[-1] == Twist())


def test_drive_to_goals_is_judged_by_true_poses(robot):
    """What `make test-navigation` does with the real move_base: a goal that is reached, and one that takes too long."""
    judge = Judge(World([Wall(99, -9, 99, 9)]), Footprint(0.2, 0.2))
    seen = rospy.Subscriber(
        f"{robot.ns}/odom", Odometry, lambda message: judge.see(planar(message.pose.pose))
    )
    at = robot.odom.messages[-1].pose.pose.position
    near, far, frame = (at.x + 0.1, at.y, 0.0), (at.x + 9.0, at.y, 0.0), f"{robot.name}/odom"
    (there,) = drive(robot.client, judge, [near], START_S, frame)
    (late,) = drive(robot.client, judge, [far], 0.2, frame)
    assert there.reached and there.error_m < PLACE_M and not there.contact
    seen.unregister()
    assert not late.succeeded and late.error_m > 8.0


def test_goal_of_rviz_is_taken(robot):
    robot.publisher("move_base_simple/goal", PoseStamped).publish(goal(robot, 0.5, 0.1))
    wait_until(lambda: distance(robot, 0.5, 0.1) < PLACE_M)


def test_waypoints_are_visited_in_turn(robot):
    waypoints = robot.publisher("waypoints", Path)
    ended = robot.topic("move_base/result", MoveBaseActionResult)
    ended.wait_for_publisher()
    at = robot.odom.messages[-1].pose.pose.position
    waypoints.publish(Path(poses=[goal(robot, at.x + ahead, at.y) for ahead in (0.1, 0.2)]))

    def arrived():
        states = [message.status.status for message in ended.messages]
        return states[-2:] == [SUCCEEDED, SUCCEEDED] and distance(robot, at.x + 0.2, at.y) < PLACE_M

    wait_until(arrived, 60.0)
    ways = [plan.poses[-1].pose.position.x for plan in robot.plans.messages[-2:]]
    assert ways == pytest.approx([at.x + 0.1, at.x + 0.2])


def test_follow_waypoints_drives_through_its_list_and_stops_the_robot_when_it_ends(robot):
    """Its list is a parameter at first; then a topic brings another one."""
    name, frame = f"{robot.ns}/follow_waypoints", f"{robot.name}/odom"
    rospy.set_param(name, {"waypoints": [[0.1, 0, 0], [0.2, 0, 0]], "map_frame": frame})
    node = robot.start(
        "follow", str(ROOT / "ros1_bridge" / "nodes" / "follow_waypoints"), f"__ns:={robot.ns}"
    )
    status, twists = robot.topic("waypoint_status", DiagnosticStatus), robot.topic("cmd_vel", Twist)
    ended = robot.topic("move_base/result", MoveBaseActionResult)
    ended.wait_for_publisher()

    def said(state, since=0):
        return any(message.message == state for message in status.messages[since:])

    wait_until(lambda: said("done"), 60.0)
    assert distance(robot, 0.2, 0.0) < PLACE_M
    offered = Offered(robot, "follow_waypoints")
    rows = table("## Node `follow_waypoints`", "topic")
    for index, way in enumerate(("out", "in")):
        own = {k: kind for k, kind in offered.topics(index).items() if not k.startswith("move_base/")}
        assert own == first_two([row for row in rows if row[2] == way])
    assert offered.services() == first_two(table("## Node `follow_waypoints`", "service"))
    before = len(status.messages)
    robot.publisher("waypoint_poses", PoseArray).publish(poses=[goal(robot, 3.0, 0.1).pose])
    wait_until(lambda: said("driving", before) and twists.messages[-1] != Twist())
    node.signal(signal.SIGINT)
    assert node.wait(START_S)
    rospy.delete_param(name)
    wait_until(lambda: ended.messages[-1].status.status == actionlib.GoalStatus.PREEMPTED)
    wait_until(lambda: twists.messages[-1] == Twist())


def test_node_that_ends_while_it_drives_ends_in_peace(robot):
    """It has a namespace of its own, so that no client takes a node that has ended for the next one."""
    ns, twists = f"{robot.ns}/ending", robot.topic("cmd_vel", Twist)
    seeker = robot.go_to_goal(f"odom:={robot.ns}/odom", f"cmd_vel:={robot.ns}/cmd_vel", ns=ns)
    client = client_of(ns)
    client.send_goal(MoveBaseGoal(goal(robot, 2.0, 0.1)))
    drives(client, twists)
    seeker.signal(signal.SIGINT)
    assert seeker.wait(START_S) and seeker.exit_code == 0
    wait_until(lambda: twists.messages[-1] == Twist())
    wait_until(lambda: client.get_state() == actionlib.GoalStatus.ABORTED)
    assert client.get_goal_status_text() == "the node ends"
    said = "\n".join(seeker.output())
    assert "Traceback" not in said and "ERROR" not in said, said
