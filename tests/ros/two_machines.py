"""A robot and a desk, each in a network of its own with a cable between them; run it with `unshare --net --mount`.

The master and a client are on the desk, which is known by name (ROS_HOSTNAME); board and node are on the robot, known
by address (ROS_IP).  Prints what was seen as JSON, times in seconds.
"""

import json
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Callable

import rospy
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from rosgraph.masterapi import is_online

from tests import network
from tests.network import ip
from tests.waiting import wait_until

from .rig import NODE, Rig

DESK, ROBOT, PORT = "10.77.0.1", "10.77.0.2", "11311"
MASTER = f"http://desk:{PORT}"
MOVE, STOP = 11, 13
TIMEOUT_S, PERIOD_S, CUT_S = 0.5, 0.1, 0.9


def lay_cable(folder: Path, rig: Rig) -> str:
    """Two networks and names; returns the process that holds the robot's."""
    holder = rig.start("holder", "unshare", "--net", "sh", "-c", "echo $$; exec sleep 1000")
    wait_until(lambda: bool(holder.output()))
    robot = holder.output()[0]
    network.lay_cable(robot, DESK, ROBOT)
    (folder / "hosts").write_text(f"127.0.0.1 localhost\n{DESK} desk\n")
    subprocess.run(["mount", "--bind", str(folder / "hosts"), "/etc/hosts"], check=True)
    return robot


def start(rig: Rig, robot: str) -> None:
    """Master on the desk, board and node on the robot."""
    rig.start("master", "rosmaster", "--core", "-p", PORT)
    wait_until(lambda: is_online(MASTER))
    rospy.init_node("desk", disable_signals=True)
    rig.wire = rig.tap(rig.board().port)
    there = {name: value for name, value in rig.env.items() if name != "ROS_HOSTNAME"}
    here, rig.env = rig.env, {**there, "ROS_IP": ROBOT}
    enter = ("nsenter", f"--net=/proc/{robot}/ns/net")
    rig.start("node", *enter, str(NODE), f"_port:={rig.wire.port}", f"_cmd_vel_timeout:={TIMEOUT_S}")
    rig.env = here


def trial(rig: Rig, robot: str) -> dict:
    """Drive, pull the cable, and plug it in again."""
    start(rig, robot)
    odom, wire = rig.topic("/odom", Odometry), rig.wire
    odom.wait(10)
    cmd_vel = rospy.Publisher("/cmd_vel", Twist, queue_size=1, tcp_nodelay=True)
    wait_until(lambda: cmd_vel.get_num_connections() > 0)
    twist = Twist(Vector3(0.2, 0, 0), Vector3())
    timer = rospy.Timer(rospy.Duration(PERIOD_S), lambda _: cmd_vel.publish(twist))
    moved = wait_until(lambda: odom.messages[-1].pose.pose.position.x > 0.02)
    cut_s = time.monotonic()
    ip("link", "set", "desk0", "down")
    stop_s = wire.wait_for(STOP, cut_s) - cut_s
    time.sleep(max(0.0, cut_s + CUT_S - time.monotonic()))
    count, back_s = len(odom.messages), time.monotonic()
    ip("link", "set", "desk0", "up")
    again_s = wire.wait_for(MOVE, back_s) - back_s
    more = wait_until(lambda: len(odom.messages) > count + 10)
    timer.shutdown()
    return {"moved": moved, "stop_s": stop_s, "again_s": again_s, "odom_again": more}


def run(measure: Callable[[Rig, str], dict], master: str, **known: str) -> None:
    """One measurement, its logs in the folder of the command line; the desk is known by ROS_IP or ROS_HOSTNAME."""
    folder = Path(sys.argv[1])
    for name in ("ROS_IP", "ROS_HOSTNAME"):
        os.environ.pop(name, None)
    os.environ.update(known, ROS_MASTER_URI=master, ROS_LOG_DIR=str(folder))
    rig = Rig(folder, dict(os.environ))
    try:
        sys.stdout.write(json.dumps(measure(rig, lay_cable(folder, rig))) + "\n")
    finally:
        rig.close()
