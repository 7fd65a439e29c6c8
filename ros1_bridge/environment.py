"""Topics of the boards that have environment sensors or a radio: frames to messages and back.  No node.

Environment boards: dust, alcohol, light and the hottest thermopile pixel come as one stream, the pixels on
request, the compass as a stream of its own.
"""

import math
from typing import Any, Callable, Dict, FrozenSet, List, NamedTuple, Tuple

from diagnostic_msgs.msg import KeyValue
from genpy import Time
from sensor_msgs.msg import Imu
from std_msgs.msg import Float32, Float32MultiArray, UInt16

from mrl_driver.codec import Frame
from mrl_driver.table import BY_NAME

from .covariance import UNUSED_VARIANCE
from .direct import direct_publisher

PERIOD_MS = 500
COMPASS_PERIOD_MS = 100
COMPASS_VARIANCE = math.radians(2.0) ** 2
"""Of a CMPS10 beside motors: its data sheet has 3 to 4 deg at worst after calibration."""
TEXT_BYTES = 16
_CODE = {name: row.code for name, row in BY_NAME.items()}
_AIR, _COMPASS, _PIXELS = (
    _CODE[n] for n in ("start_sensor_ldr_stream", "start_compass_stream", "read_thermopile")
)
_TEXT_IN, _TEXT_OUT = _CODE["xbee_text"], _CODE["send_xbee"]
TOPICS = {
    "alcohol": UInt16,
    "dust": Float32,
    "light": UInt16,
    "thermopile": Float32MultiArray,
    "compass": Imu,
}
RADIO_IN, RADIO_OUT = "xbee/received", "xbee/send"


class Text(NamedTuple):
    """A text by radio, and the other radio's 64-bit address."""

    address: int
    text: str


class Environment:
    """Publishes what frames of such a board bring."""

    def __init__(
        self,
        publisher_class: Callable[..., Any],
        base_frame: str,
        capabilities: FrozenSet[str],
        clock: Callable[[], Time],
    ) -> None:
        self._sensors, self._clock = "environment" in capabilities, clock
        topics: Dict[str, type] = dict(TOPICS) if self._sensors else {}
        if "xbee" in capabilities:
            topics[RADIO_IN] = KeyValue
        self._out = {name: direct_publisher(publisher_class, name, kind) for name, kind in topics.items()}
        self._imu = new_compass(base_frame)

    def starts(self) -> List[Tuple[int, ...]]:
        """Requests that a greeted board is sent, once for each greeting."""
        return [(_AIR, PERIOD_MS), (_COMPASS, COMPASS_PERIOD_MS)] if self._sensors else []

    def polls(self) -> List[Tuple[int, ...]]:
        """Requests that are due once a second."""
        return [(_PIXELS,)] if self._sensors else []

    def on_frame(self, frame: Frame) -> None:
        """Publish what a frame brings; frames of other rows are passed over."""
        args = frame.args
        if frame.code == _AIR and "alcohol" in self._out:
            self._out["alcohol"].publish(args[2])
            self._out["dust"].publish(args[3])
            self._out["light"].publish(args[5])
        elif frame.code == _PIXELS and "thermopile" in self._out:
            self._out["thermopile"].publish(data=list(map(float, args)))
        elif frame.code == _COMPASS and "compass" in self._out:
            fill_compass(self._imu, self._clock(), args[0])
            self._out["compass"].publish(self._imu)
        elif frame.code == _TEXT_IN and RADIO_IN in self._out:
            received = read_text(args)
            self._out[RADIO_IN].publish(f"{received.address:016x}", received.text)


def new_compass(base_frame: str) -> Imu:
    """A heading alone: no rates, no accelerations (-1 says so), no roll, no pitch."""
    message = Imu()
    message.header.frame_id = base_frame
    message.orientation_covariance = [UNUSED_VARIANCE, 0, 0, 0, UNUSED_VARIANCE, 0, 0, 0, COMPASS_VARIANCE]
    message.angular_velocity_covariance[0] = message.linear_acceleration_covariance[0] = -1
    return message


def fill_compass(message: Imu, stamp: Time, bearing_deg: float) -> None:
    """Write a bearing (clockwise from north) as yaw (counter-clockwise from east, REP-103)."""
    yaw = math.radians(90.0 - bearing_deg)
    message.header.stamp = stamp
    message.orientation.z, message.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)


def read_text(args: Tuple[int, ...]) -> Text:
    """The fields of an `xbee_text` frame: four words of address, length, words of two bytes."""
    address = 0
    for word in args[:4]:
        address = address << 16 | word & 0xFFFF
    data = b"".join((word & 0xFFFF).to_bytes(2, "big") for word in args[5:])
    return Text(address, data[: args[4]].decode("ascii", "backslashreplace"))


def send_request(message: KeyValue) -> Tuple[int, ...]:
    """The request for a message on `xbee/send`: key is the address in hexadecimal, value the text.

    Raises:
        ValueError: the address is none, or the text is empty, too long or not ASCII; the text says so.
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
    words = [_signed(address >> shift & 0xFFFF) for shift in (48, 32, 16, 0)]
    padded = data + b"\0" * (len(data) % 2)
    texts = [_signed(padded[i] << 8 | padded[i + 1]) for i in range(0, len(padded), 2)]
    return (_TEXT_OUT, *words, len(data), *texts)


def _signed(word: int) -> int:
    return word - 0x10000 if word & 0x8000 else word
