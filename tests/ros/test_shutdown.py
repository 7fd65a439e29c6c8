"""However the node ends, the robot has stopped before; a master that dies, a simulated clock that stands still."""

import contextlib
import math
import os
import pty
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
import xmlrpc.client
from contextlib import suppress
from xmlrpc.client import ServerProxy

import pytest
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from rosgraph.masterapi import is_online
from rosgraph.xmlrpc import ThreadingXMLRPCServer

from ros1_bridge.node.master_watch import MasterWatch, await_master
from ros1_bridge.node.processes import Child
from tests.waiting import PATIENCE_S, require_median, wait_until

from . import rig as bench
from .rig import START_S, Rig

MOVE, STOP = 11, 13
STOP_S, EXIT_S = 0.1, 2.0
SIGNAL_S = 0.2  # A signal reaches the program within this time, and nothing shows that it has
LONG_S = 10.0  # Timeout of commands in these tests: the robot does not stop by itself


def started(rig):
    """A node with a board, and the tap on its wire."""
    wire = rig.tap(rig.board().port)
    node = rig.node(wire.port, f"_cmd_vel_timeout:={LONG_S}")
    rig.topic("odom", Odometry).wait()  # who publishes before it may have to pause first
    return node, wire


def drive(rig, wire):
    """Commands until the node drives."""
    since = time.monotonic()
    rig.drive_until(lambda: wire.first(MOVE, since) < math.inf)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, None])
def test_signal_or_rosnode_kill_stops_the_robot_and_ends_the_node(rig, number):
    node, wire = started(rig)
    drive(rig, wire)
    since = time.monotonic()
    if number is None:
        kill = ["rosnode", "kill", f"{rig.ns}/robot_node"]
        subprocess.run(kill, env=rig.env, capture_output=True, check=True)
    else:
        node.signal(number)
    assert node.wait(START_S)
    wire.wait_for(STOP, since)
    assert node.exit_code == 0
    assert not any("Traceback" in line for line in node.output())


@pytest.mark.realtime
def test_signal_stops_the_robot_and_ends_the_node_in_time(master, tmp_path):
    """The median of 3, which start together."""
    stops_s, ends_s = [], []
    with contextlib.ExitStack() as ends:
        nodes = []
        for number in range(3):
            folder = tmp_path / str(number)
            folder.mkdir()
            rig = ends.enter_context(contextlib.closing(Rig(folder, master)))
            nodes.append((rig, *started(rig)))
        for rig, node, wire in nodes:
            drive(rig, wire)
            since = time.monotonic()
            node.signal(signal.SIGTERM)
            assert node.wait(START_S)
            ends_s.append(time.monotonic() - since)
            stops_s.append(wire.wait_for(STOP, since) - since)
    require_median(stops_s, STOP_S, "the stop after a signal")
    require_median(ends_s, EXIT_S, "the end of the node")


@pytest.mark.parametrize("silent", [True, False], ids=["greeting", "waits for senders"])
def test_signal_while_the_node_begins_ends_it(rig, silent):
    """While nobody answers on the port, or while it hears who sends commands already."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    node = rig.node(os.ttyname(theirs) if silent else rig.board().port, "_cmd_vel_pause:=1.0")
    if silent:
        wait_until(lambda: select.select([ours], [], [], 0)[0], what="a byte")
    else:
        rig.publisher("cmd_vel", Twist)
    node.signal(signal.SIGINT)
    assert node.wait(START_S)
    assert (silent or node.exit_code == 0) and not any("Traceback" in line for line in node.output()), (
        node.output()
    )
    os.close(ours)
    os.close(theirs)


def test_node_takes_over_from_one_of_the_same_name(rig):
    """The master ends the first node when the second registers, while the port may still be in use."""
    port = rig.board().port
    first, odom = rig.node(port), rig.topic("odom", Odometry)
    odom.wait()
    # The last that a node registers: who registers after its successor ends it.
    rospy.wait_for_service(f"{rig.ns}/robot_node/sonars/set_parameters", START_S)
    second = rig.node(port)
    assert first.wait(START_S) and first.exit_code == 0
    wait_until(lambda: any(" on /dev/" in line for line in second.output()) or second.exit_code is not None)
    assert second.exit_code is None, second.last_words()
    odom.close()  # rospy may not connect to a publisher of the same name again
    rig.topic("odom", Odometry).wait(5)


class SlowMaster:
    """Passes calls on to a ROS master and keeps them; answers `method` only after `answers` is set."""

    def __init__(self, uri, method):
        self._uri, self._method, self.calls = uri, method, []
        self.called, self.answers = threading.Event(), threading.Event()
        self._server = ThreadingXMLRPCServer(("127.0.0.1", 0), log_requests=False)
        self._server.register_instance(self)
        self.uri = f"http://127.0.0.1:{self._server.server_address[1]}"
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))
        self._thread.start()

    def _dispatch(self, method, params):
        self.calls.append((method, params))
        if method == self._method:
            self.called.set()
            assert self.answers.wait(PATIENCE_S)
        with ServerProxy(self._uri) as master:
            return getattr(master, method)(*params)

    def close(self):
        self.answers.set()
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()


@pytest.fixture
def slow_master(rig):
    """Answers the registration of a subscriber late."""
    master = SlowMaster(rig.env["ROS_MASTER_URI"], "registerSubscriber")
    rig.env = {**rig.env, "ROS_MASTER_URI": master.uri}
    yield master
    master.close()


@pytest.mark.parametrize(
    "name, number",
    [("demo_view", signal.SIGINT), ("teleop_joystick", signal.SIGTERM), ("go_to_goal", signal.SIGINT)],
)
def test_signal_while_a_node_waits_for_the_master_ends_it(rig, slow_master, name, number):
    node = rig.program(name)
    assert slow_master.called.wait(PATIENCE_S)
    node.signal(number)
    time.sleep(SIGNAL_S)
    slow_master.answers.set()
    assert node.wait(START_S)
    assert node.exit_code == 0, node.output()
    assert not any("Traceback" in line for line in node.output())


LATE = """
import rospy
from std_msgs.msg import Empty
from ros1_bridge.node.run_node import node

def run(given):
    rospy.Publisher("early", Empty, queue_size=1)
    rospy.on_shutdown(lambda: rospy.Publisher("late", Empty, queue_size=1))
    rospy.signal_shutdown("the test has begun")

node("late", (), run)()
"""


def test_node_registers_nothing_from_the_begin_of_its_end(rig, slow_master):
    """If another node of its name is there, it is told to end, and a registration would end that one."""
    slow_master.answers.set()
    node = rig.start("late", sys.executable, "-c", LATE)
    assert node.wait(START_S) and node.exit_code == 0, node.output()
    registered = [params[1] for method, params in slow_master.calls if method == "registerPublisher"]
    assert "/early" in registered and "/late" not in registered


@pytest.fixture
def own_master(master, tmp_path):
    """A master beside that of the other tests, and its environment."""
    uri = f"http://127.0.0.1:{bench.free_port()}"
    env = {**master, "ROS_MASTER_URI": uri}
    child = Child(
        "master", ["rosmaster", "--core", "-p", uri.rsplit(":", 1)[1]], tmp_path / "master", env, bench.ROOT
    )
    wait_until(lambda: is_online(uri))
    yield child, env
    with suppress(ProcessLookupError):
        child.signal(signal.SIGKILL)
    child.finish(3.0)


@pytest.mark.parametrize("uri", ["localhost:11311", "", "http://localhost:port", "http://localhost:99999"])
def test_address_that_is_none_has_no_master(uri):
    assert "no ROS master answers" in MasterWatch(uri).look()


def test_program_that_comes_before_the_master_waits_for_it():
    port, told, ended = bench.free_port(), [], threading.Event()
    thread = threading.Thread(
        target=lambda: (await_master(f"http://127.0.0.1:{port}", told.append), ended.set()), daemon=True
    )
    thread.start()
    wait_until(lambda: bool(told))
    with socket.create_server(("127.0.0.1", port)):
        assert ended.wait(bench.START_S)
    assert len(told) == 1 and str(port) in told[0]


def test_robot_is_driven_on_and_stopped_without_master_and_clock(own_master, tmp_path):
    """Simulated time stands at zero all the while: a timer that used it would never stop the robot."""
    child, env = own_master
    parameters = xmlrpc.client.ServerProxy(env["ROS_MASTER_URI"])
    parameters.setParam("/test", "/use_sim_time", True)
    rig = bench.Rig(tmp_path, env)
    try:
        wire = rig.tap(rig.board().port)
        node = rig.node(wire.port, "_cmd_vel_timeout:=0.5", "_cmd_vel_pause:=0")  # the source never pauses
        wire.wait_for(STOP, 0.0)
        wait_until(lambda: any("nobody publishes /clock" in line for line in node.output()))
        parameters.deleteParam("/test", "/use_sim_time")
        words = ["pub", "-r", "20", f"{rig.ns}/cmd_vel", "geometry_msgs/Twist", "{linear: {x: 0.1}}"]
        source = rig.start("rostopic", "rostopic", *words)
        wait_until(lambda: wire.first(MOVE, 0.0) < float("inf"))
        child.signal(signal.SIGKILL)
        wait_until(lambda: any("no ROS master answers" in line for line in node.output()))
        wire.wait_for(MOVE, time.monotonic())
        source.signal(signal.SIGKILL)
        since = time.monotonic()
        wire.wait_for(STOP, since)
        assert node.exit_code is None
    finally:
        rig.close()
