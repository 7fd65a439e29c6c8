"""follow_waypoints with a server of the test's own."""

import itertools

import actionlib
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from move_base_msgs.msg import MoveBaseAction
from std_msgs.msg import String

from mrl_driver.navigation.claims import Claim, ClaimMessage
from tests.waiting import wait_until

from .rig import ROOT


def test_shared_waypoint_is_claimed_and_the_tour_pauses_when_move_base_falls_silent(rig):
    """A goal that nobody serves would never end."""
    server = actionlib.ActionServer(
        f"{rig.ns}/move_base", MoveBaseAction, lambda handle: handle.set_accepted(), auto_start=False
    )
    server.start()
    name = f"{rig.ns}/follow_waypoints"
    team = {"shared": "1", "team": "me,other", "team_name": "me"}
    rospy.set_param(name, {"waypoints": [[1, 0, 0]], **team})
    status = rig.topic("waypoint_status", DiagnosticStatus)
    rig.start("follow", str(ROOT / "ros1_bridge" / "nodes" / "follow_waypoints"), f"__ns:={rig.ns}")
    wait_until(lambda: status.messages and status.messages[-1].message == "claiming")
    answer(rig)
    wait_until(lambda: status.messages[-1].message == "driving")
    server.started = False  # it publishes its status no longer
    wait_until(lambda: status.messages[-1].message == "move_base has fallen silent")
    values = {pair.key: pair.value for pair in status.messages[-1].values}
    assert (values["state"], values["waypoint"]) == ("paused", "1 of 1")
    rospy.delete_param(name)


def answer(rig):
    """Plays the other robot of the team: it answers on the topic of the claims."""
    other = Claim("other", ["me"], 0.0)
    out = rig.publisher("claims", String)

    times = itertools.count()

    def hear(message):
        now_s = float(next(times))
        other.receive(ClaimMessage.parse(message.data), now_s)
        for reply in other.messages(now_s):
            out.publish(reply.text)

    rospy.Subscriber(f"{rig.ns}/claims", String, hear)
