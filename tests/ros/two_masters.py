"""A desk and a robot, each with its own master and relay in a network of its own, with a cable between them.

Run it with `unshare --net --mount`; it prints what was seen as JSON, times in seconds.
"""

import math
import time

import rospy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from rosgraph.masterapi import is_online
from std_msgs.msg import Bool, String

from tests.waiting import wait_until

from .rig import NODE, ROOT, Rig
from .two_machines import DESK, MOVE, ROBOT, STOP, TIMEOUT_S, ip, run

RELAY = ROOT / "ros1_bridge" / "nodes" / "topic_relay"
MASTER = "http://127.0.0.1:11311"
RELAY_PORT = 11411
PERIOD_S = 0.1
QUEUED_S = 0.4  # Commands are sent for this time while the cable is pulled
CONNECTED = "connected"


def relay_arguments(
    name: str, address: str, send: str, peer: str, peer_address: str, receive: str, *options: str
) -> list:
    """Arguments of a relay with one peer."""
    return [
        str(RELAY),
        f"_name:={name}",
        f"_listen:={address}:{RELAY_PORT}",
        f"_send:={send}",
        f"_peers:={peer}={peer_address}:{RELAY_PORT}",
        f"_receive:={receive}",
        *options,
    ]


def start(rig: Rig, robot: str, *options: str) -> None:
    """A master and a relay on each side, the robot node on the robot's, and this process as a node on the desk's.

    `options` are parameters of both relays.
    """
    enter = ("nsenter", f"--net=/proc/{robot}/ns/net")
    for place in ((), enter):
        rig.start("master", *place, "rosmaster", "--core", "-p", "11311")
    rig.wire = rig.tap(rig.board().port)
    rig.start("node", *enter, str(NODE), f"_port:={rig.wire.port}", f"_cmd_vel_timeout:={TIMEOUT_S}")
    topics = "desk/cmd_vel=cmd_vel, desk/shared=shared"
    there = relay_arguments("robot1", ROBOT, "odom, mode, shared", "desk", DESK, topics, *options)
    rig.robots_relay = rig.start("robots_relay", *enter, *there)
    wait_until(lambda: is_online(MASTER))
    topics = "robot1/odom, robot1/mode, robot1/shared=shared"
    here = relay_arguments("desk", DESK, "cmd_vel, shared", "robot1", ROBOT, topics, *options)
    rig.start("desks_relay", *here)
    rospy.init_node("desk", disable_signals=True)


def link_words(rig: Rig) -> list:
    """What the robot's relay has said about its link to the desk's, each without time and name."""
    start = f"desk at {DESK}:{RELAY_PORT}: "
    return [line.split(start)[1] for line in rig.robots_relay.output() if start in line]


def trial(rig: Rig, robot: str) -> dict:
    """Drive over the cable, pull it while driving, send commands meanwhile, plug it in, and drive again."""
    start(rig, robot)
    wire, odom = rig.wire, rig.topic("/robot1/odom", Odometry)
    connected = rig.topic("/topic_relay/robot1/connected", Bool)
    cmd_vel = rospy.Publisher("/cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
    shared, shared_out = rig.topic("/shared", String), rospy.Publisher("/shared", String, queue_size=10)
    twist, shared_sent = Twist(Vector3(0.2, 0, 0), Vector3()), []

    def drives(_: object = None) -> None:
        cmd_vel.publish(twist)
        shared_sent.append("from the desk")
        shared_out.publish(shared_sent[-1])

    odom.wait()  # commands that were sent before would have to pause first
    timer = rospy.Timer(rospy.Duration(PERIOD_S), drives)
    moved = wait_until(lambda: bool(odom.messages) and odom.messages[-1].pose.pose.position.x > 0.02)
    wait_until(lambda: connected.messages[-1].data)
    cut_s = time.monotonic()
    ip("link", "set", "desk0", "down")
    wait_until(lambda: time.monotonic() > cut_s + QUEUED_S)
    timer.shutdown()
    timer.join()
    wait_until(lambda: not connected.messages[-1].data and link_words(rig)[-1] != CONNECTED)
    noticed_s, last_odom_s = connected.arrived[-1][0] - cut_s, odom.arrived[-1][0] - cut_s
    wait_until(lambda: wire.last(STOP) > wire.last(MOVE))
    stop_s = wire.first(STOP, wire.last(MOVE)) - cut_s
    count, back_s = len(odom.messages), time.monotonic()
    ip("link", "set", "desk0", "up")
    wait_until(lambda: len(odom.messages) > count + 20 and link_words(rig)[-1] == CONNECTED)
    mode = rig.topic("/robot1/mode", String).wait()[0].data
    replayed = wire.first(MOVE, back_s) < math.inf
    restored_s = odom.arrived[count][0] - back_s
    timer = rospy.Timer(rospy.Duration(PERIOD_S), drives)
    drives_again = wire.wait_for(MOVE, back_s) < math.inf
    timer.shutdown()
    timer.join()
    return {
        "moved": moved,
        "noticed_s": noticed_s,
        "last_odom_s": last_odom_s,
        "stop_s": stop_s,
        "restored_s": restored_s,
        "mode": mode,
        "replayed": replayed,
        "drives_again": drives_again,
        "came_back": len(shared.messages) > len(shared_sent),
    }


if __name__ == "__main__":
    run(trial, MASTER, ROS_IP="127.0.0.1")
