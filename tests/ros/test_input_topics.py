"""The board's inputs that stop it, as topics."""

from genpy import Time

from mrl_driver.robot.inputs import Inputs
from ros1_bridge.topics.board_topics import input_topics

from .fake_topics import Topics

CONNECTED = ("bumper_left", "bumper_rear", "emergency_stop")


def sent(topics):
    return {name: [message.data for message in topic.sent] for name, topic in topics.items()}


def test_each_change_is_published_on_the_topic_of_its_kind():
    topics = Topics()
    publish = input_topics(topics, Time)
    publish(None)
    publish("another event")
    for active, latched in (
        ((), False),
        (("bumper_left", "bumper_rear"), False),
        (("emergency_stop",), True),
        ((), True),
    ):
        publish(Inputs(active, latched, CONNECTED))
    assert sent(topics) == {"bumper": ["", "left rear", ""], "emergency_stop": [False, True]}
