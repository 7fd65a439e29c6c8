"""The robot's service and a desk, each in a network of its own; run it with `unshare --net --mount`.

The robot's name leads to the robot itself on the robot, and over the cable on the desk (docs/raspberry_pi.md).
Prints the topics that reach the desk.
"""

import os
import subprocess
import sys
from pathlib import Path

import rospy
from rosgraph.masterapi import is_online

from tests import network, service_unit
from tests.waiting import wait_until

from .rig import Rig
from .two_machines import DESK, ROBOT

NAME = "robot.local"
MASTER = f"http://{NAME}:11311"
LAUNCH = "robot.launch robot:=traxbot"
"""With a model, robot_state_publisher runs, a node in C++."""


def lay_cable(folder: Path, rig: Rig) -> str:
    """Two networks; the name is the robot's address on the desk, and 127.0.0.1 on the robot.  Returns its process."""
    for place, address in (("desk", ROBOT), ("robot", "127.0.0.1")):
        (folder / place).write_text(f"127.0.0.1 localhost\n{address} {NAME}\n")
    hosts = f"mount --bind '{folder}/robot' /etc/hosts && echo $$ && exec sleep 1000"
    holder = rig.start("holder", "unshare", "--net", "--mount", "sh", "-c", hosts)
    wait_until(lambda: bool(holder.output()))
    robot = holder.output()[0]
    network.lay_cable(robot, DESK, ROBOT)
    subprocess.run(["mount", "--bind", str(folder / "desk"), "/etc/hosts"], check=True)
    return robot


def start_service(folder: Path, rig: Rig, robot: str) -> None:
    """Run the unit's command on the robot, with the settings of the page."""
    unit, desk = service_unit.installed(folder), rig.env
    command = service_unit.start_line(unit, folder, rig.board().port)
    rig.env = {name: value for name, value in desk.items() if not name.startswith("ROS_")}
    rig.env.update(service_unit.environment(unit), HOME=str(folder), RUNTIME_DIRECTORY=str(folder))
    rig.env.update(ROS_HOSTNAME=NAME, MRL_LAUNCH=LAUNCH)
    rig.start("service", "nsenter", f"--net=/proc/{robot}/ns/net", f"--mount=/proc/{robot}/ns/mnt", *command)
    rig.env = desk


def main() -> None:
    """Wait for a topic of a node in Python, and for one of a node in C++."""
    folder = Path(sys.argv[1])
    os.environ.pop("ROS_HOSTNAME", None)
    os.environ.update(ROS_MASTER_URI=MASTER, ROS_IP=DESK, ROS_LOG_DIR=str(folder))
    rig = Rig(folder, dict(os.environ))
    try:
        start_service(folder, rig, lay_cable(folder, rig))
        wait_until(lambda: is_online(MASTER))
        rospy.init_node("desk", disable_signals=True)
        for name in ("/odom", "/tf_static"):
            rig.topic(name, rospy.AnyMsg).wait()
            sys.stdout.write(f"{name}\n")
    finally:
        rig.close()


if __name__ == "__main__":
    main()
