"""The node for keys, on a terminal of its own."""

import os
import pty
import signal
import subprocess
import termios

import pytest
from geometry_msgs.msg import Twist

from tests.waiting import wait_until

from .rig import ROOT, START_S

NODE = ROOT / "ros1_bridge" / "nodes" / "teleop_keyboard"


@pytest.fixture
def keys(rig):
    """The node in a terminal; writes to `master` are its keys."""
    master, slave = pty.openpty()
    before = termios.tcgetattr(slave)
    command = [str(NODE), f"__ns:={rig.ns}", "_linear_speed:=0.2"]
    node = subprocess.Popen(
        command, stdin=slave, stdout=slave, stderr=slave, env=rig.env, start_new_session=True
    )
    rig.twists = rig.topic("cmd_vel", Twist)
    rig.twists.wait_for_publisher()
    wait_until(lambda: not termios.tcgetattr(slave)[3] & termios.ICANON)
    yield rig, node, master
    if node.poll() is None:
        node.kill()
    node.wait()
    assert termios.tcgetattr(slave) == before, "the terminal is not as it was"
    for fd in (master, slave):
        os.close(fd)


def test_keys_drive_until_they_are_let_go_and_q_ends(keys):
    """A key counts as held for 0.6 s; then one stop is sent, and nothing more."""
    rig, node, master = keys
    os.write(master, b"w\x1b[D")
    driving = rig.twists.wait(2)[1]
    assert (driving.linear.x, driving.angular.z) == (0.2, 0.9)
    wait_until(lambda: rig.twists.messages[-1] == Twist())
    assert rig.twists.messages.count(Twist()) == 1
    os.write(master, b"s")
    wait_until(lambda: rig.twists.messages[-1].linear.x == -0.2)
    os.write(master, b"q")
    assert node.wait(START_S) == 0
    wait_until(lambda: rig.twists.messages[-1] == Twist())


def test_ctrl_c_amid_driving_is_a_stop(keys):
    rig, node, master = keys
    os.write(master, b"w")
    rig.twists.wait(2)
    node.send_signal(signal.SIGINT)
    assert node.wait(START_S) == 0
    wait_until(lambda: rig.twists.messages[-1] == Twist())
