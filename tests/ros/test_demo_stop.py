"""The demonstration's node `demo_view` ends with a stop on `cmd_vel`, whatever ends it."""

import signal
import sys

import pytest
from geometry_msgs.msg import Twist

from tests.waiting import wait_until

from .rig import ROOT, START_S

VIEW = ROOT / "ros1_bridge" / "nodes" / "demo_view"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_during_the_square_sends_a_stop(rig, number):
    commands = rig.topic("cmd_vel", Twist)
    rig.node(rig.board().port)
    view = rig.start("demo_view", sys.executable, str(VIEW), f"__ns:={rig.ns}", "_square:=true")
    wait_until(lambda: any(message != Twist() for message in commands.messages), START_S)
    view.signal(number)
    wait_until(lambda: view.exit_code is not None, START_S)
    wait_until(lambda: commands.messages[-1] == Twist(), 2.0)
