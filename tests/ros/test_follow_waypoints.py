"""follow_waypoints with a server of the test's own."""

import itertools

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalID
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from move_base_msgs.msg import MoveBaseAction
from std_msgs.msg import String
from std_srvs.srv import Trigger

from mrl_driver.navigation.claims import Claim, ClaimMessage
from ros1_bridge.navigation.follow_waypoints_node import CANCELLED, ends_tour
from tests.waiting import wait_until

from .rig import values_of


def test_shared_waypoint_is_claimed_and_the_tour_pauses_when_move_base_falls_silent(rig):
    """A goal that nobody serves would never end."""
    name = f"{rig.ns}/follow_waypoints"
    server, status = follow(rig, team="me,other", team_name="me")
    wait_until(lambda: status.messages and status.messages[-1].message == "claiming")
    answer(rig)
    wait_until(lambda: status.messages[-1].message == "driving")
    server.started = False  # it publishes its status no longer
    wait_until(lambda: status.messages[-1].message == "move_base has fallen silent")
    values = values_of(status.messages[-1])
    assert (values["state"], values["waypoint"]) == ("paused", "1 of 1")
    rospy.delete_param(name)


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
    """Plays the other robot of the team: it answers on the topic of the claims."""
    other = Claim("other", ["me"], 0.0)
    out = rig.publisher("claims", String)

    times = itertools.count()

    def hear(message):
        said, now_s = ClaimMessage.parse(message.data), float(next(times))
        if said.sender != other.name:  # else it would answer itself without a pause
            other.receive(said, now_s)
            for reply in other.messages(now_s):
                out.publish(reply.text)

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
