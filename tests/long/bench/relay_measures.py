"""One measurement of `bench_relay` on two networks with a cable between them, of its own; prints it as JSON.

Run with `unshare --net --mount`: `python -m tests.long.bench.relay_measures FOLDER delays|cut|plain_cut`.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Dict, List

from rosgraph.masterapi import is_online

from tests.long.bench.report import either
from tests.ros import two_machines, two_masters
from tests.ros.rig import Rig
from tests.ros.two_machines import DESK, ROBOT, lay_cable
from tests.ros.two_masters import MASTER, relay_arguments
from tests.waiting import wait_until

ENDS = [sys.executable, "-m", "tests.long.bench.relay_ends"]
HZ = 50
DELAYS_S = either(20.0, 3.0)


def enter(robot: str) -> List[str]:
    return ["nsenter", f"--net=/proc/{robot}/ns/net"]


def two_relays(rig: Rig, robot: str) -> None:
    """A master and a relay on each side; the robot gets `desk/odom` of a talker on the desk."""
    for place in ([], enter(robot)):
        rig.start("master", *place, "rosmaster", "--core", "-p", "11311")
    wait_until(lambda: is_online(MASTER))
    rig.start("talk", *ENDS, "talk", "/odom", str(HZ))
    rig.start("desks_relay", *relay_arguments("desk", DESK, "odom", "robot1", ROBOT, ""))
    rig.start("robots_relay", *enter(robot), *relay_arguments("robot1", ROBOT, "", "desk", DESK, "desk/odom"))


def heard(rig: Rig, place: List[str], topic: str, seconds: float, env: Dict[str, str]) -> Any:
    command = [*place, *ENDS, "listen", topic, str(seconds)]
    return subprocess.Popen(command, env=env, stdout=subprocess.PIPE, text=True)


def delays_of(listener: Any) -> List[List[float]]:
    return json.loads(listener.communicate()[0])


def delays(rig: Rig, robot: str) -> Dict[str, List[List[float]]]:
    """Of a topic through both relays, and of the same one within the desk's master at the same time."""
    two_relays(rig, robot)
    relayed = heard(rig, enter(robot), "/desk/odom", DELAYS_S, rig.env)
    direct = heard(rig, [], "/odom", DELAYS_S, rig.env)
    return {"relayed": delays_of(relayed), "direct": delays_of(direct)}


def cut(rig: Rig, robot: str) -> Dict[str, Any]:
    two_masters.start(rig, robot)
    return two_masters.trial(rig)


def plain_cut(rig: Rig, robot: str) -> Dict[str, Any]:
    two_machines.start(rig, robot)
    return two_machines.trial(rig)


MEASURES = {each.__name__: each for each in (delays, cut, plain_cut)}


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
