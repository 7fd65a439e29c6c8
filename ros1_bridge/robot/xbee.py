"""The board's XBee radio as a topic and a service; `topics.radio_topic` has what it receives.  No node."""

from typing import Any, List, Tuple

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from diagnostic_msgs.srv import SelfTestResponse

from mrl_driver.driver import Driver
from mrl_driver.errors import MrlError
from mrl_driver.robot.radio import RadioNode, format_address, parse_address

SEND, DISCOVER = "xbee/send", "xbee/discover"


class Radio:
    """Sends the texts of messages, and searches for other radios."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver

    def send(self, message: KeyValue) -> str:
        """Send the text of a message; returns why it was not sent, empty if it was."""
        try:
            self._driver.radio.send(*text_of_message(message))
        except MrlError as error:
            return f"{SEND}: {error}"
        return ""

    def discover(self, _: Any) -> SelfTestResponse:
        """Search for other radios; each one is a status with the values `address` and `network`, in hexadecimal."""
        try:
            nodes = self._driver.radio.discover()
        except MrlError as error:
            return SelfTestResponse(str(error), 0, [])
        return SelfTestResponse(f"{len(nodes)} radios have answered", 1, statuses_of(nodes))


def text_of_message(message: KeyValue) -> Tuple[int, str]:
    """Address and text of a message on `xbee/send`: its key is the address in hexadecimal, its value the text.

    Raises:
        FrameError: the key is not an address.
    """
    return parse_address(message.key), message.value


def statuses_of(nodes: List[RadioNode]) -> List[DiagnosticStatus]:
    """One status for each radio; its name is the address."""
    made = []
    for node in nodes:
        address, network = format_address(node.address), f"{node.network:04x}"
        pairs = [KeyValue("address", address), KeyValue("network", network)]
        made.append(DiagnosticStatus(DiagnosticStatus.OK, address, "radio", "", pairs))
    return made
