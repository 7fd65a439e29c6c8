"""Files of ROS messages: bags, by rosbag where ROS is installed and else by the library rosbags; and MCAP."""

from pathlib import Path
from typing import Any, Callable, Dict, Protocol

from .message_classes import missing


class MessageFile(Protocol):
    """A file that is being written; each method raises OSError if the disk is full."""

    def add(self, topic: str, kind: Any, latched: bool) -> Any:
        """Add a topic with the message class `kind`; return what `write` needs."""

    def write(self, channel: Any, data: bytes, time_ns: int) -> None:
        """Add a serialized message of a topic, with the time of its arrival [ns since 1970]."""

    def close(self) -> None:
        """Write what is pending, and the index."""


def bag(path: str, node: str) -> MessageFile:
    """Make a bag with messages of this node.

    Raises:
        ConfigError: neither ROS nor rosbags is installed.
        OSError: the file cannot be made.
    """
    try:
        import rosbag  # noqa: F401 - looked for
    except ImportError:
        return LibraryBag(path, node)
    return RosBag(path, node)


class RosBag:
    """A bag that rosbag writes."""

    def __init__(self, path: str, node: str) -> None:
        import rosbag
        from genpy import Time

        self._bag, self._node, self._time = rosbag.Bag(path, "w"), node, Time

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


class LibraryBag:
    """A bag that the library rosbags writes."""

    def __init__(self, path: str, node: str) -> None:
        try:
            from rosbags.rosbag1 import Writer
        except ImportError as error:
            raise missing(error) from None
        self._writer, self._node = Writer(Path(path)), node
        self._writer.open()

    def add(self, topic: str, kind: Any, latched: bool) -> Any:
        return self._writer.add_connection(
            topic,
            kind._type.replace("/", "/msg/"),
            msgdef=kind._full_text,
            md5sum=kind._md5sum,
            callerid=self._node,
            latching=int(latched),
        )

    def write(self, channel: Any, data: bytes, time_ns: int) -> None:
        self._writer.write(channel, time_ns, data)

    def close(self) -> None:
        self._writer.close()


class Mcap:
    """An MCAP file of the profile `ros1`.

    Raises:
        ConfigError: mcap is not installed.
        OSError: the file cannot be made.
    """

    def __init__(self, path: str, node: str) -> None:
        try:
            from mcap.writer import Writer
        except ImportError as error:
            raise missing(error) from None
        self._node = node
        self._schemas: Dict[str, int] = {}
        self._sequences: Dict[int, int] = {}
        self._file = open(path, "wb")  # noqa: SIM115 - `close` closes it
        self._writer = Writer(self._file)
        self._writer.start(profile="ros1", library="mrl-driver")

    def add(self, topic: str, kind: Any, latched: bool) -> int:
        name = kind._type
        if name not in self._schemas:
            self._schemas[name] = self._writer.register_schema(name, "ros1msg", kind._full_text.encode())
        about = {
            "callerid": self._node,
            "latching": "true" if latched else "false",
            "md5sum": kind._md5sum,
            "topic": topic,
        }
        channel = self._writer.register_channel(topic, "ros1", self._schemas[name], about)
        self._sequences[channel] = 0
        return channel

    def write(self, channel: int, data: bytes, time_ns: int) -> None:
        self._sequences[channel] += 1
        self._writer.add_message(channel, time_ns, data, time_ns, self._sequences[channel])

    def close(self) -> None:
        self._writer.finish()
        self._file.close()


FORMATS: Dict[str, Callable[[str, str], MessageFile]] = {".bag": bag, ".mcap": Mcap}
"""Makes a file (path, name of the node) by the ending of its name."""
