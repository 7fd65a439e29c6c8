"""A bench for nodes: emulated boards and nodes as processes, a tap on the wire, topics as lists."""

import contextlib
import itertools
import os
import pty
import re
import select
import signal
import sys
import threading
import time
import tty
from pathlib import Path
from typing import Any, Callable, Dict, Iterable, Iterator, List, NamedTuple, Optional, Tuple
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
from geometry_msgs.msg import Twist, Vector3
from rosgraph_msgs.msg import Clock

from ros1_bridge.node.processes import Child, free_port  # noqa: F401
from tests.waiting import PATIENCE_S, wait_until

ROOT = Path(__file__).resolve().parent.parent.parent
NODE = ROOT / "ros1_bridge" / "nodes" / "robot_node"
START_S = PATIENCE_S


class Board(NamedTuple):
    """An emulated board: the port it serves, and the file that holds its true pose."""

    port: str
    truth: Path
    child: Child


class Tap:
    """Passes bytes between a node and a board, and notes when the node sent what."""

    def __init__(self, board_port: str) -> None:
        self.sent: List[Tuple[float, bytes]] = []
        self._node, slave = pty.openpty()
        tty.setraw(slave)
        self._slave = slave
        self.port = os.ttyname(slave)
        self._board = os.open(board_port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._board)
        self._end, self._wake = os.pipe()
        self._thread = threading.Thread(target=self._pass_on, daemon=True)
        self._thread.start()

    def _pass_on(self) -> None:
        while True:
            ready, _, _ = select.select([self._node, self._board, self._end], [], [])
            if self._end in ready:
                return
            if self._node in ready:
                data = os.read(self._node, 4096)
                self.sent.append((time.monotonic(), data))
                os.write(self._board, data)
            if self._board in ready:
                os.write(self._node, os.read(self._board, 4096))

    def close(self) -> None:
        """Stop passing on."""
        os.close(self._wake)
        self._thread.join()
        for fd in (self._node, self._slave, self._board, self._end):
            os.close(fd)

    def first(self, code: int, since_s: float) -> float:
        """When the node first sent a command after a time; infinity if it did not."""
        start = f"@{code}".encode()
        return next((at for at, data in self.sent if at >= since_s and _holds(data, start)), float("inf"))

    def last(self, code: int) -> float:
        """When the node last sent a command; minus infinity if it did not."""
        start = f"@{code}".encode()
        return max((at for at, data in list(self.sent) if _holds(data, start)), default=float("-inf"))

    def wait_for(self, code: int, since_s: float) -> float:
        """The same as `first`, waiting for it."""
        wait_until(lambda: self.first(code, since_s) < float("inf"), what=f"command {code}")
        return self.first(code, since_s)


def _holds(data: bytes, start: bytes) -> bool:
    return any(start + end in data for end in (b",", b"e"))


def values_of(status: Any) -> Dict[str, str]:
    """The values of a diagnostic_msgs/DiagnosticStatus by their keys."""
    return {pair.key: pair.value for pair in status.values}


class Topic:
    """The messages of a topic with their arrival times."""

    def __init__(self, name: str, kind: type, **options: Any) -> None:
        self.arrived: List[Tuple[float, Any]] = []
        self._subscriber = rospy.Subscriber(name, kind, self._take, tcp_nodelay=True, **options)

    def _take(self, message: Any) -> None:
        self.arrived.append((time.monotonic(), message))

    @property
    def messages(self) -> List[Any]:
        """All so far."""
        return [message for _, message in self.arrived]

    def wait(self, count: int = 1) -> List[Any]:
        """Wait until there are `count`, and return all."""
        wait_until(lambda: len(self.arrived) >= count, what=f"message {count} of {self._subscriber.name}")
        return self.messages

    def wait_for_more(self, count: int) -> List[Any]:
        """Wait for so many from now on, and return them."""
        begin = len(self.arrived)
        return self.wait(begin + count)[begin:]

    def wait_for_publisher(self) -> None:
        """Wait until a node that publishes it has us among its subscribers: what it says from now on arrives."""
        wait_until(self._served, step_s=0.02, what=f"a publisher of {self._subscriber.name}")

    def _served(self) -> bool:
        """Our own end counts as connected before the other one knows of it, so the publishers are asked."""
        name, master = self._subscriber.name, rosgraph.Master(rospy.get_name())
        nodes = dict(master.getSystemState()[0]).get(name, [])
        with contextlib.suppress(OSError, rosgraph.MasterException):  # a node that has ended
            links = [link for node in nodes for link in links_of(master.lookupNode(node))]
            return any(
                (peer, way, topic) == (rospy.get_name(), "o", name) for _, peer, way, _, topic, *_ in links
            )
        return False

    def close(self) -> None:
        """Unsubscribe."""
        self._subscriber.unregister()


def links_of(node_uri: str) -> List[List[Any]]:
    """The connections of a node: number, peer, direction, transport, topic."""
    answer: Any = ServerProxy(node_uri).getBusInfo(rospy.get_name())
    return list(answer[2])


_LEFT_WHILE_IT_CONNECTED = re.compile(
    r".*Inbound TCP/IP connection failed.*(\nTraceback.*(\n .*)+\n.*ROSHandshakeException.*)?"
)


_HELD_UP = ("the board is silent", "no reading of the IMU for", "does not exist")
"""What the node says when the emulator's process was held up for 0.3 s or for 0.1 s, or has not made its port yet."""


def without_a_busy_machine(lines: Iterable[str]) -> str:
    """What nodes said, without what they say on a busy machine.

    There rospy itself leaves before it was served: it connects twice when two updates of the publishers come at once,
    and drops one connection.
    """
    said = "\n".join(line for line in lines if not any(words in line for words in _HELD_UP))
    return _LEFT_WHILE_IT_CONNECTED.sub("", said)


def end(child: Child) -> None:
    """Ask a program to end, and make it."""
    child.signal(signal.SIGTERM)
    child.finish(5.0)


class Rig:
    """Starts parts and ends them all; topics of each rig have a namespace of their own."""

    numbers = itertools.count(1)

    def __init__(self, folder: Path, env: Dict[str, str]) -> None:
        self.ns = f"/rig_{os.getpid()}_{next(self.numbers)}"
        self.name = self.ns.strip("/")
        self._folder, self.env = folder, env
        self._ends: List[Callable[[], None]] = []
        self._cmd_vel: Any = None

    def wall_clock(self, patch: Any) -> Callable[[float], None]:
        """What sets the wall clock of this process, and of Python programs that start from now on, ahead [s]."""
        folder, real = self._folder / "clock", time.time
        folder.mkdir()
        ahead, new = folder / "ahead", folder / "new"

        def set_ahead(ahead_s: float) -> None:
            new.write_text(f"{ahead_s}")
            new.replace(ahead)

        (folder / "sitecustomize.py").write_text(
            "import pathlib, time\nreal = time.time\n"
            f"time.time = lambda: real() + float(pathlib.Path({str(ahead)!r}).read_text())\n"
        )
        set_ahead(0.0)
        self.env = {**self.env, "PYTHONPATH": f"{folder}:{self.env.get('PYTHONPATH', '')}"}
        patch.setattr(time, "time", lambda: real() + float(ahead.read_text()))
        return set_ahead

    @contextlib.contextmanager
    def simulated_time(self) -> Iterator[Callable[..., rospy.Time]]:
        """Nodes that start inside follow a `/clock`; this process keeps its own time.

        Gives what sets that clock, 0.1 s ahead or to a time [s], and returns its time; it works after the end, too.
        """
        rospy.set_param("/use_sim_time", True)
        clock, now_s = rospy.Publisher("/clock", Clock, queue_size=10, latch=True), [1000.0]
        self._ends.append(clock.unregister)

        def tick(set_s: Optional[float] = None) -> rospy.Time:
            now_s[0] = now_s[0] + 0.1 if set_s is None else set_s
            now = rospy.Time.from_sec(now_s[0])
            clock.publish(Clock(now))
            return now

        tick()
        try:
            yield tick
        finally:
            rospy.delete_param("/use_sim_time")

    def start(self, name: str, *command: str) -> Child:
        """Start a program."""
        child = Child(name, command, self._folder / f"{name}_{len(self._ends)}.log", self.env, ROOT)
        self._ends.append(lambda: end(child))
        return child

    def board(self, *options: str) -> Board:
        """Start an emulated board, a TraxBot unless told otherwise."""
        truth = self._folder / f"truth_{len(self._ends)}"
        command = [
            sys.executable,
            "-m",
            "sim_arduino.serve.main",
            "--truth",
            str(truth),
            *(options or ("--robot", "traxbot")),
        ]
        child = self.start("mrl-sim", *command)
        wait_until(lambda: bool(child.output()) or child.exit_code is not None)
        assert child.exit_code is None, child.last_words()
        return Board(child.output()[0].split()[0], truth, child)

    def tap(self, port: str) -> Tap:
        """Put a tap on a port."""
        tap = Tap(port)
        self._ends.append(tap.close)
        return tap

    def node(self, port: Optional[str], *options: str) -> Child:
        """Start the robot node in the rig's namespace, with frames that carry the rig's name."""
        frames = [f"_odom_frame:={self.name}/odom", f"_base_frame:={self.name}/base_link"]
        given = [f"_port:={port}"] if port else []
        return self.start("robot_node", str(NODE), f"__ns:={self.ns}", *given, *frames, *options)

    def program(self, name: str, *options: str, ns: str = "") -> Child:
        """Start another of the bridge's nodes, in the rig's namespace or another."""
        return self.start(name, str(NODE.with_name(name)), f"__ns:={ns or self.ns}", *options)

    def drive_until(
        self, condition: Callable[[], Any], linear_m_s: float = 0.2, lateral_m_s: float = 0.0
    ) -> None:
        """Publish a command every 40 ms until something is so.

        Each 5 s a second is left out: if a busy computer has held up telemetry for a second, a source must pause.
        """
        self._cmd_vel, begin_s = self._cmd_vel or self.publisher("cmd_vel", Twist), time.monotonic()

        def holds() -> Any:
            if (time.monotonic() - begin_s) % 6.0 < 5.0:
                self._cmd_vel.publish(Twist(Vector3(linear_m_s, lateral_m_s, 0.0), Vector3()))
            return condition()

        wait_until(holds, step_s=0.04)

    def topic(self, name: str, kind: type, **options: Any) -> Topic:
        """Subscribe; a relative name is one of the rig's namespace."""
        topic = Topic(name if name.startswith("/") else f"{self.ns}/{name}", kind, **options)
        self._ends.append(topic.close)
        return topic

    def publisher(self, name: str, kind: type) -> rospy.Publisher:
        """Advertise in the rig's namespace, and wait for the node to subscribe."""
        publisher = rospy.Publisher(f"{self.ns}/{name}", kind, queue_size=10, tcp_nodelay=True)
        self._ends.append(publisher.unregister)
        wait_until(lambda: publisher.get_num_connections() > 0)
        return publisher

    def close(self) -> None:
        """End everything, the last started first."""
        for undo in reversed(self._ends):
            undo()
