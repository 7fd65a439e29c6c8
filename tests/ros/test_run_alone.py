"""`make run` keeps to a ROS master of its own: it drives nobody else's robot, and nobody else ends it."""

import os
import signal
import xmlrpc.client
from pathlib import Path
from types import SimpleNamespace

import pytest
import rospy

from ros1_bridge.demo.launcher import Run, RunError, environment, free_port, start_nodes
from ros1_bridge.demo.processes import Child
from tests.waiting import PATIENCE_S

from .test_run import PYTHON, starting

URI = "ROS_MASTER_URI="


def nodes_on(uri):
    """Names of all nodes that publish, subscribe or serve on a master."""
    with xmlrpc.client.ServerProxy(uri) as proxy:
        state = proxy.getSystemState("/tests")[2]
    return {node for kind in state for _, nodes in kind for node in nodes}


def uri_of(run):
    """The master that a run names, read from its output."""
    return run.wait_for(URI).split(URI)[1].split()[0]


@pytest.fixture(scope="module")
def pair(tmp_path_factory, master):
    """Two runs at once where a master is there already: their masters, nodes, logs and ends.

    The first one is interrupted, and the emulated board of the second is killed.
    """
    folder = tmp_path_factory.mktemp("pair") / "run"
    with starting(folder, master) as starter:
        runs = [starter(*PYTHON) for _ in range(2)]
        uris = [uri_of(run) for run in runs]
        for run in runs:
            run.wait_for_odometry()
        nodes = [nodes_on(uri) for uri in uris]
        foreign = nodes_on(master["ROS_MASTER_URI"])
        runs[0].process.send_signal(signal.SIGINT)
        os.kill(runs[1].named("sim_board"), signal.SIGKILL)
        outputs = [run.end() for run in runs]
        codes = [run.process.returncode for run in runs]
        alive = [run.alive() for run in runs]
        logs = list(folder.glob("*/roslaunch.log"))
        yield SimpleNamespace(
            uris=uris, nodes=nodes, foreign=foreign, outputs=outputs, codes=codes, alive=alive, logs=logs
        )


def test_two_runs_at_once_have_master_and_logs_each_and_stay_off_that_of_the_environment(pair, master):
    assert len({*pair.uris, master["ROS_MASTER_URI"]}) == 3 and len(pair.logs) == 2
    assert ["/robot_node" in nodes for nodes in pair.nodes] == [True, True]
    assert not {"/robot_node", "/demo_view"} & pair.foreign


def test_interrupt_and_death_of_a_part_end_everything_with_a_code(pair):
    assert pair.codes[0] == 130 and pair.codes[1] in (6, 137), pair.outputs
    assert "ended with exit code" in pair.outputs[1] and pair.alive == [[], []]


def test_the_words_of_a_part_that_ended_are_its_last_line_without_colours(tmp_path):
    script = r"printf 'usage: x\n  [--y]\nx: error: \033[31mno y\033[0m\n====\033[0m\n'; exit 2"
    child = Child("x", ("sh", "-c", script), tmp_path / "x.log", dict(os.environ), tmp_path)
    child.finish(PATIENCE_S)
    assert child.last_words() == f"x ended with exit code 2: x: error: no y (its log is {child.log})"


def test_master_that_is_there_already_is_refused(master, tmp_path):
    """Its nodes would get the commands."""
    port = int(master["ROS_MASTER_URI"].rsplit(":", 1)[1])
    run = Run(environment(tmp_path, port), tmp_path)
    rospy.set_param("/run_id", "of another roscore")
    try:
        with pytest.raises(RunError, match="run_id on parameter server does not match"):
            start_nodes(run, "port:=none")
    finally:
        run.stop()
        rospy.delete_param("/run_id")
    assert not rospy.has_param("/robot_node")


def test_each_master_has_a_home_of_its_own(tmp_path):
    """Two masters that make one home at the same time end with an error."""
    assert environment(tmp_path, 20001)["ROS_HOME"] != environment(tmp_path, 20002)["ROS_HOME"]


def test_port_of_the_master_is_none_that_connections_get():
    """Another program would take it now and then, before roscore does."""
    first = int(Path("/proc/sys/net/ipv4/ip_local_port_range").read_text().split()[0])
    assert all(free_port() < first for _ in range(10))
