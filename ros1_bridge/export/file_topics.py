"""Publishers that write into a file instead of sending to subscribers."""

import io
from types import SimpleNamespace
from typing import Any, Callable

from mrl_driver.files import unwritable

from .message_files import MessageFile


class FileTopics:
    """Makes the publishers of one file; it takes the place of the class rospy.Publisher.

    Args:
        file: the file, and `path`, its name for errors.
        namespace: what relative names of topics are in, such as `/robot1`; empty for none.
        now_ns: the time at which messages arrive [ns since 1970].

    Attributes:
        count: messages that were written.
    """

    def __init__(self, file: MessageFile, path: str, namespace: str, now_ns: Callable[[], int]) -> None:
        self.file, self.path, self.now_ns = file, path, now_ns
        self.count = 0
        self._namespace = namespace

    def __call__(self, topic: str, kind: Any, latch: bool = False, **_: Any) -> "FileTopic":
        """Return the publisher of a topic, with the arguments of rospy.Publisher."""
        name = topic if topic.startswith("/") else f"{self._namespace}/{topic}"
        return FileTopic(self, name, kind, latch)


class FileTopic:
    """The publisher of one topic, and its only connection.  The file has the topic from its first message on.

    `write_data` and `publish` raise OutputError if the file cannot be written.
    """

    socket = None

    def __init__(self, topics: FileTopics, name: str, kind: Any, latched: bool) -> None:
        self._topics, self._name, self._kind, self._latched = topics, name, kind, latched
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
        topics = self._topics
        try:
            if self._channel is None:
                self._channel = topics.file.add(self._name, self._kind, self._latched)
            topics.file.write(self._channel, data, topics.now_ns())
            topics.count += 1
        except OSError as error:
            raise unwritable(topics.path, error) from None
