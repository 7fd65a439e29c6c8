"""One measurement of `bench_relay` on two networks with a cable between them, of its own; prints it as JSON.

Run with `unshare --net --mount`: `python -m tests.long.bench.relay_measures FOLDER delays|cut|plain_cut`.
"""

import json
import subprocess
import sys
from typing import Any, Dict, List

from rosgraph.masterapi import is_online

from tests.long.bench.report import either
from tests.ros import two_machines, two_masters
from tests.ros.rig import Rig
from tests.ros.two_machines import DESK, ROBOT, run
from tests.ros.two_masters import MASTER, relay_arguments
from tests.waiting import wait_until

ENDS = [sys.executable, "-m", "tests.long.bench.relay_ends"]
HZ = 50
DELAYS_S = either(20.0, 1.0)


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


MEASURES = {"delays": delays, "cut": two_masters.trial, "plain_cut": two_machines.trial}


if __name__ == "__main__":
    if sys.argv[2] == "plain_cut":
        run(two_machines.trial, two_machines.MASTER, ROS_HOSTNAME="desk")
    else:
        run(MEASURES[sys.argv[2]], MASTER, ROS_IP="127.0.0.1")
