"""The board's radio as topics and a service, and a text from topic to topic by two boards' images."""

from types import SimpleNamespace

from diagnostic_msgs.msg import KeyValue

from mrl_driver.errors import LinkLost
from mrl_driver.robot.radio import RadioNode, RadioText
from ros1_bridge.robot.xbee import Radio
from ros1_bridge.topics.board_topics import radio_texts
from sim_arduino.hardware.xbee import address_for
from sim_arduino.testing import EmulatedBoard
from sim_arduino.world.world import World
from tests.waiting import wait_until

from .fake_topics import Topics
from .rig import NODE

PEER, KEY = 0x0013A20040A1B2C3, "0013a20040a1b2c3"


def radio(**methods):
    return Radio(SimpleNamespace(radio=SimpleNamespace(**methods)))


def test_received_text_is_published_with_its_sender():
    topics = Topics()
    radio_texts(topics)(RadioText(PEER, b"hello"))
    assert topics["xbee/received"].sent == [KeyValue(KEY, "hello")]


def test_text_of_a_message_is_sent():
    sent = []
    made = radio(send=lambda *text: sent.append(text))
    assert made.send(KeyValue(KEY, "hello")) == "" and sent == [(PEER, "hello")]
    assert made.send(KeyValue("robot", "hello")).startswith("xbee/send: radio address is 'robot', expected")


def test_each_radio_found_is_a_status():
    made = radio(discover=lambda: [RadioNode(PEER, 0x12), RadioNode(7, 0xFFFE)])
    found = made.discover(None)
    lost = radio(discover=fail).discover(None)
    assert (lost.passed, lost.id, lost.status) == (0, "the port is gone", [])
    values = [{pair.key: pair.value for pair in status.values} for status in found.status]
    assert (found.passed, found.id) == (1, "2 radios have answered")
    assert values == [{"address": KEY, "network": "0012"}, {"address": f"{7:016x}", "network": "fffe"}]


def fail():
    raise LinkLost("the port is gone")


AGAIN_S = 0.3
"""A text is sent again after this time, because a board whose process is held up drops what was sent to it."""


def test_text_goes_from_one_robot_to_the_other_and_back(rig):
    fitted = {"world": World(), "engine": "avr", "radio": "auto"}
    with EmulatedBoard(name="one", **fitted) as one, EmulatedBoard(name="two", pose="1,0,0", **fitted) as two:
        for board, name in ((one, "one"), (two, "two")):
            rig.start(name, str(NODE), f"__ns:={rig.ns}/{name}", f"_port:={board.port}")
        received = {name: rig.topic(f"{name}/xbee/received", KeyValue) for name in ("one", "two")}
        send = {name: rig.publisher(f"{name}/xbee/send", KeyValue) for name in ("one", "two")}
        for here, there, text in (("one", "two", "go"), ("two", "one", "went")):
            received[there].wait_for_publisher()
            message = KeyValue(f"{address_for(there):016x}", text)
            wait_until(lambda: send[here].publish(message) or received[there].messages, step_s=AGAIN_S)  # noqa: B023
            assert received[there].messages[0] == KeyValue(f"{address_for(here):016x}", text)
