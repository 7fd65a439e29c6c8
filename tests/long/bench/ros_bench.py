"""The parts of `bench_ros`: master, feeder, node or reference, and this process as subscriber."""

import contextlib
import itertools
import os
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any, Dict, Iterable, Iterator, List, Optional, Tuple

import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry
from rosgraph.masterapi import is_online
from sensor_msgs.msg import BatteryState, Imu, JointState, Range
from tf2_msgs.msg import TFMessage

from ros1_bridge.node.processes import Child, wait_until
from tests.long.bench import figures, processes, report
from tests.long.bench.feeder import METRES_PER_COUNT
from tests.long.programs import Program
from tests.ros.rig import free_port

ROOT = figures.ROOT
LOGS = ROOT / "build" / "bench" / "ros"
NODE = [str(ROOT / "ros1_bridge" / "nodes" / "robot_node")]
BARE = ["/usr/bin/python3", str(ROOT / "tests" / "long" / "bench" / "bare_rospy.py")]
SPEED_M_S, RAMP_S, FASTEST_MM_S, STEPS = report.either((0.3, 2.0, 290, 200), (0.1, 0.6, 90, 50))
"""What is driven, the time to reach it, and single commands, each 1 mm/s slower than the one before."""
COMMANDS_S = 0.1  # Driven with commands this far apart
START_S = 30.0
LEARN_S = 2.0  # A robot with an IMU stands this long at first: the driver learns the bias of its gyro
SETTLED_S = report.either(5.0, 0.2)  # The node orders its memory so long after its start
FULL = {
    "sonar/front": Range,
    "sonar/left": Range,
    "sonar/right": Range,
    "joint_states": JointState,
    "battery_state": BatteryState,
}


class Master:
    """A ROS master of this benchmark's own, on localhost, with this process as a node."""

    def __init__(self) -> None:
        LOGS.mkdir(parents=True, exist_ok=True)
        port = free_port()
        uri = f"http://127.0.0.1:{port}"
        os.environ.update(ROS_MASTER_URI=uri, ROS_IP="127.0.0.1", ROS_LOG_DIR=str(LOGS))
        command = ["rosmaster", "--core", "-p", str(port)]
        self._child = Child("rosmaster", command, LOGS / "rosmaster.log", dict(os.environ), ROOT)
        assert wait_until(lambda: is_online(uri), START_S), self._child.last_words()
        rospy.init_node("bench", disable_signals=True)

    def __enter__(self) -> "Master":
        return self

    def __exit__(self, *_: object) -> None:
        rospy.signal_shutdown("done")
        self._child.signal(signal.SIGTERM)
        self._child.finish(3.0)


Notes = List[Tuple[List[Tuple[float, int]], List[Tuple[float, int, int]]]]
"""For each board when each frame went, with its count, and when which moves came."""


class Feeder(Program):
    """The process that plays the boards."""

    def __init__(self, boards: int, imu: bool) -> None:
        command = [sys.executable, "-m", "tests.long.bench.feeder", str(boards), *["imu"] * imu]
        super().__init__(command, LOGS / "feeder.log")
        self.ports: List[str] = self.await_word("ready", True)["ports"]

    def rate(self, hz: float) -> None:
        """Stream at this rate, and note anew."""
        self.ask(f"rate {hz}")

    def pause(self) -> Notes:
        """End the stream; what was noted."""
        notes: Notes = self.ask("pause")["notes"]
        return notes


class Bench:
    """A feeder with a node, or the reference, on each of its boards, and subscribers."""

    numbers = itertools.count(1)

    def __init__(
        self,
        program: List[str],
        boards: int = 1,
        full: bool = False,
        hz: float = 50.0,
        imu: Optional[str] = None,
    ) -> None:
        """`full` subscribes to every topic, `imu` to that topic of an IMU, which the boards then have."""
        number = next(self.numbers)
        self.feeder = Feeder(boards, imu is not None)
        self.spaces = [f"/bench{number}_{i}" for i in range(boards)]
        self.arrived: List[List[Tuple[float, float]]] = [[] for _ in range(boards)]
        self.feeder.rate(hz)
        commands = [
            [*program, f"__ns:={ns}", f"_port:={port}"] for ns, port in zip(self.spaces, self.feeder.ports)
        ]
        self.nodes = [
            Child("node", command, LOGS / f"node{i}.log", dict(os.environ), ROOT)
            for i, command in enumerate(commands)
        ]
        self._subscribers = [
            rospy.Subscriber(f"{ns}/odom", Odometry, self._take, callback_args=i, tcp_nodelay=True)
            for i, ns in enumerate(self.spaces)
        ]
        self._subscribers.append(rospy.Subscriber("/tf", TFMessage, lambda _: None, tcp_nodelay=True))
        if full:
            topics = {f"{ns}/{name}": kind for ns in self.spaces for name, kind in FULL.items()}
            topics["/diagnostics"] = DiagnosticArray
            for name, kind in topics.items():
                self._subscribers.append(rospy.Subscriber(name, kind, lambda _: None, tcp_nodelay=True))
        if imu is not None:
            self.readings: List[Any] = []
            for ns in self.spaces:
                self._subscribers.append(
                    rospy.Subscriber(f"{ns}/{imu}", Imu, self.readings.append, tcp_nodelay=True)
                )
        self._bare = program is BARE
        self._commands = [
            rospy.Publisher(f"{ns}/cmd_vel", Twist, queue_size=10, tcp_nodelay=True) for ns in self.spaces
        ]
        came = wait_until(
            lambda: all(len(each) > 20 for each in self.arrived) and (imu is None or bool(self.readings)),
            START_S,
        )
        assert came, self.nodes[0].last_words()
        time.sleep(1.0 if imu is None else LEARN_S)

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *_: object) -> None:
        for node in self.nodes:
            node.signal(signal.SIGINT)
        for node in self.nodes:
            node.finish(5.0)
        for subscriber in self._subscribers:
            subscriber.unregister()
        for publisher in self._commands:
            publisher.unregister()
        self.feeder.end()

    def _take(self, message: Any, board: int) -> None:
        self.arrived[board].append((time.monotonic(), message.pose.pose.position.x))

    def drive(self, linear_m_s: float) -> None:
        for publisher in self._commands:
            publisher.publish(Twist(Vector3(linear_m_s, 0, 0), Vector3()))

    @contextlib.contextmanager
    def driving(self) -> Iterator[None]:
        """All robots drive ahead, with commands at 10 Hz."""
        end = threading.Event()

        def command() -> None:
            while not end.wait(COMMANDS_S):
                self.drive(SPEED_M_S)

        thread = threading.Thread(target=command)
        thread.start()
        try:
            time.sleep(RAMP_S)
            yield
        finally:
            end.set()
            thread.join()

    def latencies_s(self, hz: float, seconds: float) -> List[List[float]]:
        """Frame on the pty to message here while the robot drives, for each board, in the order of the frames."""
        self.feeder.rate(hz)
        with self.driving():
            self.feeder.rate(hz)
            for each in self.arrived:
                each.clear()
            time.sleep(seconds)
            notes = self.feeder.pause()
        time.sleep(0.5)
        return [self._matched(written, arrived) for (written, _), arrived in zip(notes, self.arrived)]

    def command_latencies_s(self, rounds: int) -> List[float]:
        """Command published here to frame on the pty.

        Speeds go down step by step, each once, so that a frame tells its command and no ramp comes between.
        """
        found: List[float] = []
        for _ in range(rounds):
            self.feeder.rate(50.0)
            time.sleep(1.0)  # the pause has made the node greet its board anew
            for _ in range(round(RAMP_S / 0.02)):  # up to full speed
                self.drive(SPEED_M_S)
                time.sleep(0.02)
            sent = {}
            for speed in range(FASTEST_MM_S, FASTEST_MM_S - STEPS, -1):
                time.sleep(0.0131)
                sent[speed] = time.monotonic()
                self.drive(speed / 1000)
            time.sleep(0.1)
            moves = self.feeder.pause()[0][1]
            for speed, at in sent.items():
                came = [arrival for arrival, linear, _ in moves if linear == speed and arrival > at]
                found += [came[0] - at] if came else []
        return found

    def cpu_percent(self, seconds: float) -> float:
        """CPU share of the first node while the robot drives, at the rate in force [%]."""
        with self.driving():
            time.sleep(SETTLED_S)
            begin_s, used_s = time.monotonic(), self._cpu_s()
            time.sleep(seconds)
            return 100 * (self._cpu_s() - used_s) / (time.monotonic() - begin_s)

    def rss_mib(self) -> float:
        return processes.rss_mib(self._pid())

    def _pid(self) -> int:
        return self.nodes[0].pid

    def _cpu_s(self) -> float:
        """Time on a processor so far, of all threads; the scheduler's own count, for ticks are too coarse."""
        tasks = Path(f"/proc/{self._pid()}/task")
        return sum(int((task / "schedstat").read_text().split()[0]) for task in tasks.iterdir()) / 1e9

    def _matched(self, written: List[Tuple[float, int]], arrived: List[Tuple[float, float]]) -> List[float]:
        """Delays of the frames that arrived, of each place the first; the last frame gave the last message.

        A place is the count of a node's pose; the bare loop has the number of the frame in its stead.
        """
        places = range(len(written)) if self._bare else [count for _, count in written]
        sent, came = (
            _first(places, written),
            _first([round(x / (1.0 if self._bare else METRES_PER_COUNT)) for _, x in arrived], arrived),
        )
        offset = max(sent, default=0) - max(came, default=0)
        return [at - sent[place + offset] for place, at in came.items() if place + offset in sent]


def _first(places: Iterable[int], notes: Iterable[Tuple[float, Any]]) -> Dict[int, float]:
    first: Dict[int, float] = {}
    for place, (at, _) in zip(places, notes):
        first.setdefault(place, at)
    return first
