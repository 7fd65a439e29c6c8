"""`make bench-fleet`: start time, rates and CPU of `team.launch` with 20 robots, and with one as control; fleet.json.

FAST=1 is shorter.  CPU is that of boards, nodes, state publishers, the
world and the ROS master, without this process.
"""

import contextlib
import os
import signal
import sys
import time
from functools import partial
from pathlib import Path
from typing import Dict, Iterator, List

import rospy

from ros1_bridge.node.processes import Child, wait_until

from . import processes, report
from .ros_bench import LOGS, ROOT, Master

RUNS, ROBOTS = report.either((3, 20), (1, 2))
START_S = 120.0
SETTLE_S, MEASURE_S = report.either((5.0, 10.0), (0.5, 1.0))
END_S = 30.0
PROGRAM = "import sys, roslaunch; roslaunch.main(sys.argv)"
ROLES = (b"robot_node", b"sim_board", b"robot_state_publisher", b"world_node", b"rosmaster")
"""Programs, as their command lines name them."""


class Team:
    """A running team and what of it has arrived here."""

    def __init__(self, robots: int) -> None:
        self.odom: Dict[str, List[float]] = {f"/robot{number}/odom": [] for number in range(1, robots + 1)}
        self._subscribers = [
            rospy.Subscriber(topic, rospy.AnyMsg, _note, callback_args=times, tcp_nodelay=True)
            for topic, times in self.odom.items()
        ]
        unique = f"bench{os.getpid()}"  # names of ports and world
        env = {**os.environ, "ROS_PACKAGE_PATH": str(ROOT), "USER": unique}
        file = str(ROOT / "ros1_bridge" / "launch" / "team.launch")
        arguments = [f"count:={robots}", f"world_name:={unique}", "laser:=false"]
        begun_s = time.monotonic()
        command = [sys.executable, "-c", PROGRAM, file, *arguments]
        self._launch = Child("roslaunch", command, LOGS / f"team{robots}.log", env, ROOT)
        topics = self.odom.values()
        started = wait_until(lambda: all(topics) or self._launch.exit_code is not None, START_S)
        assert started and all(topics), self._launch.last_words()
        self.start_s = max(times[0] for times in self.odom.values()) - begun_s

    def close(self) -> None:
        self._launch.signal(signal.SIGINT)
        self._launch.finish(END_S)
        for subscriber in self._subscribers:
            subscriber.unregister()


@contextlib.contextmanager
def running(robots: int) -> Iterator[Team]:
    """A team; it ends with the block."""
    team = Team(robots)
    try:
        yield team
    finally:
        team.close()


def _note(_: rospy.AnyMsg, times: List[float]) -> None:
    times.append(time.monotonic())


def cpu_s() -> Dict[str, float]:
    """CPU so far [s] of each process of this master, by process id."""
    found, mark = {}, f"ROS_MASTER_URI={os.environ['ROS_MASTER_URI']}".encode()
    for number in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError):
            words = Path("/proc", number, "cmdline").read_bytes()
            if mark in Path("/proc", number, "environ").read_bytes().split(b"\0") and any(
                role in words for role in ROLES
            ):
                found[number] = processes.cpu_s(int(number))
    return found


def measure(robots: int) -> Dict[str, float]:
    with running(robots) as team:
        time.sleep(SETTLE_S)
        before, begin_s = cpu_s(), time.monotonic()
        time.sleep(MEASURE_S)
        after, end_s = cpu_s(), time.monotonic()
        odom = [[at for at in list(times) if begin_s <= at < end_s] for times in team.odom.values()]
    gaps = sorted(b - a for times in odom for a, b in zip(times, times[1:]))
    used_s = sum(seconds - before.get(process, seconds) for process, seconds in after.items())
    return {
        "start_s": team.start_s,
        "odom_hz_least": min(map(len, odom)) / (end_s - begin_s),
        "gap_ms_p99": 1e3 * gaps[int(0.99 * len(gaps))],
        "cpu_percent": 100 * used_s / (end_s - begin_s),
    }


def figures() -> Dict[str, report.Measured]:
    found: Dict[str, report.Measured] = {}
    with Master():
        for name, robots in (("one", 1), ("fleet", ROBOTS)):
            runs = report.by_key(report.repeat(name, RUNS, partial(measure, robots)))
            found.update({f"{name}_{key}": values for key, values in runs.items()})
    return found
