"""The board's XBee radio: texts to send on a topic, and the search for other radios as a service.

`topics.board_topics` publishes the texts that it receives.
"""

from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from diagnostic_msgs.srv import SelfTest, SelfTestResponse

from mrl_driver.driver import Driver
from mrl_driver.errors import MrlError
from mrl_driver.robot.radio import NO_ANSWER, WAITING, RadioNode, format_address, parse_address

SEND, DISCOVER = "xbee/send", "xbee/discover"
WARN_EVERY_S = 1.0


class Radio:
    """Sends the texts of messages, and searches for other radios."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver

    def offer(self) -> None:
        """Subscribe to the topic, and offer the service."""
        rospy.Subscriber(SEND, KeyValue, self._on_message, queue_size=WAITING, tcp_nodelay=True)
        rospy.Service(DISCOVER, SelfTest, self.discover)

    def _on_message(self, message: KeyValue) -> None:
        refusal = self.send(message)
        if refusal:
            rospy.logwarn_throttle(WARN_EVERY_S, refusal)

    def send(self, message: KeyValue) -> str:
        """Send the value of a message to its key, an address in hexadecimal.

        Returns why it was not sent, empty if it was.
        """
        try:
            self._driver.radio.send(parse_address(message.key), message.value)
        except MrlError as error:
            return f"{SEND}: {error}"
        return ""

    def discover(self, _: Any) -> SelfTestResponse:
        """Search for other radios; each one is a status with the values `address` and `network`, in hexadecimal."""
        try:
            nodes = self._driver.radio.discover()
        except MrlError as error:
            return SelfTestResponse(str(error), 0, [])
        words = f"{len(nodes)} radios have answered" if nodes else NO_ANSWER
        return SelfTestResponse(words, 1, [_status_of(node) for node in nodes])


def _status_of(node: RadioNode) -> DiagnosticStatus:
    """The status of a radio; its name is the address."""
    address = format_address(node.address)
    pairs = [KeyValue("address", address), KeyValue("network", f"{node.network:04x}")]
    return DiagnosticStatus(DiagnosticStatus.OK, address, "radio", "", pairs)
