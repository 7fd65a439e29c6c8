"""The demonstration's node `demo_view`: on any terminal, and with a stop on `cmd_vel` at its end, whatever ends it."""

import os
import pty
import select
import signal
import subprocess
import sys
import time

import pytest
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry

from tests.waiting import wait_until

from .rig import ROOT, START_S

VIEW = ROOT / "ros1_bridge" / "nodes" / "demo_view"


@pytest.fixture(scope="module")
def robot(module_rig):
    """The rig of a robot that sends odometry."""
    module_rig.node(module_rig.board().port)
    module_rig.topic("odom", Odometry).wait()
    return module_rig


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_during_the_square_sends_a_stop(robot, number):
    commands = robot.topic("cmd_vel/stamped", TwistStamped)
    view = robot.start("demo_view", sys.executable, str(VIEW), f"__ns:={robot.ns}", "_square:=true")
    wait_until(lambda: any(message.twist != Twist() for message in commands.messages), START_S)
    view.signal(number)
    wait_until(lambda: view.exit_code is not None, START_S)
    wait_until(lambda: commands.messages[-1].twist == Twist(), 2.0)


def shown(user, seen, words, count=1):
    """Reads the terminal until it has shown `words` that often; all that it has shown."""
    until_s = time.monotonic() + START_S
    while seen.count(words) < count:
        assert select.select([user], [], [], max(0.0, until_s - time.monotonic()))[0], seen
        seen += os.read(user, 65536)
    return seen


@pytest.mark.parametrize("variable", [{"TERM": "dumb"}, {"PYTHONIOENCODING": "iso-8859-1"}], ids=str)
def test_terminal_that_cannot_show_the_view_gets_a_line_a_second(robot, variable, tmp_path):
    """It lacks a cursor that moves, or the view's characters.  The log is elsewhere: rospy colours its warnings."""
    user, program = pty.openpty()
    command = [sys.executable, str(VIEW), f"__ns:={robot.ns}"]
    env = {**robot.env, "TERM": "xterm", **variable}
    with (tmp_path / "log").open("w") as log:
        view = subprocess.Popen(command, env=env, stdin=program, stdout=program, stderr=log)
    os.close(program)
    with view:
        try:
            seen = shown(user, b"", b" s  x ", 2)
            view.terminate()
            seen = shown(user, seen, b"ran ")
            assert view.wait(START_S) == 0 and b"\x1b[" not in seen, seen
        finally:
            view.kill()
            os.close(user)
