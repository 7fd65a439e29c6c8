"""Files of ROS messages: bags, by rosbag where ROS is installed and else by the library rosbags; and MCAP.

Their publishers write into the file instead of sending to subscribers.
"""

import io
from abc import ABC, abstractmethod
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Callable, Dict

from mrl_driver.files import unwritable

from .message_classes import needs_extra


class MessageFile(ABC):
    """A file named `output` that is being written; it takes the place of the class rospy.Publisher.

    `add`, `write` and `close` raise OSError if the disk is full.  Relative names of topics are in `namespace`, such as
    `/robot1`, and `now_ns` is the time at which messages arrive [ns since 1970].
    """

    def __init__(self, output: str, namespace: str, now_ns: Callable[[], int]) -> None:
        self.output, self.now_ns, self.count = output, now_ns, 0
        self._namespace, self._node = namespace, f"{namespace}/robot_node"

    def __call__(self, topic: str, kind: Any, latch: bool = False, **_: Any) -> "FileTopic":
        """Return the publisher of a topic, with the arguments of rospy.Publisher."""
        name = topic if topic.startswith("/") else f"{self._namespace}/{topic}"
        return FileTopic(self, name, kind, latch)

    @abstractmethod
    def add(self, topic: str, kind: Any, latched: bool) -> Any:
        """Add a topic with the message class `kind`; return what `write` needs."""

    @abstractmethod
    def write(self, channel: Any, data: bytes, time_ns: int) -> None:
        """Add a serialized message of a topic, with the time of its arrival [ns since 1970]."""

    @abstractmethod
    def close(self) -> None:
        """Write what is pending, and the index."""


class FileTopic:
    """The publisher of one topic, and its only connection.  The file has the topic from its first message on.

    `write_data` and `publish` raise OutputError if the file cannot be written.
    """

    socket = None

    def __init__(self, file: MessageFile, name: str, kind: Any, latched: bool) -> None:
        self._file, self._name, self._kind, self._latched = file, name, kind, latched
        self._channel: Any = None
        self._sequence = 0
        self._has_header = "header" in kind.__slots__
        self.impl = SimpleNamespace(connections=[self], add_subscriber_listener=lambda _: None)

    def write_data(self, data: bytes) -> None:
        """Write a serialized message that follows its length, as connections of rospy do."""
        self._write(data[4:])

    def publish(self, message: Any) -> None:
        """Write a message."""
        if self._has_header:
            self._sequence += 1
            message.header.seq = self._sequence
        serialized = io.BytesIO()
        message.serialize(serialized)
        self._write(serialized.getvalue())

    def _write(self, data: bytes) -> None:
        file = self._file
        try:
            if self._channel is None:
                self._channel = file.add(self._name, self._kind, self._latched)
            file.write(self._channel, data, file.now_ns())
            file.count += 1
        except OSError as error:
            raise unwritable(file.output, error) from None


class RosBag(MessageFile):
    """A bag that rosbag writes; raises ImportError if ROS is not installed."""

    def __init__(self, path: str, *about: Any) -> None:
        import rosbag
        from genpy import Time

        super().__init__(*about)
        self._bag, self._time = rosbag.Bag(path, "w"), Time

    def add(self, topic: str, kind: Any, latched: bool) -> Any:
        header = {
            "topic": topic,
            "type": kind._type,
            "md5sum": kind._md5sum,
            "message_definition": kind._full_text,
            "callerid": self._node,
            "latching": "1" if latched else "0",
        }
        return topic, kind, header

    def write(self, channel: Any, data: bytes, time_ns: int) -> None:
        topic, kind, header = channel
        content = kind._type, data, kind._md5sum, kind
        self._bag.write(
            topic, content, self._time(*divmod(time_ns, 10**9)), raw=True, connection_header=header
        )

    def close(self) -> None:
        self._bag.close()


class LibraryBag(MessageFile):
    """A bag that the library rosbags writes."""

    def __init__(self, path: str, *about: Any) -> None:
        with needs_extra():
            from rosbags.rosbag1 import Writer
        super().__init__(*about)
        self._writer = Writer(Path(path))
        self._writer.open()

    def add(self, topic: str, kind: Any, latched: bool) -> Any:
        about = {"msgdef": kind._full_text, "md5sum": kind._md5sum, "callerid": self._node}
        return self._writer.add_connection(
            topic, kind._type.replace("/", "/msg/"), **about, latching=int(latched)
        )

    def write(self, channel: Any, data: bytes, time_ns: int) -> None:
        self._writer.write(channel, time_ns, data)

    def close(self) -> None:
        self._writer.close()


class Mcap(MessageFile):
    """An MCAP file of the profile `ros1`."""

    def __init__(self, path: str, *about: Any) -> None:
        with needs_extra():
            from mcap.writer import Writer
        super().__init__(*about)
        self._schemas: Dict[str, int] = {}
        self._sequences: Dict[int, int] = {}
        self._stream = open(path, "wb")  # noqa: SIM115 - `close` closes it
        self._writer = Writer(self._stream)
        self._writer.start(profile="ros1", library="mrl-driver")

    def add(self, topic: str, kind: Any, latched: bool) -> int:
        name, node = kind._type, self._node
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "ros1msg", kind._full_text.encode())
        latching = "true" if latched else "false"
        about = {"callerid": node, "latching": latching, "md5sum": kind._md5sum, "topic": topic}
        channel = self._writer.register_channel(topic, "ros1", self._schemas[name], about)
        self._sequences[channel] = 0
        return channel

    def write(self, channel: int, data: bytes, time_ns: int) -> None:
        self._sequences[channel] += 1
        self._writer.add_message(channel, time_ns, data, time_ns, self._sequences[channel])

    def close(self) -> None:
        self._writer.finish()
        self._stream.close()


def make(ending: str, path: str, *about: Any) -> MessageFile:
    """Make a .bag or .mcap, for what `MessageFile` needs; ConfigError without its package, or OSError."""
    if ending == ".mcap":
        return Mcap(path, *about)
    try:
        return RosBag(path, *about)
    except ImportError:
        return LibraryBag(path, *about)
