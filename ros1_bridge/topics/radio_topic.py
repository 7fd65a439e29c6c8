"""The texts that the board's radio receives, as a topic.  No node."""

from typing import Any, Callable

from diagnostic_msgs.msg import KeyValue

from mrl_driver.robot.radio import RadioText, format_address

from .fast_publisher import direct_publisher

RECEIVED = "xbee/received"


class RadioTopic:
    """Publishes received texts with the address of their sender."""

    def __init__(self, publisher_class: Callable[..., Any]) -> None:
        self._out = direct_publisher(publisher_class, RECEIVED, KeyValue)

    def on_text(self, text: RadioText) -> None:
        """Publish a received text."""
        self._out.publish(KeyValue(format_address(text.address), text.text))
