"""The node without ROS's own infrastructure: a master that dies, a simulated clock that stands still."""

import signal
import socket
import threading
import time
import xmlrpc.client
from contextlib import suppress

import pytest
from rosgraph.masterapi import is_online

from ros1_bridge.demo.processes import Child
from ros1_bridge.node.master_watch import MasterWatch, await_master
from tests.waiting import wait_until

from . import rig as bench

MOVE, STOP = 11, 13


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
        node = rig.node(wire.port, "_cmd_vel_timeout:=0.5")
        wire.wait_for(STOP, 0.0)
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
