"""What the node `topic_relay` publishes and refuses, and a robot that is driven over two masters with a relay each."""

import io
import json
import math
import socket
import subprocess
import sys
import threading

import pytest
from std_msgs.msg import Bool, String

from mrl_driver.errors import ConfigError
from ros1_bridge.relay.relay_frames import Source
from ros1_bridge.relay.relay_settings import Address, read_settings
from ros1_bridge.relay.topic_relay_node import ReceivedTopic, TopicRelay
from tests.network import own_network
from tests.waiting import PATIENCE, wait_until

from .rig import ROOT


def source(number, kind=String, latched=True):
    return Source(number, "state", f"/node{number}", kind._type, kind._md5sum, kind._full_text, latched)


def body(message):
    """The message as ROS serializes it."""
    data = io.BytesIO()
    message.serialize(data)
    return data.getvalue()


@pytest.fixture
def received(rig):
    """A topic that two nodes of robot2 publish, latched."""
    topic = ReceivedTopic(f"{rig.ns}/state")
    for number, text in ((1, "first"), (2, "second")):
        topic.publish("robot2", source(number), body(String(text)))
    return topic


def texts(rig, received):
    """What a new subscriber gets of the latched messages; then comes one that is not latched."""
    state = rig.topic("state", String)
    state.wait_for_publisher()
    received.publish("robot2", source(9, latched=False), body(String("end")))
    wait_until(lambda: any(message.data == "end" for message in state.messages))
    return sorted(message.data for message in state.messages[:-1])


def test_each_of_two_subscribers_that_connect_at_once_gets_all_latched_messages(received):
    """The second one connects while the first one gets its messages."""
    one, other = [], []

    def slow(message):
        if not one:
            received.joined = threading.Thread(
                target=received.peer_subscribe, args=("state", None, lambda each: other.append(each._buff))
            )
            received.joined.start()
        one.append(message._buff)

    received.peer_subscribe("state", None, slow)
    received.joined.join()
    assert one == other == [body(String("first")), body(String("second"))]


def test_latched_messages_are_forgotten_when_their_robot_is_cut_off(rig, received):
    received.publish("robot3", source(1), body(String("third")))
    received.forget("robot2")
    assert texts(rig, received) == ["third"]


def test_topic_with_the_type_of_another_robots_is_refused(rig, received):
    received.publish("robot3", source(1, Bool), body(Bool(True)))
    assert texts(rig, received) == ["first", "second"]


def test_type_may_change_when_its_robot_starts_again(rig, received):
    received.publish("robot2", source(3, Bool), body(Bool(True)))
    assert rig.topic("state", Bool).wait()[0].data


def test_address_that_is_in_use_is_named(master):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = Address(*taken.getsockname())
        with pytest.raises(ConfigError, match=f"listen is {address}, which cannot be used .*in use"):
            TopicRelay(read_settings({"name": "robot1", "listen": str(address)}, "/relay"))


@pytest.fixture(scope="module")
def seen(tmp_path_factory):
    """What the trial of `two_masters` has seen."""
    folder = tmp_path_factory.mktemp("masters")
    command = [*own_network(), sys.executable, "-m", "tests.ros.two_masters", str(folder)]
    done = subprocess.run(command, cwd=str(ROOT), capture_output=True, text=True, timeout=110 * PATIENCE)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_topics_and_commands_cross_before_and_after_the_cut_and_none_comes_back(seen):
    """Latched state comes again; a message of a shared topic does not come back."""
    assert seen["moved"] and seen["restored_s"] < math.inf and seen["drives_again"]
    assert seen["mode"] and not seen["came_back"]


def test_robot_stops_when_the_cable_is_pulled_and_the_desk_is_told(seen):
    assert seen["stop_s"] < math.inf and seen["noticed_s"] < math.inf


def test_no_command_from_before_the_restore_moves_the_robot(seen):
    assert not seen["replayed"]
