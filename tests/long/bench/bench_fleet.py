"""`make bench-fleet`: start time, rates and CPU of `team.launch` with 20 robots, and with one as control; fleet.json.

FAST=1 is shorter.  CPU is that of boards, nodes, state publishers, the
world and the ROS master, without this process.
"""

import collections
import contextlib
import os
import signal
import sys
import time
from functools import partial
from typing import Dict, Iterator, List, Tuple

import rospy

from ros1_bridge.demo.processes import Child, wait_until

from . import report
from .ros_bench import LOGS, ROOT, Master

RUNS, ROBOTS = report.either((3, 20), (1, 2))
START_S = 120.0
SETTLE_S, MEASURE_S = report.either((5.0, 10.0), (1.0, 2.0))
END_S = 30.0
PROGRAM = "import sys, roslaunch; roslaunch.main(sys.argv)"
ROLES = ("robot_node", "sim_board", "robot_state_publisher", "world_node", "rosmaster")
"""Programs, as their command lines name them."""
_TICKS = os.sysconf("SC_CLK_TCK")


class Team:
    """A running team and what of it has arrived here."""

    def __init__(self, robots: int, laser: bool) -> None:
        self.names = [f"robot{number}" for number in range(1, robots + 1)]
        self.odom: Dict[str, List[float]] = {name: [] for name in self.names}
        self.scan: Dict[str, List[float]] = {name: [] for name in self.names if laser}
        self._subscribers = [
            rospy.Subscriber(
                f"/{name}/{topic}", rospy.AnyMsg, _note, callback_args=times[name], tcp_nodelay=True
            )
            for topic, times in (("odom", self.odom), ("scan", self.scan))
            for name in times
        ]
        unique = f"bench{os.getpid()}"  # names of ports and world
        env = {**os.environ, "ROS_PACKAGE_PATH": str(ROOT), "USER": unique}
        file = str(ROOT / "ros1_bridge" / "launch" / "team.launch")
        arguments = [f"count:={robots}", f"world_name:={unique}", f"laser:={str(laser).lower()}"]
        begun_s = time.monotonic()
        command = [sys.executable, "-c", PROGRAM, file, *arguments]
        self._launch = Child("roslaunch", command, LOGS / f"team{robots}.log", env, ROOT)
        topics = [*self.odom.values(), *self.scan.values()]
        started = wait_until(lambda: all(topics) or self._launch.exit_code is not None, START_S)
        assert started and all(topics), self._launch.last_words()
        self.start_s = max(times[0] for times in self.odom.values()) - begun_s

    def close(self) -> None:
        """End all nodes."""
        self._launch.signal(signal.SIGINT)
        self._launch.finish(END_S)
        for subscriber in self._subscribers:
            subscriber.unregister()


@contextlib.contextmanager
def running(robots: int, laser: bool) -> Iterator[Team]:
    """A team; it ends with the block."""
    team = Team(robots, laser)
    try:
        yield team
    finally:
        team.close()


def _note(_: rospy.AnyMsg, times: List[float]) -> None:
    times.append(time.monotonic())


def cpu_s() -> Dict[Tuple[str, str], float]:
    """CPU so far [s] of each process of this master, by role and process id."""
    found, mark = {}, f"ROS_MASTER_URI={os.environ['ROS_MASTER_URI']}".encode()
    for number in filter(str.isdigit, os.listdir("/proc")):
        with contextlib.suppress(OSError):
            folder = f"/proc/{number}"
            with open(f"{folder}/environ", "rb") as environ, open(f"{folder}/cmdline", "rb") as command:
                ours, words = mark in environ.read().split(b"\0"), command.read().decode(errors="replace")
            role = next((role for role in ROLES if role in words), "")
            if ours and role:
                with open(f"{folder}/stat", encoding="ascii", errors="replace") as stat:
                    fields = stat.read().rpartition(")")[2].split()
                found[role, number] = (int(fields[11]) + int(fields[12])) / _TICKS
    return found


def measure(robots: int, laser: bool) -> Dict[str, float]:
    """Figures of one run."""
    with running(robots, laser) as team:
        time.sleep(SETTLE_S)
        before, begin_s = cpu_s(), time.monotonic()
        time.sleep(MEASURE_S)
        after, end_s = cpu_s(), time.monotonic()
        odom, scan = (
            [[at for at in list(times) if begin_s <= at < end_s] for times in topic.values()]
            for topic in (team.odom, team.scan)
        )
    gaps = sorted(b - a for times in odom for a, b in zip(times, times[1:]))
    used: Dict[str, float] = collections.Counter()
    for (role, number), seconds in after.items():
        used[role] += 100 * (seconds - before.get((role, number), seconds)) / (end_s - begin_s)
    figures = {
        "start_s": team.start_s,
        "odom_hz_least": min(map(len, odom)) / (end_s - begin_s),
        "gap_ms_p99": 1e3 * gaps[int(0.99 * len(gaps))],
        "gap_ms_worst": 1e3 * gaps[-1],
        "cpu_percent": sum(used.values()),
        **{f"cpu_percent_{role}": percent for role, percent in used.items()},
    }
    if scan:
        figures["scan_hz_least"] = min(map(len, scan)) / (end_s - begin_s)
    return figures


def main() -> int:
    """Measure, print and write."""
    figures: Dict[str, report.Measured] = {}
    cases = {
        "one": (1, False),
        "fleet": (ROBOTS, False),
        **report.either({"fleet_laser": (ROBOTS, True)}, {}),
    }
    with Master():
        for name, case in cases.items():
            runs = report.by_key(report.repeat(name, RUNS, partial(measure, *case)))
            figures.update({f"{name}_{key}": values for key, values in runs.items()})
    return report.conclude("fleet", figures)


if __name__ == "__main__":
    sys.exit(main())
