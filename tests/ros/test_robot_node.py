"""The node on an emulated board: topics, frames, commands."""

import time

import pytest
from geometry_msgs.msg import Twist, Vector3
from nav_msgs.msg import Odometry

from tests.waiting import require_median, wait_until

from .rig import START_S

MOVE = 11
AT_ONCE_S = 0.05


def forward(speed_m_s):
    return Twist(Vector3(speed_m_s, 0.0, 0.0), Vector3())


@pytest.mark.realtime
def test_command_is_on_the_wire_at_once(rig):
    """The median of 9."""
    wire, odom, lates_s = rig.tap(rig.board().port), rig.topic("odom", Odometry), []
    rig.node(wire.port)
    odom.wait()
    cmd_vel = rig.publisher("cmd_vel", Twist)
    for _ in range(9):
        time.sleep(0.02)  # commands that come at once were held back by a network
        since = time.monotonic()
        cmd_vel.publish(forward(0.1))
        lates_s.append(wire.wait_for(MOVE, since) - since)
    require_median(lates_s, AT_ONCE_S, "a command's way to the wire")


@pytest.mark.parametrize(
    "options, exit_code, words",
    [
        ((None,), 2, "/port is missing, expected"),
        (("/dev/not_there",), 3, "does not exist"),
    ],
    ids=["no port", "port not there"],
)
def test_bad_parameter_ends_the_node_with_one_line(rig, options, exit_code, words):
    node = rig.node(*options)
    assert node.wait(START_S)
    assert node.exit_code == exit_code
    assert len(node.output()) == 1
    assert words in node.output()[0]


def test_node_waits_for_a_port_that_is_there_and_cannot_be_opened_yet(rig, tmp_path):
    name, board, odometry = tmp_path / "port", rig.board(), rig.topic("odom", Odometry)
    name.write_text("")
    node = rig.node(str(name), "_port_timeout:=300")
    wait_until(lambda: any("is a file, expected a serial port" in line for line in node.output()))
    (tmp_path / "link").symlink_to(board.port)
    (tmp_path / "link").replace(name)
    odometry.wait()
