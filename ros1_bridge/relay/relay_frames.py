"""What two relays say to each other, as bytes.  Pure: bytes in, events out.

The relay that receives topics connects to the one that sends them:

    receiver  Hello    its name and the topics that it asks for
    sender    Hello    its name, its run, and those of these topics that it sends
    receiver  Ping     heartbeat with the receiver's clock; the first one starts the data
    sender    Pong     its answer, with both clocks
    sender    Source   a publisher of a topic: the type of its messages, and a number for it
    sender    Message  a message of that publisher, as ROS serialized it
    receiver  Taken    how many messages have arrived on this connection

A frame is the kind (1 byte), the length of the rest (4 bytes, little-endian), and the rest: a JSON list, or for Message
packed numbers and the bytes.
"""

import json
import math
import struct
from typing import Any, List, NamedTuple, Tuple, Type, Union, get_type_hints

from mrl_driver.errors import MrlError

PROTOCOL = 1
LONGEST_BYTES = 16 * 1024 * 1024
"""A frame has at most this many bytes after its header; a longer message is not sent."""
_LONGEST_FIRST = 64 * 1024  # the first frame of a connection is at most this long: anyone may connect
_LONGEST_NAME = 255
_HEADER = struct.Struct("<BI")


class RelayError(MrlError):
    """The other end does not speak this protocol, or a connection cannot be used."""


class Hello(NamedTuple):
    """The first frame in each direction.  `run` differs after each start of the sender."""

    protocol: int
    name: str
    run: str
    topics: List[str]


class Source(NamedTuple):
    """A publisher of a topic; `number` stands for it in its messages."""

    number: int
    topic: str
    publisher: str
    type: str
    md5sum: str
    definition: str
    latched: bool


class Message(NamedTuple):
    """A message."""

    number: int
    sequence: int  # of the message among all that the publisher has sent; what is missing was lost
    stamp_s: float  # when the sender's relay got it, by its own clock [s]
    body: bytes


class Taken(NamedTuple):
    """Number of messages that have arrived on this connection."""

    messages: int


class Ping(NamedTuple):
    """A heartbeat, with the receiver's clock [s]."""

    sent_s: float


class Pong(NamedTuple):
    """The answer to the Ping of `sent_s`; `answered_s` is the sender's clock [s]."""

    sent_s: float
    answered_s: float


def is_command(message_type: str) -> bool:
    """Whether messages of this type tell a robot what to do, or where it is.

    They are never repeated, latched or not.
    """
    return message_type in _COMMANDS or message_type.endswith("ActionGoal")


_COMMANDS = (
    "geometry_msgs/Twist",
    "geometry_msgs/TwistStamped",
    "geometry_msgs/PoseStamped",
    "geometry_msgs/PoseArray",  # waypoints, as Path
    "geometry_msgs/PoseWithCovarianceStamped",  # set_pose, initialpose
    "nav_msgs/Path",
    "sensor_msgs/Joy",
    "std_msgs/Float64",  # the angle of a servo
    "diagnostic_msgs/KeyValue",  # a text for another robot's radio
)

Event = Union[Hello, Source, Message, Taken, Ping, Pong]
_KINDS: Tuple[Type[Any], ...] = (Hello, Source, Message, Taken, Ping, Pong)
"""The kind of a frame is the place in this list, from 1."""
_TYPES = {kind: get_type_hints(kind) for kind in _KINDS}
_MESSAGE_START = struct.Struct("<IQd")


def encode(event: Event) -> bytes:
    """The frame of an event."""
    if isinstance(event, Message):
        rest = _MESSAGE_START.pack(event.number, event.sequence, event.stamp_s) + event.body
    else:
        rest = json.dumps(event).encode()
    return _HEADER.pack(_KINDS.index(type(event)) + 1, len(rest)) + rest


class FrameReader:
    """Turns bytes into events."""

    def __init__(self) -> None:
        self._rest = bytearray()
        self._longest = _LONGEST_FIRST

    def feed(self, data: bytes) -> List[Event]:
        """The events that end in `data`; RelayError if it is not a relay's: the connection is then of no use."""
        self._rest += data
        events: List[Event] = []
        start = 0
        while len(self._rest) - start >= _HEADER.size:
            kind, length = _HEADER.unpack_from(self._rest, start)
            if not 1 <= kind <= len(_KINDS):
                raise RelayError(f"got a frame of kind {kind}, expected the frames of a topic_relay")
            if length > self._longest:
                raise RelayError(f"got a frame of {length} bytes, expected at most {self._longest}")
            end = start + _HEADER.size + length
            if len(self._rest) < end:
                break
            events.append(_event(kind, bytes(self._rest[start + _HEADER.size : end])))
            start, self._longest = end, LONGEST_BYTES
        del self._rest[:start]
        return events


def _event(kind: int, rest: bytes) -> Event:
    made = _KINDS[kind - 1]
    try:
        if made is Message:
            number, sequence, stamp_s = _MESSAGE_START.unpack_from(rest)
            return Message(number, sequence, _checked("stamp_s", float, stamp_s), rest[_MESSAGE_START.size :])
        found = made(*json.loads(rest.decode()))
        for name, value in found._asdict().items():
            _checked(name, _TYPES[made][name], value)
    except (struct.error, ValueError, TypeError, RecursionError) as error:
        raise RelayError(
            f"got a frame of kind {kind} that does not parse ({error}), expected a topic_relay"
        ) from None
    return found


def _checked(name: str, kind: Any, value: Any) -> Any:
    """The value, if it has this type and, as a number, an end: an endless time would make every message new."""
    if kind == List[str]:
        fits = isinstance(value, list) and all(isinstance(each, str) for each in value)
    else:
        fits = type(value) is kind and (kind is not float or math.isfinite(value))
    if not fits or (name == "name" and not (value.isprintable() and len(value) <= _LONGEST_NAME)):
        raise TypeError(f"{name} is {value!r}")
    return value
