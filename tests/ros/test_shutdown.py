"""However the node ends, the robot has stopped before."""

import math
import signal
import subprocess
import time

import pytest
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from .rig import START_S

MOVE, STOP = 11, 13
STOP_LATE_S = 1.0
EXIT_S = 2.0 + 3.0
"""Patient for a busy machine, and far from the 5 s after which the robot would stop by itself."""


def driving(rig):
    """A node that drives, and the tap on its wire."""
    wire = rig.tap(rig.board().port)
    node = rig.node(wire.port, "_cmd_vel_timeout:=5.0")
    cmd_vel = rig.publisher("cmd_vel", Twist)
    since = time.monotonic()
    cmd_vel.publish(Twist(Vector3(0.2, 0, 0), Vector3()))
    assert wire.wait_for(MOVE, since) < math.inf
    return node, wire


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_stops_the_robot_and_ends_the_node(rig, number):
    node, wire = driving(rig)
    since = time.monotonic()
    node.signal(number)
    assert node.wait(START_S)
    assert wire.first(STOP, since) - since < STOP_LATE_S
    assert time.monotonic() - since < EXIT_S
    assert node.exit_code == 0
    assert not any("Traceback" in line for line in node.output())


def test_rosnode_kill_stops_the_robot(rig):
    node, wire = driving(rig)
    since = time.monotonic()
    subprocess.run(["rosnode", "kill", f"{rig.ns}/robot_node"], env=rig.env, capture_output=True, check=True)
    assert node.wait(START_S)
    assert wire.first(STOP, since) < math.inf
    assert node.exit_code == 0


def test_signal_during_the_greeting_ends_the_node(rig):
    """Nobody answers on a pty without a board."""
    silent = rig.silent_port()
    node = rig.node(silent.port)
    assert silent.wait_for_bytes(START_S)
    since = time.monotonic()
    node.signal(signal.SIGINT)
    assert node.wait(START_S)
    assert time.monotonic() - since < EXIT_S
    assert not any("Traceback" in line for line in node.output())


def test_board_that_goes_away_ends_the_node_with_its_own_code(rig):
    board = rig.board()
    node = rig.node(board.port, "_reconnect:=false")
    rig.topic("odom", Odometry).wait()
    board.child.signal(signal.SIGKILL)
    assert node.wait(START_S)
    assert node.exit_code == 6
    assert any("went away" in line for line in node.output())
