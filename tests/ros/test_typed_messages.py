"""With the optional package `mrl_msgs` some topics have its types; with another version of it, standard ones."""

import itertools
import sys
from types import ModuleType

import pytest
from genpy import Time
from genpy.dynamic import generate_dynamic
from std_msgs.msg import Header, String

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot import models
from mrl_driver.robot.inputs import Inputs
from mrl_driver.robot.odometry import Wheels
from ros1_bridge.node.robot_parameters import check
from ros1_bridge.status.robot_status import State
from ros1_bridge.topics import typed_messages
from ros1_bridge.topics.board_topics import input_topics
from ros1_bridge.topics.publishers import Publishers
from ros1_bridge.topics.typed_messages import MESSAGES, definition, numbers, typed

from .fake_topics import Topics
from .node_bench import Bench
from .tables import first_two, table
from .test_publishers import published

HEADER = f"{'=' * 80}\nMSG: std_msgs/Header\n{Header._full_text}"
LEFT = Inputs(("bumper_left",), False, ("bumper_left",))


def install(monkeypatch, change=""):
    """Let this process import `mrl_msgs`, with a change of each definition."""
    module = ModuleType("mrl_msgs.msg")
    for name in MESSAGES:
        made = generate_dynamic(f"mrl_msgs/{name}", f"{change}{definition(name)}{HEADER}")
        setattr(module, name, made[f"mrl_msgs/{name}"])
    monkeypatch.setitem(sys.modules, "mrl_msgs", ModuleType("mrl_msgs"))
    monkeypatch.setitem(sys.modules, "mrl_msgs.msg", module)


@pytest.fixture(autouse=True)
def each_test_looks_for_itself():
    typed.cache_clear()
    yield
    typed.cache_clear()


def test_topics_have_the_types_of_the_readme(monkeypatch):
    install(monkeypatch)
    node = Bench(monkeypatch)
    node.run()
    kinds = {name: topic.kind._type for name, topic in node.ros.topics.items()}
    wanted = first_two(table("### Typed messages", "topic"))
    assert set(wanted.values()) == {f"mrl_msgs/{name}" for name in MESSAGES}
    assert {name: kind for name, kind in kinds.items() if "mrl_msgs" in kind}.items() <= wanted.items()
    assert kinds["robot_status"] == "mrl_msgs/RobotStatus"
    status = node.sent("robot_status")[-1]
    assert (status.mode, status.stopped_by, status.warning_zone) == (
        status.MODE_DRIVE,
        status.REASON_NONE,
        status.ZONE_NOT_WATCHED,
    )


@pytest.mark.parametrize("reason", StopReason)
def test_each_state_has_its_constants(reason):
    for driving, moving, seeking, manual, fault in itertools.product((False, True), repeat=5):
        state = State(driving, moving, reason, seeking, manual, (None, False, True), fault)
        fields = state.fields()
        assert all(isinstance(number, (bool, int)) for number in numbers("RobotStatus", fields).values())
        free = state.keys()["ready"] == "true"
        assert (fields["mode"] != "MODE_BLOCKED") == (fields["blocked_by"] == "REASON_NONE") == free


def test_sides_of_a_bumper_are_fields_with_the_time_of_their_change(monkeypatch):
    install(monkeypatch)
    topics = Topics()
    input_topics(topics, lambda: Time(7, 0))(LEFT)
    (hit,) = topics["bumper"].sent
    assert (hit.left, hit.right, hit.rear, hit.header.stamp.secs) == (True, False, False, 7)


def test_counts_and_servos_are_typed(monkeypatch):
    install(monkeypatch)
    (encoders,) = published("encoders", counts=Wheels(2**40, -7))["encoders"].sent
    assert (encoders.name, encoders.count) == (["right_wheel_joint", "left_wheel_joint"], (2**40, -7))
    topics, servo = Topics("servo/pan/state"), models.ServoMount(1, -1.0, 1.5, 1000, 2000)
    model = models.load("duo")._replace(servos={"pan": servo})
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), model)
    out.servos({"pan": 0.5}, Time(7, 0))
    (pan,) = topics["servo/pan/state"].sent
    assert (pan.angle, pan.low, pan.high, pan.header.stamp.secs) == (0.5, -1.0, 1.5, 7)


def test_a_package_of_another_version_is_named_and_not_used(monkeypatch):
    install(monkeypatch, "bool more\n")
    node, topics = Bench(monkeypatch), Topics()
    node.run()
    input_topics(topics, Time)(LEFT)
    assert topics["bumper"].kind is String and "robot_status" in node.ros.topics
    assert node.levels("mrl_msgs is of another version") == ["warn"]


def test_a_package_that_lacks_a_message_is_of_another_version(monkeypatch):
    install(monkeypatch)
    monkeypatch.delattr(sys.modules["mrl_msgs.msg"], "Servo")
    assert typed_messages.is_other_version()


@pytest.mark.parametrize("folder", ["", "no/such/folder"])
def test_a_workspace_that_is_not_there_is_named(folder):
    with pytest.raises(ConfigError, match="expected the folder src of a catkin workspace"):
        typed_messages.main([folder])
