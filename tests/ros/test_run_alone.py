"""`make run` keeps to a ROS master of its own: it drives nobody else's robot, and nobody ends it."""

import os
import signal
import xmlrpc.client
from types import SimpleNamespace

import pytest
import rospy
from geometry_msgs.msg import Twist

from ros1_bridge.demo.launcher import RunError, require_alone

from .test_run import PYTHON, starting

URI = "ROS_MASTER_URI="


def nodes_on(uri):
    """Names of all nodes that publish, subscribe or serve on a master."""
    with xmlrpc.client.ServerProxy(uri) as proxy:
        state = proxy.getSystemState("/tests")[2]
    return {node for kind in state for _, nodes in kind for node in nodes}


def uri_of(run):
    """The master that a run names, read from its output."""
    return next(line.split(URI)[1].split()[0] for line in run.process.stdout if URI in line)


@pytest.fixture(scope="module")
def pair(tmp_path_factory, master):
    """Two runs at once where a master is there already: their masters, nodes, logs and ends."""
    folder = tmp_path_factory.mktemp("pair") / "run"
    with starting(folder, master) as starter:
        runs = [starter(*PYTHON) for _ in range(2)]
        uris = [uri_of(run) for run in runs]
        for run in runs:
            run.wait_for_odometry()
        nodes = [nodes_on(uri) for uri in uris]
        foreign = nodes_on(master["ROS_MASTER_URI"])
        for run in runs:
            run.process.send_signal(signal.SIGINT)
        outputs = [run.end() for run in runs]
        codes = [run.process.returncode for run in runs]
        alive = [run.alive() for run in runs]
        logs = list(folder.glob("*/roslaunch.log"))
        yield SimpleNamespace(
            uris=uris, nodes=nodes, foreign=foreign, outputs=outputs, codes=codes, alive=alive, logs=logs
        )


def test_two_runs_at_once_both_drive_until_they_are_interrupted(pair):
    assert pair.codes == [130, 130], pair.outputs


def test_interrupt_ends_everything(pair):
    assert pair.alive == [[], []]


def test_run_names_the_master_that_its_node_is_on(pair):
    assert all("/robot_node" in nodes for nodes in pair.nodes)


def test_each_run_has_a_master_of_its_own(pair, master):
    assert len({*pair.uris, master["ROS_MASTER_URI"]}) == 3


def test_run_stays_off_the_master_of_the_environment(pair):
    assert not {"/robot_node", "/demo_view"} & pair.foreign


def test_two_runs_at_once_keep_their_logs_apart(pair):
    assert len(pair.logs) == 2


def test_master_with_another_node_is_refused(master):
    publisher = rospy.Publisher("/somebody/cmd_vel", Twist, queue_size=1)
    with pytest.raises(RunError, match=f"{rospy.get_name()}.*expected no other node"):
        require_alone(os.environ["ROS_MASTER_URI"])
    publisher.unregister()
