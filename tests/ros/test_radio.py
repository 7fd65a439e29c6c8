"""Texts of the board's radio on a topic."""

from diagnostic_msgs.msg import KeyValue

from mrl_driver.robot.radio import RadioText
from ros1_bridge.topics.board_topics import radio_texts

from .fake_topics import Topics

PEER, KEY = 0x0013A20040A1B2C3, "0013a20040a1b2c3"


def test_received_text_is_published_with_its_sender():
    topics = Topics()
    radio_texts(topics)(RadioText(PEER, b"hello"))
    assert topics["xbee/received"].sent == [KeyValue(KEY, "hello")]
