"""On Noetic nodes run on the system's packages: click is too old there, rich is missing."""

import pytest
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry

from tests.waiting import wait_until

PIPS_OWN = ("click", "platformdirs", "rich")
HIDE = "".join(f"sys.modules[{name!r}] = None\n" for name in PIPS_OWN)


@pytest.fixture
def bare_rig(rig, tmp_path):
    """A rig whose nodes cannot import what comes by pip."""
    path = [str(tmp_path), rig.env.get("PYTHONPATH", "")]
    (tmp_path / "sitecustomize.py").write_text(f"import sys\n{HIDE}")
    rig.bare_env = {**rig.env, "PYTHONPATH": ":".join(path)}
    return rig


def test_robot_node_drives_on_system_packages_alone(bare_rig):
    rig = bare_rig
    board = rig.board()
    rig.env = rig.bare_env
    rig.node(board.port)
    odometry = rig.topic("odom", Odometry)
    odometry.wait()
    command, cmd_vel = Twist(), rig.publisher("cmd_vel", Twist)
    command.linear.x = 0.2

    def has_moved():
        cmd_vel.publish(command)
        return odometry.messages[-1].pose.pose.position.x > 0.02

    wait_until(has_moved)


def test_modules_are_hidden_from_nodes(bare_rig):
    """What the test above rests on."""
    bare_rig.env = bare_rig.bare_env
    child = bare_rig.start("python", "/usr/bin/python3", "-c", "import click")
    wait_until(lambda: child.exit_code is not None)
    assert "import of click halted" in child.last_words()
