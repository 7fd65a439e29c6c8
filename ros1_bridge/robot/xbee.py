"""Texts sent and received by XBee radio: converts frames to messages and back.  No node."""

from typing import Any, Callable, FrozenSet, NamedTuple, Tuple

from diagnostic_msgs.msg import KeyValue

from mrl_driver.protocol import Frame
from mrl_driver.protocol.frames import to_int16
from mrl_driver.protocol.table import BY_NAME
from ros1_bridge.topics.fast_publisher import direct_publisher

TEXT_BYTES = 16
_TEXT_IN, _TEXT_OUT = (BY_NAME[name].code for name in ("xbee_text", "send_xbee"))
RADIO_IN, RADIO_OUT = "xbee/received", "xbee/send"


class RadioText(NamedTuple):
    """A text, and the 64-bit address of the other radio."""

    address: int
    text: str


class Radio:
    """Publishes the texts that the board's radio receives; does nothing if the board has no radio."""

    def __init__(self, publisher_class: Callable[..., Any], capabilities: FrozenSet[str]) -> None:
        self._out = direct_publisher(publisher_class, RADIO_IN, KeyValue) if "xbee" in capabilities else None

    def on_frame(self, frame: Frame) -> None:
        """Publish the text of a frame; other frames are ignored."""
        if frame.code == _TEXT_IN and self._out is not None:
            received = read_text(frame.args)
            self._out.publish(f"{received.address:016x}", received.text)


def read_text(args: Tuple[int, ...]) -> RadioText:
    """The fields of an `xbee_text` frame: four words of address, length, words of two bytes."""
    address = 0
    for word in args[:4]:
        address = address << 16 | word & 0xFFFF
    data = b"".join((word & 0xFFFF).to_bytes(2, "big") for word in args[5:])
    return RadioText(address, data[: args[4]].decode("ascii", "backslashreplace"))


def send_request(message: KeyValue) -> Tuple[int, ...]:
    """The request for a message on `xbee/send`: key is the address in hexadecimal, value the text.

    Raises:
        ValueError: the address is not valid, or the text is empty, too long or not ASCII; the message says which.
    """
    try:
        address = int(message.key, 16)
    except ValueError:
        address = -1
    if not 0 <= address < 1 << 64:
        raise ValueError(f"{RADIO_OUT} key is {message.key!r}, expected a 64-bit address in hexadecimal")
    data = message.value.encode("ascii", "replace")
    if not 0 < len(data) <= TEXT_BYTES or not message.value.isascii():
        raise ValueError(
            f"{RADIO_OUT} value is {message.value!r}, expected 1 to {TEXT_BYTES} ASCII characters"
        )
    words = [to_int16(address >> shift & 0xFFFF) for shift in (48, 32, 16, 0)]
    padded = data + b"\0" * (len(data) % 2)
    texts = [to_int16(padded[i] << 8 | padded[i + 1]) for i in range(0, len(padded), 2)]
    return (_TEXT_OUT, *words, len(data), *texts)
