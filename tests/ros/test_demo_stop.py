"""The demonstration's node `demo_view` sends a stop on `cmd_vel` at its end."""

import signal

import pytest
from geometry_msgs.msg import Twist, TwistStamped
from nav_msgs.msg import Odometry

from tests.waiting import wait_until

from .rig import START_S


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_during_the_square_sends_a_stop(rig, number):
    rig.node(rig.board().port)
    rig.topic("odom", Odometry).wait()
    commands = rig.topic("cmd_vel/stamped", TwistStamped)
    view = rig.program("demo_view", "_square:=true")
    wait_until(lambda: any(message.twist != Twist() for message in commands.messages), START_S)
    view.signal(number)
    wait_until(lambda: view.exit_code is not None, START_S)
    wait_until(lambda: commands.messages[-1].twist == Twist(), 2.0)
