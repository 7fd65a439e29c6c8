"""One measurement of `bench_relay` on two networks with a cable between them, of its own; prints it as JSON.

Run with `unshare --net --mount`: `python -m tests.long.bench.relay_measures FOLDER delays|slow|queued|cut|one_master`.
"""

import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, Dict, List

import rospy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from ros1_bridge.demo.launcher import master_answers
from tests.long.bench.report import either
from tests.ros import two_machines, two_masters
from tests.ros.rig import Rig
from tests.ros.two_machines import DESK, MOVE, ROBOT, STOP, ip, lay_cable
from tests.ros.two_masters import MASTER, relay_arguments
from tests.waiting import wait_until

ENDS = [sys.executable, "-m", "tests.long.bench.relay_ends"]
HZ = 50
DELAYS_S, SLOW_S = either((20.0, 15.0), (3.0, 4.0))
SLOW = "80kbit"
"""A third of what the topic needs: 50 messages of 0.7 kB a second."""
SHORT_CUT_S = 1.0


def enter(robot: str) -> List[str]:
    """Starts a program in the robot's network."""
    return ["nsenter", f"--net=/proc/{robot}/ns/net"]


def two_relays(rig: Rig, robot: str) -> None:
    """A master and a relay on each side; the robot gets `desk/odom` of a talker on the desk."""
    for place in ([], enter(robot)):
        rig.start("master", *place, "rosmaster", "--core", "-p", "11311")
    wait_until(lambda: master_answers(MASTER))
    rig.start("talk", *ENDS, "talk", "/odom", str(HZ))
    rig.start("desks_relay", *relay_arguments("desk", DESK, "odom", "robot1", ROBOT, ""))
    rig.start("robots_relay", *enter(robot), *relay_arguments("robot1", ROBOT, "", "desk", DESK, "desk/odom"))


def heard(rig: Rig, place: List[str], topic: str, seconds: float, env: Dict[str, str]) -> Any:
    """A started listener."""
    command = [*place, *ENDS, "listen", topic, str(seconds)]
    return subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True)


def delays_of(listener: Any) -> List[List[float]]:
    """What a listener prints."""
    return json.loads(listener.communicate()[0])


def delays(rig: Rig, robot: str) -> Dict[str, List[List[float]]]:
    """Of a topic through both relays, and of the same one within the desk's master at the same time."""
    two_relays(rig, robot)
    relayed = heard(rig, enter(robot), "/desk/odom", DELAYS_S, rig.env)
    direct = heard(rig, [], "/odom", DELAYS_S, rig.env)
    return {"relayed": delays_of(relayed), "direct": delays_of(direct)}


def slow(rig: Rig, robot: str) -> Dict[str, List[List[float]]]:
    """Of a topic through both relays, over a cable that is too slow for it."""
    slow_down()
    two_relays(rig, robot)
    return {"relayed": delays_of(heard(rig, enter(robot), "/desk/odom", SLOW_S, rig.env))}


def one_master(rig: Rig, robot: str) -> Dict[str, List[List[float]]]:
    """The same without relays: the robot subscribes over the cable."""
    slow_down()
    env = {**rig.env, "ROS_MASTER_URI": f"http://{DESK}:11311"}
    rig.env = {**env, "ROS_IP": DESK}
    rig.start("master", "rosmaster", "--core", "-p", "11311")
    wait_until(lambda: master_answers(MASTER))
    rig.start("talk", *ENDS, "talk", "/odom", str(HZ))
    return {"direct": delays_of(heard(rig, enter(robot), "/odom", SLOW_S, {**env, "ROS_IP": ROBOT}))}


def slow_down() -> None:
    """Let little pass from the desk to the robot."""
    limit = ["tbf", "rate", SLOW, "burst", "4kb", "latency", "10s"]
    subprocess.run(["tc", "qdisc", "add", "dev", "desk0", "root", *limit], check=True)


def short_cut(rig: Rig, robot: str, *options: str) -> Dict[str, Any]:
    """Pull the cable while driving, for less than the relays' `~timeout`: what waited in the connection arrives.

    No command is given from 0.4 s after the cut.
    """
    two_masters.start(rig, robot, "_timeout:=10", *options)
    odom = rig.topic("/robot1/odom", Odometry)
    cmd_vel = rospy.Publisher("/cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
    twist = Twist(Vector3(0.2, 0, 0), Vector3())
    timer = rospy.Timer(rospy.Duration(0.1), lambda _: cmd_vel.publish(twist))
    wait_until(lambda: bool(odom.messages) and odom.messages[-1].pose.pose.position.x > 0.02)
    cut_s = time.monotonic()
    ip("link", "set", "desk0", "down")
    time.sleep(two_masters.QUEUED_S)
    timer.shutdown()
    wait_until(lambda: rig.wire.last(STOP) > rig.wire.last(MOVE))
    stop_s = rig.wire.first(STOP, rig.wire.last(MOVE)) - cut_s
    time.sleep(max(0.0, cut_s + SHORT_CUT_S - time.monotonic()))
    count, back_s = len(odom.messages), time.monotonic()
    ip("link", "set", "desk0", "up")
    wait_until(lambda: len(odom.messages) > count)
    time.sleep(3.0)
    return {"stop_s": stop_s, "drove_again": rig.wire.first(MOVE, back_s) < math.inf}


def cut(rig: Rig, robot: str) -> Dict[str, Any]:
    """The trial of the tests."""
    two_masters.start(rig, robot)
    return two_masters.trial(rig)


def plain_cut(rig: Rig, robot: str) -> Dict[str, Any]:
    """The trial of the tests with one master."""
    two_machines.start(rig, robot)
    return two_machines.trial(rig)


MEASURES: Dict[str, Any] = {
    "delays": delays,
    "slow": slow,
    "one_master": one_master,
    "cut": cut,
    "plain_cut": plain_cut,
    "short_cut": short_cut,
    "short_cut_any_age": lambda rig, robot: short_cut(rig, robot, "_max_age:=60"),
}


def main(folder: Path, name: str) -> None:
    """One measurement, with logs in a folder."""
    host = {"ROS_MASTER_URI": two_machines.MASTER, "ROS_HOSTNAME": "desk"}
    alone = {"ROS_MASTER_URI": MASTER, "ROS_IP": "127.0.0.1"}
    os.environ.pop("ROS_IP", None)
    os.environ.pop("ROS_HOSTNAME", None)
    os.environ.update(host if name == "plain_cut" else alone, ROS_LOG_DIR=str(folder))
    rig = Rig(folder, dict(os.environ))
    try:
        sys.stdout.write(json.dumps(MEASURES[name](rig, lay_cable(folder, rig))) + "\n")
    finally:
        rig.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2])
