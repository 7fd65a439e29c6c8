"""`make bench-small`: the node and its page where the processor is short; build/bench/small.json.

CPU of both, and the times of stops: alone, with a fifth of a core for each, and beside two busy loops for each core,
as important as the nodes or by ten steps of nice less important.  The board has priority over all, as a real one.
The fifth is left out without root or a control group to write.  FAST=1 is shorter.
"""

import contextlib
import itertools
import os
import re
import statistics
import sys
import time
from pathlib import Path
from typing import Any, Callable, Dict, Iterator, List, Sequence

import rospy
from std_srvs.srv import Trigger

from ros1_bridge.node.processes import Child, wait_until
from tests.ros.page_client import PageClient

from . import processes, report
from .bench_ros import Figures, p99
from .ros_bench import COMMANDS_S, LOGS, NODE, ROOT, SPEED_M_S, START_S, Bench, Master

STOPS, WATCHED_S, STILL_S = report.either((20, 20.0, 1.0), (1, 0.5, 0.6))
LOOPS = report.either(2 * (os.cpu_count() or 1), 1)
NICE, LESS = 9, 19
FRAMES_HZ, TIMEOUT_S = 50.0, 0.5
SHARE, PERIOD_US = 0.2, 5000
CPU_RUNS = report.either(5, 1)
NBODY_STEPS = report.either(100_000, 2000)
NBODY_PI4_US = 21.0  # CPU of a step on a Pi 4; docs/raspberry_pi.md has the source
WEB = [
    sys.executable,
    str(ROOT / "ros1_bridge" / "nodes" / "web_node"),
    "_listen:=127.0.0.1:0",
    "_robot:=traxbot",
]
GROUPS = Path("/sys/fs/cgroup")


def nbody_us() -> float:
    """CPU of a step of the n-body problem with five bodies, in pure Python [us]."""
    bodies = [([4.0 * i, i - 2.0, 0.1 * i], [0.0, 0.6 * i, 0.1], 10.0**-i) for i in range(5)]
    pairs = list(itertools.combinations(bodies, 2))
    begun_s = time.process_time()
    for _ in range(NBODY_STEPS):
        for (at, speed, mass), (at_2, speed_2, mass_2) in pairs:
            x, y, z = at[0] - at_2[0], at[1] - at_2[1], at[2] - at_2[2]
            pull = 0.01 * (x * x + y * y + z * z) ** -1.5
            by_2, by_1 = pull * mass_2, pull * mass
            speed[0] -= x * by_2
            speed[1] -= y * by_2
            speed[2] -= z * by_2
            speed_2[0] += x * by_1
            speed_2[1] += y * by_1
            speed_2[2] += z * by_1
        for at, speed, _ in bodies:
            at[0] += 0.01 * speed[0]
            at[1] += 0.01 * speed[1]
            at[2] += 0.01 * speed[2]
    return 1e6 * (time.process_time() - begun_s) / NBODY_STEPS


def at_nice(nice: int, *command: str) -> List[str]:
    """A command with this priority, also where sessions are groups of the scheduler."""
    lower = 'echo "$0" 2>/dev/null >/proc/self/autogroup; exec nice -n "$0" "$@"'
    return ["sh", "-c", lower, str(nice), *command]


class Robot(Bench):
    """The node with all topics subscribed, and its page with one client."""

    def __init__(self) -> None:
        super().__init__(at_nice(NICE, *NODE), full=True, hz=FRAMES_HZ)
        command = at_nice(NICE, *WEB, f"__ns:={self.spaces[0]}")
        self.nodes.append(Child("web_node", command, LOGS / "web_node.log", dict(os.environ), ROOT))
        assert wait_until(lambda: bool(self._links()), START_S), self.nodes[1].last_words()
        self._page = PageClient(self._links()[0])
        self._stop = rospy.ServiceProxy(f"{self.spaces[0]}/stop", Trigger)
        self._release = rospy.ServiceProxy(f"{self.spaces[0]}/release_stop", Trigger)

    def __enter__(self) -> "Robot":
        return self

    def __exit__(self, *how: object) -> None:
        self._page.close()
        super().__exit__(*how)

    def _links(self) -> List[str]:
        return re.findall(r"http://127\.0\.0\.1:\d+/", "\n".join(self.nodes[1].output()))

    def gaps_s(self) -> List[float]:
        """Times between two messages of `odom` while the robot drives."""
        self.feeder.rate(FRAMES_HZ)
        time.sleep(STILL_S)  # a pause has made the node greet its board anew
        with self.driving():
            self.arrived[0].clear()
            time.sleep(WATCHED_S)
            times = [at for at, _ in self.arrived[0]]
        return [later - earlier for earlier, later in zip(times, times[1:])]

    def stops_s(self, end: Callable[[float], float]) -> List[float]:
        """How long after `end` the board got the stop; `end` gets the time of the last command, and returns its own."""
        self.feeder.rate(FRAMES_HZ)
        ends = []
        for _ in range(STOPS):
            time.sleep(STILL_S)
            for _ in range(5):
                commanded_s = time.monotonic()
                self.drive(SPEED_M_S)
                time.sleep(COMMANDS_S)
            ends.append((commanded_s, end(commanded_s)))
        time.sleep(STILL_S)
        moves = self.feeder.pause()[0][1]
        stops = [
            [at for at, linear, _ in moves if at > commanded_s and not linear] for commanded_s, _ in ends
        ]
        assert all(stops), f"no stop after {stops.index([])} stops"
        return [times[0] - end_s for times, (_, end_s) in zip(stops, ends)]

    def emergency(self, _: float) -> float:
        """Call the emergency stop; when."""
        called_s = time.monotonic()
        assert self._stop().success and self._release().success
        return called_s

    def figures(self, condition: str) -> Figures:
        """Gaps between messages, and times to stops [ms]."""
        timeout = self.stops_s(lambda commanded_s: commanded_s + TIMEOUT_S)
        stop, gaps = self.stops_s(self.emergency), self.gaps_s()
        found = {
            "timeout_ms_median": statistics.median(timeout),
            "timeout_ms_worst": max(timeout),
            "emergency_ms_median": statistics.median(stop),
            "emergency_ms_worst": max(stop),
            "odom_gap_ms_p99": p99(gaps),
            "odom_gap_ms_worst": max(gaps),
        }
        return {f"{key}_{condition}": 1e3 * value for key, value in found.items()}

    def cpu_figures(self) -> Figures:
        """CPU of both nodes while the robot drives, here and estimated on a Pi 4: for a frame [ms], of a core [%]."""
        with self.driving():
            pids = [node.pid for node in self.nodes]
            begun_s, used = time.monotonic(), [processes.cpu_s(pid) for pid in pids]
            time.sleep(WATCHED_S)
            over_s = time.monotonic() - begun_s
            shares = [(processes.cpu_s(pid) - before_s) / over_s for pid, before_s in zip(pids, used)]
        step_us = nbody_us()
        found = {"nbody_us": step_us, "nbody_us_pi4": NBODY_PI4_US}
        for name, share in zip(("node", "web_node"), shares):
            for where, factor in ("", 1.0), ("_pi4", NBODY_PI4_US / step_us):
                found[f"{name}_frame_ms{where}"] = 1e3 * factor * share / FRAMES_HZ
                found[f"{name}_cpu_percent{where}"] = 100 * factor * share
        return found


@contextlib.contextmanager
def busy(nice: int) -> Iterator[None]:
    """Loops that compute without end."""
    endless = at_nice(nice, sys.executable, "-c", "while True: pass")
    loops = [Child("loop", endless, LOGS / "loop.log", dict(os.environ), ROOT) for _ in range(LOOPS)]
    try:
        yield
        assert all(loop.exit_code is None for loop in loops), "a loop ended before the stops"
    finally:
        for loop in loops:
            loop.finish(0.0)


@contextlib.contextmanager
def fifth(pids: Sequence[int]) -> Iterator[None]:
    """Each of these processes gets a fifth of a core; OSError where there are no control groups to write."""
    second = (GROUPS / "cgroup.controllers").exists()  # version 2
    parent, quota_us = GROUPS if second else GROUPS / "cpu", round(SHARE * PERIOD_US)
    limits: Dict[str, Any] = (
        {"cpu.max": f"{quota_us} {PERIOD_US}"}
        if second
        else {"cpu.cfs_period_us": PERIOD_US, "cpu.cfs_quota_us": quota_us}
    )
    made: List[Path] = []
    try:
        for pid in pids:
            made.append(parent / f"mrl-{pid}")
            made[-1].mkdir()
            for name, value in {**limits, "cgroup.procs": pid}.items():
                (made[-1] / name).write_text(str(value))
        yield
        for group in made:
            assert "nr_throttled 0\n" not in (group / "cpu.stat").read_text(), "nothing held it"
    finally:
        for pid, group in zip(pids, made):
            with contextlib.suppress(OSError):
                (parent / "cgroup.procs").write_text(str(pid))
                group.rmdir()


def figures() -> Dict[str, report.Measured]:
    found: Dict[str, report.Measured] = {}
    with Master(), Robot() as robot:
        found.update(report.by_key(report.repeat("CPU", CPU_RUNS, robot.cpu_figures)))
        found.update(robot.figures("alone"))
        try:
            with fifth([node.pid for node in robot.nodes]):
                found.update(robot.figures("fifth"))
        except OSError as error:
            print(f"no fifth of a core: {error}; run it as root", file=sys.stderr)
        for condition, nice in ("equal", NICE), ("preferred", LESS):
            with busy(nice):
                found.update(robot.figures(condition))
    return found
