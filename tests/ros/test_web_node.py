"""The page's node between a page and robot_node, which is on an emulated board."""

import contextlib
import json
import re
import signal
import socket
import sys
import time
from types import SimpleNamespace
from unittest import mock
from urllib.parse import urlsplit

import pytest
import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from ros1_bridge.web.web_node import NodeServices, too_slow
from tests.waiting import wait_until
from tests.web.stalling_proxy import StallingProxy

from .page_client import PageClient
from .rig import ROOT
from .tables import Offered

COMMAND = re.compile(rb"@11,(-?\d+),|@13[,e]")  # A motion command with its speed [mm/s], or a stop
LOOK_PIECES = 14  # With so many pieces, the node has asked the master for both services since they are there
WEB_NODE = str(ROOT / "ros1_bridge" / "nodes" / "web_node")


@pytest.fixture(scope="module")
def robot(module_rig, tmp_path_factory):
    """The rig with both nodes, and a page that has the helm."""
    rig = module_rig
    rig.board_ = rig.board()
    rig.wire = rig.tap(rig.board_.port)
    rig.process = rig.node(rig.wire.port, "_cmd_vel_timeout:=0.5")
    rig.folder = tmp_path_factory.mktemp("bags")
    given = "_listen:=127.0.0.1:0", "_robot:=traxbot", f"_recordings:={rig.folder}"
    rig.master = StallingProxy(urlsplit(rig.env["ROS_MASTER_URI"]).port)
    with mock.patch.dict(rig.env, ROS_MASTER_URI=f"http://127.0.0.1:{rig.master.port}"):
        rig.web = rig.start("web_node", sys.executable, WEB_NODE, f"__ns:={rig.ns}", *given)
    rig.status = rig.topic("status", DiagnosticStatus)
    rig.imu = rig.topic("phone/imu", Imu)
    found = wait_until(
        lambda: re.findall(r"http://127\.0\.0\.1:\d+/", "\n".join(rig.web.output())), step_s=0.05
    )
    rig.page = PageClient(found[0])
    rig.status.wait()
    rig.page.say("take")
    rig.page.wait(lambda: rig.page.last.get("helm", {}).get("driver") == rig.page.last["welcome"]["you"])
    yield rig
    rig.page.close()
    rig.master.close()


def speeds(robot, since_s=0.0):
    """What the board was commanded, in turn [mm/s]."""
    found = [each for at, data in list(robot.wire.sent) if at >= since_s for each in COMMAND.finditer(data)]
    return [int(each.group(1) or 0) for each in found]


@contextlib.contextmanager
def driving(robot, moves=lambda: True):
    """The page holds a control, the robot has a motion command, and `moves`.

    The control is pressed again if a busy machine was too slow, because that ends a press.
    """

    def driven():
        robot.page.let_go()
        robot.page.after("sample")
        since_s = time.monotonic()
        robot.page.hold(0.2)
        with contextlib.suppress(AssertionError):
            wait_until(lambda: any(speeds(robot, since_s)) and moves(), step_s=0.02, timeout_s=1.0)
            return True
        return False

    wait_until(driven)
    try:
        yield
    finally:
        robot.page.let_go()


def stopped(robot):
    """The last command to the board is a stop."""
    return speeds(robot)[-1] == 0


def places(robot):
    """Where the robot was in the last 0.3 s."""
    rows = robot.board_.truth.read_text().splitlines()[-7:-1]
    return {(row["x"], row["y"]) for row in map(json.loads, rows)}


def release(robot):
    """Release the emergency stop on the page, again until the page has answered that it knows of the stop."""
    wait_until(lambda: robot.page.release() or not robot.page.last["helm"]["latched"], step_s=0.05)


def test_topics_are_those_of_the_table(robot):
    Offered(robot, "web_node").require_topics("/clock")


def test_a_node_that_stands_still_is_a_stop_by_the_robots_node(robot):
    with driving(robot):
        robot.web.signal(signal.SIGSTOP)
        try:
            wait_until(lambda: stopped(robot) and len(places(robot)) == 1, step_s=0.02, what="a stop")
            stopped_s = time.monotonic()
        finally:
            robot.web.signal(signal.SIGCONT)
        robot.page.after("sample")
        assert not any(speeds(robot, stopped_s)), "the control is still held"


def test_a_robots_node_that_stands_still_is_a_stop_by_the_board(robot):
    with driving(robot, lambda: len(places(robot)) > 1):
        robot.process.signal(signal.SIGSTOP)
        try:
            wait_until(lambda: len(places(robot)) == 1, step_s=0.02, what="a stop")
            robot.page.wait(lambda: not robot.page.last["helm"]["driving"])
        finally:
            robot.process.signal(signal.SIGCONT)


@pytest.mark.parametrize("by_service", [False, True])
def test_the_stop_of_the_page_is_that_of_the_robots_node(robot, by_service):
    if by_service:
        assert rospy.ServiceProxy(f"{robot.ns}/stop", Trigger)().success
    else:
        robot.page.say("stop")
    wait_until(lambda: "emergency stop" in robot.status.messages[-1].message)
    robot.page.wait(lambda: robot.page.last["helm"]["latched"])
    release(robot)
    wait_until(lambda: "emergency stop" not in robot.status.messages[-1].message)


def test_the_page_says_that_another_program_has_released_its_stop(robot):
    robot.page.say("stop")
    wait_until(lambda: "emergency stop" in robot.status.messages[-1].message)
    assert rospy.ServiceProxy(f"{robot.ns}/release_stop", Trigger)().success
    robot.page.wait(lambda: robot.page.last["helm"]["released_by_other"])
    release(robot)
    assert not robot.page.last["helm"]["released_by_other"]


def test_the_stop_needs_no_master(robot):
    asked = len(robot.master.sent)
    wait_until(lambda: len(robot.master.sent) > asked + LOOK_PIECES)
    port, robot.master.target = robot.master.target, 1  # where nothing listens
    robot.master.cut()
    try:
        robot.page.say("stop")
        wait_until(lambda: "emergency stop" in robot.status.messages[-1].message)
        release(robot)
        wait_until(lambda: "emergency stop" not in robot.status.messages[-1].message)
    finally:
        robot.master.target = port


def test_the_stop_finds_a_robots_node_that_has_started_again(robot, monkeypatch):
    services, stop = NodeServices(), f"{robot.ns}/stop"
    with monkeypatch.context() as before, socket.create_server(("127.0.0.1", 0)) as old:
        address = f"rosrpc://127.0.0.1:{old.getsockname()[1]}"
        before.setattr(rosgraph, "Master", lambda _: SimpleNamespace(lookupService=lambda _: address))
        services.look(stop)
    done, _ = services(stop)
    assert done
    assert rospy.ServiceProxy(f"{robot.ns}/release_stop", Trigger)().success


def test_a_late_robots_node_is_warned_of_on_the_page_and_in_the_log(robot):
    words = too_slow(f"{robot.ns}/robot_node/cmd_vel_timeout", 0.5)
    robot.page.wait(lambda: robot.page.last.get("view", {}).get("notice") == words)
    assert any(words in line for line in robot.web.output())


def test_readings_of_the_phone_are_published(robot):
    angles = {"alpha": 0.0, "beta": 0.0, "gamma": 0.0, "absolute": True}
    reading = {"t": 1.0, **angles, "acceleration": [0.0, 0.0, 9.8], "rotation": None}
    wait_until(lambda: robot.page.say("phone", **reading) or robot.imu.messages, step_s=0.05)
    message = robot.imu.messages[-1]
    assert message.header.frame_id == "phone" and message.linear_acceleration.z == 9.8


def test_a_recording_has_the_robots_topics(robot):
    import rosbag

    robot.page.say("record", on=True)
    robot.page.wait(lambda: robot.page.last.get("recording", {}).get("on"))
    for _ in range(5):  # each is of another odometry message
        robot.page.after("sample", lambda sample: sample["v"][3] is not None)
    robot.page.say("record", on=False)
    robot.page.wait(lambda: not robot.page.last["recording"]["on"] and robot.page.last["recording"]["files"])
    (name,) = (file["name"] for file in robot.page.last["recording"]["files"])
    with rosbag.Bag(str(robot.folder / name)) as bag:
        topics = bag.get_type_and_topic_info().topics
    assert {f"{robot.ns}/odom", f"{robot.ns}/status"} <= set(topics)
