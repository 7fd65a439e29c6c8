"""The board's radio as topics and a service; the driver only says what it was told."""

from types import SimpleNamespace

from diagnostic_msgs.msg import KeyValue

from mrl_driver.errors import LinkLost
from mrl_driver.robot.radio import RadioNode, RadioText
from ros1_bridge.robot.xbee import Radio
from ros1_bridge.topics.board_topics import radio_texts

from .fake_topics import Topics

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
