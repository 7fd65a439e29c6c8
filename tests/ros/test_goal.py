"""Goals: the seeker on a point that moves as it is told, nodes on an emulated robot, and lists of waypoints."""

import itertools
import math
import re
import signal
import time
from types import SimpleNamespace

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalID
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from genpy import Time
from geometry_msgs.msg import PoseArray, PoseStamped, Quaternion, Twist
from hypothesis import given
from hypothesis import strategies as st
from move_base_msgs.msg import MoveBaseAction, MoveBaseActionResult, MoveBaseGoal
from nav_msgs.msg import Odometry, Path
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from mrl_driver.geometry import Pose
from mrl_driver.navigation.claims import NAMESAKE, Claim, read_messages, write_messages
from mrl_driver.robot.models import Limits
from ros1_bridge.navigation.follow_waypoints_node import CANCELLED, ends_tour
from ros1_bridge.navigation.go_to_goal_node import IN_MANUAL_MODE, OdometryGap, clock_s
from ros1_bridge.node.plane_poses import yaw_of
from ros1_bridge.robot.goal_cancel import GoalCancel
from tests.waiting import wait_until

from .fake_topics import Topics
from .rig import START_S, values_of
from .tables import Offered, first_two, table

LIMITS = Limits(0.3, 1.0, 0.2, 1.0)
PLACE_M, STEP_M = 0.06, 0.01
SUCCEEDED = actionlib.GoalStatus.SUCCEEDED
UNDER_WAY = (actionlib.GoalStatus.PENDING, actionlib.GoalStatus.ACTIVE)


@given(st.floats(-3, 3), st.floats(0.1, 10))
def test_yaw_of_a_quaternion_of_any_length(yaw, length):
    half = Quaternion(0, 0, length * math.sin(yaw / 2), length * math.cos(yaw / 2))
    assert yaw_of(half) == pytest.approx(yaw)
    for w in (0.0, math.nan, math.inf):
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
    rig.seeker = rig.program("go_to_goal", "_patience:=4")
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


@pytest.mark.parametrize(
    "pose, heard_s, now_s, why",
    [
        (Pose(1.2, 0.0, 0.5), 2.0, 2.05, ""),
        (Pose(0.0, 0.0, 0.0), 2.0, 2.05, "odometry began again"),
        (Pose(1.0, 0.0, 3.0), 2.0, 2.05, "odometry began again"),
        (Pose(1.0, 0.0, 0.0), 0.0, 3.1, "odometry has stopped"),
    ],
    ids=["back", "another place", "another heading", "stays away"],
)
def test_goal_goes_on_when_odometry_is_back_from_two_seconds_of_silence_where_it_was(
    pose, heard_s, now_s, why
):
    gap = OdometryGap(LIMITS)
    assert not gap.update(Pose(1.0, 0.0, 0.0), 0.0, 2.0) and gap.waiting
    assert gap.update(pose, heard_s, now_s) == (not why) and gap.why.startswith(why)


@pytest.mark.parametrize(
    "pose, why", [(Pose(0.8, 0.0, 0.5), ""), (Pose(0.6, 0.0, 0.5), "odometry began again: 0.15 m away")]
)
def test_goal_ends_if_odometry_begins_again_without_a_silence(pose, why):
    """As after `reset_odometry` while the robot waits."""
    gap = OdometryGap(LIMITS)
    assert gap.update(Pose(0.75, 0.0, 0.5), 1.0, 1.0)
    assert gap.update(pose, 1.05, 1.05) == (not why) and gap.why.startswith(why)


def test_goal_ends_if_its_node_stood_still_until_odometry_came_again():
    """As on a computer that was suspended, where that may come before the node looks."""
    gap = OdometryGap(LIMITS)
    assert gap.update(Pose(1.0, 0.0, 0.0), 0.0, 0.05)
    assert not gap.update(Pose(1.0, 0.0, 0.0), 3.1, 3.15) and gap.why == "odometry has stopped"


def test_a_goal_counts_the_time_for_which_the_computer_was_suspended(monkeypatch):
    since_boot_s, begun_s = time.clock_gettime, clock_s()
    monkeypatch.setattr(time, "clock_gettime", lambda clock: since_boot_s(clock) + 3600.0)
    assert clock_s() >= begun_s + 3600.0


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


def test_client_of_move_base_reaches_its_goal_which_is_logged(robot):
    """In the robot's own frame."""
    target = goal(robot, 0.187, 0.0, f"{robot.name}/base_link")
    state = robot.client.send_goal_and_wait(MoveBaseGoal(target), rospy.Duration(START_S))
    assert state == SUCCEEDED, robot.client.get_goal_status_text()
    assert distance(robot, 0.187, 0.0) < PLACE_M
    said = re.compile(r"goal reached: x 0.187 m, .*; the robot is (.*) m and (.*) deg off")
    off_m, off_deg = map(float, wait_until(lambda: said.search("\n".join(robot.seeker.output()))).groups())
    assert off_m == pytest.approx(distance(robot, 0.187, 0.0), abs=STEP_M) and off_deg <= 3.0


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


def test_goal_of_another_client_takes_the_place_of_the_first(robot):
    ended = []
    robot.client.send_goal(MoveBaseGoal(goal(robot, 2.0, 0.1)), done_cb=lambda state, _: ended.append(state))
    other = client_of(robot.ns)
    wait_until(lambda: robot.client.get_state() == actionlib.GoalStatus.ACTIVE)
    here = robot.odom.messages[-1].pose.pose
    target = PoseStamped(robot.odom.messages[-1].header, here)
    assert other.send_goal_and_wait(MoveBaseGoal(target), rospy.Duration(START_S)) == SUCCEEDED
    wait_until(lambda: ended == [actionlib.GoalStatus.PREEMPTED])


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
    Offered(robot, "go_to_goal").require_topics("move_base/")
    ways = [plan.poses[-1].pose.position.x for plan in robot.plans.messages[-2:]]
    assert ways == pytest.approx([at.x + 0.1, at.x + 0.2])


def test_follow_waypoints_drives_through_its_list_and_stops_the_robot_when_it_ends(robot):
    """Its list is a parameter at first; then a topic brings another one."""
    name, frame = f"{robot.ns}/follow_waypoints", f"{robot.name}/odom"
    rospy.set_param(name, {"waypoints": [[0.1, 0, 0], [0.2, 0, 0]], "map_frame": frame})
    node = robot.program("follow_waypoints")
    status, twists = robot.topic("waypoint_status", DiagnosticStatus), robot.topic("cmd_vel", Twist)
    ended = robot.topic("move_base/result", MoveBaseActionResult)
    ended.wait_for_publisher()

    def said(state, since=0):
        return any(message.message == state for message in status.messages[since:])

    wait_until(lambda: said("done"), 60.0)
    assert distance(robot, 0.2, 0.0) < PLACE_M
    offered = Offered(robot, "follow_waypoints")
    offered.require_topics("move_base/")
    assert offered.services() == first_two(table("## Node `follow_waypoints`", "service"))
    before = len(status.messages)
    robot.publisher("waypoint_poses", PoseArray).publish(poses=[goal(robot, 3.0, 0.1).pose])
    wait_until(lambda: said("driving", before) and twists.messages[-1] != Twist())
    node.signal(signal.SIGINT)
    assert node.wait(START_S)
    rospy.delete_param(name)
    wait_until(lambda: ended.messages[-1].status.status == actionlib.GoalStatus.PREEMPTED)
    wait_until(lambda: twists.messages[-1] == Twist())


def test_goals_are_reached_though_the_wall_clock_is_set(rig, monkeypatch):
    set_ahead = rig.wall_clock(monkeypatch)
    rig.node(rig.board().port)
    rig.program("go_to_goal", "_avoid:=false")
    twists, client = rig.topic("cmd_vel", Twist), client_of(rig.ns)
    for ahead_s, x in ((7 * 86400.0, 0.3), (0.0, 0.6), (0.0, 0.9)):
        client.send_goal(MoveBaseGoal(goal(rig, x, 0.0)))
        twists.wait_for_more(5)
        set_ahead(ahead_s)
        wait_until(lambda: client.get_state() not in UNDER_WAY)
        assert client.get_state() == SUCCEEDED, client.get_goal_status_text()


def test_goal_ends_with_a_stop_when_simulated_time_jumps_back(rig):
    with rig.simulated_time() as tick:
        rig.program("go_to_goal", "_avoid:=false")
        odom, twists = rig.publisher("odom", Odometry), rig.topic("cmd_vel", Twist)
        results = rig.topic("move_base/result", MoveBaseActionResult)

        def stands(set_s=None):
            message = Odometry(child_frame_id="base")
            message.header.frame_id, message.header.stamp = "odom", tick(set_s)
            message.pose.pose.orientation.w = 1.0
            odom.publish(message)

        node = Offered(rig, "go_to_goal")
        wait_until(lambda: stands() or "waypoints" in node.topics(1), step_s=0.05)
        results.wait_for_publisher()
    rig.publisher("move_base_simple/goal", PoseStamped).publish(goal(rig, 1.0, 0.0, "odom"))
    wait_until(lambda: stands() or twists.messages, step_s=0.02)
    wait_until(
        lambda: time.monotonic() - twists.arrived[-1][0] > 0.2
    )  # it waits for the clock, which stands still
    stands(500.0)
    wait_until(lambda: stands() or results.messages, step_s=0.02)
    assert results.messages[0].status.text == "simulated time jumped back"
    assert twists.messages[-1] == Twist()


def test_node_that_ends_while_it_drives_ends_in_peace(robot):
    """It has a namespace of its own, so that no client takes a node that has ended for the next one."""
    ns, twists = f"{robot.ns}/ending", robot.topic("cmd_vel", Twist)
    seeker = robot.program("go_to_goal", f"odom:={robot.ns}/odom", f"cmd_vel:={robot.ns}/cmd_vel", ns=ns)
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


NOW = Time(100, 0)


def made(now=NOW, closed=False):
    """A cancel whose node starts now, and what it publishes."""
    topics = Topics()
    ros = SimpleNamespace(Publisher=topics, Time=SimpleNamespace(now=lambda: now), ROSException=ValueError)
    cancel = GoalCancel(ros)
    out = topics["move_base/cancel"]
    if closed:
        out.publish = refuse
    return cancel, out


def refuse(message):
    raise ValueError("publish() to a closed topic")


def test_goals_of_before_the_start_are_cancelled_whenever_their_planner_connects():
    _, out = made()
    assert out.options["latch"] and out.sent == [GoalID(stamp=NOW)]


def test_all_goals_are_cancelled_whatever_their_clients_clock_shows():
    cancel, out = made()
    cancel.cancel(everything=True)
    assert out.sent[1:] == [GoalID(), GoalID(stamp=NOW)]


def test_goal_that_is_under_way_is_not_cancelled_when_the_clock_is_set_back():
    """The cancel is of before it by the new clock too, also if that shows the time 0."""
    cancel, out = made()
    cancel.set_back(30.0)
    cancel.set_back(100.0)
    assert out.sent[1:] == [GoalID(stamp=Time(70, 0)), GoalID(stamp=Time(0, 1))]


def test_goal_of_after_a_release_is_not_cancelled_though_the_cancel_arrives_late():
    cancel, out = made()
    cancel.cancel(everything=False)
    assert out.sent[1:] == [GoalID(stamp=NOW)]


def test_nothing_is_cancelled_at_a_start_before_simulated_time():
    """A cancel with the time 0 means all goals, of whatever time."""
    _, out = made(now=Time())
    assert out.sent == []


@pytest.mark.parametrize("everything", [True, False])
def test_stop_does_not_fail_because_the_shutdown_has_closed_the_topic(everything):
    cancel, _ = made(closed=True)
    cancel.cancel(everything)


def test_shared_waypoint_is_claimed_and_the_tour_pauses_when_move_base_falls_silent(rig):
    """A goal that nobody serves would never end.  Each robot of the team says all in one text."""
    name, said = f"{rig.ns}/follow_waypoints", rig.topic("claims", String)
    server, status = follow(rig, team="me,other,third", team_name="me")
    wait_until(lambda: status.messages and status.messages[-1].message == "claiming")
    answer(rig)
    wait_until(lambda: status.messages[-1].message == "driving")
    own = [text.data for text in said.messages if text.data.startswith("me")]
    assert {tuple(each.to for each in read_messages(text)) for text in own} == {("other", "third")}
    server.started = False  # it publishes its status no longer
    wait_until(lambda: status.messages[-1].message == "move_base has fallen silent")
    values = values_of(status.messages[-1])
    assert (values["state"], values["waypoint"]) == ("paused", "1 of 1")
    rospy.delete_param(name)


def test_robot_pauses_while_another_node_sends_claims_with_its_name(rig):
    """Its own claims come back to it, too, and do not count."""
    own = rig.topic("claims", String)
    _, status = follow(rig, team="me,other", team_name="me")
    own.wait(3)
    assert status.messages[-1].message == "claiming"
    twin = rig.publisher("claims", String)
    wait_until(lambda: twin.get_num_connections() == 2)  # the node's, and the one of this test
    twin.publish("me 0 other 0")
    wait_until(lambda: status.messages[-1].message == NAMESAKE.format("me"))
    assert values_of(status.messages[-1])["state"] == "paused"
    rospy.delete_param(f"{rig.ns}/follow_waypoints")


def follow(rig, **team):
    """The node with one waypoint, which it shares, and a server for its goals; server and topic of the status."""
    server = actionlib.ActionServer(
        f"{rig.ns}/move_base", MoveBaseAction, lambda handle: handle.set_accepted(), auto_start=False
    )
    server.start()
    rospy.set_param(f"{rig.ns}/follow_waypoints", {"waypoints": [[1, 0, 0]], "shared": "1", **team})
    status = rig.topic("waypoint_status", DiagnosticStatus)
    rig.program("follow_waypoints")
    return server, status


def test_claims_go_by_radio_and_a_silent_robot_is_named(rig):
    """Nothing answers first.  Then the other robot claims by radio, and the node grants it by radio."""
    own, other = "0013a20040000001", "0013a20040000002"
    sent = rig.topic("xbee/send", KeyValue)
    _, status = follow(rig, radio=f"1={own},2={other}", team_name="1")
    wait_until(lambda: status.messages and status.messages[-1].message == "no message from 2 for 3 s")
    assert status.messages[-1].level == DiagnosticStatus.WARN
    assert {(text.key, text.value) for text in sent.wait()} == {(other, "1 0 2 0")}
    rig.publisher("xbee/received", KeyValue).publish(other, "2 5 1 0")
    wait_until(lambda: sent.messages[-1].value == "1 0 2 5")
    rospy.delete_param(f"{rig.ns}/follow_waypoints")


def answer(rig):
    """Plays the other robots of the team: they answer on the topic of the claims."""
    others = [Claim("other", ["third", "me"], 0.0), Claim("third", ["other", "me"], 0.0)]
    out = rig.publisher("claims", String)

    times = itertools.count()

    def hear(message):
        said, now_s = read_messages(message.data), float(next(times))
        for other in others if said[0].sender == "me" else ():  # else they would answer without a pause
            for each in said:
                other.receive(each, now_s)
            replies = other.messages(now_s)
            if replies:
                out.publish(write_messages(replies))

    rospy.Subscriber(f"{rig.ns}/claims", String, hear)


@pytest.mark.parametrize(
    "cancel, ends",
    [
        (GoalID(), True),
        (GoalID(stamp=rospy.Time(10)), True),
        (GoalID(stamp=rospy.Time(9)), False),
        (GoalID(id="one of them"), False),
    ],
)
def test_tour_ends_with_all_goals_of_its_time(cancel, ends):
    assert ends_tour(cancel, ordered=rospy.Time(10)) is ends


def test_cancel_of_all_goals_pauses_a_tour_that_waits_at_a_waypoint(rig):
    """As by a stop of the robot: after its release, the robot must not set off when the wait is over."""

    def reach(handle):
        handle.set_accepted()
        handle.set_succeeded()

    server = actionlib.ActionServer(f"{rig.ns}/move_base", MoveBaseAction, reach, auto_start=False)
    server.start()
    rospy.set_param(f"{rig.ns}/follow_waypoints", {"waypoints": [[1, 0, 0], [2, 0, 0]], "wait": 3600.0})
    status = rig.topic("waypoint_status", DiagnosticStatus)
    rig.program("follow_waypoints")
    wait_until(lambda: status.messages and status.messages[-1].message == "waiting")
    cancel = rospy.Publisher(f"{rig.ns}/move_base/cancel", GoalID, queue_size=10)
    wait_until(lambda: cancel.get_num_connections() == 2)
    before = len(status.messages)
    cancel.publish(GoalID())
    wait_until(lambda: len(status.messages) > before)
    assert status.messages[before].message == CANCELLED
    assert rospy.ServiceProxy(f"{rig.ns}/follow_waypoints/resume", Trigger)().success
    rospy.delete_param(f"{rig.ns}/follow_waypoints")
