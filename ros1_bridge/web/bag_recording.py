"""Records topics in a bag while the node runs; the bag is closed before the node ends.  No rospy: the node subscribes.

A bag that is written has a name that ends in `.active`, as `rosbag record` names it.
"""

import datetime
import os
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Callable, Iterable, List, Optional

from mrl_driver.apps.web.robot import Recordings
from mrl_driver.errors import ConfigError, OutputError

SUFFIX, ACTIVE = ".bag", ".active"
Unsubscribe = Callable[[], None]
Subscribe = Callable[[str, Callable[[Any], None]], Unsubscribe]


class BagRecording(Recordings):
    """Writes at most one bag at a time to a folder; any thread may call it.

    `subscribe` calls a function with each message of a topic, a rospy.AnyMsg or one of the topic's type, and returns
    how to end that.  `topics` are asked at the start of each bag; `now` is the time of ROS, a genpy.Time.
    """

    def __init__(
        self, folder: Path, subscribe: Subscribe, topics: Callable[[], Iterable[str]], now: Callable[[], Any]
    ) -> None:
        super().__init__(folder, SUFFIX, ACTIVE)
        self._subscribe, self._topics, self._now = subscribe, topics, now
        self._lock = threading.Lock()
        self._bag: Optional[Any] = None
        self._ends: List[Unsubscribe] = []
        self._name = ""
        self.lost = 0  # messages of the last bag that could not be written
        self.loss = ""  # why the last bag is incomplete; empty if nothing is missing

    @property
    def name(self) -> str:
        """File of the bag that is being written; empty without one."""
        return self._name

    def start(self) -> str:
        """Begin a bag; returns its name.  ConfigError if one is written already, OutputError if it cannot be made."""
        import rosbag  # late: it takes 0.2 s

        topics = self._topics()
        with self._lock:
            if self._bag is not None:
                raise ConfigError(f"{self._name} is being written, expected no recording: stop it first")
            try:
                name = self._new(datetime.datetime.now().strftime("robot_%Y-%m-%d-%H-%M-%S"))
                self._bag = rosbag.Bag(str(self._folder / (name + ACTIVE)), "w")
            except OSError as error:
                raise OutputError(f"the recording cannot be made: {error}") from None
            self._name, self.lost, self.loss = name, 0, ""
        self._ends = [self._subscribe(topic, self._writer(topic)) for topic in topics]
        return name

    def stop(self) -> str:
        """Close the bag, if one is being written; returns why it is incomplete, or an empty string."""
        ends, self._ends = self._ends, []
        for end in ends:
            end()
        with self._lock:
            bag, name, self._bag, self._name = self._bag, self._name, None, ""
            if bag is None:
                return ""
            try:
                bag.close()
                os.replace(self._folder / (name + ACTIVE), self._folder / name)
            except OSError as error:
                written = self._folder / (name + ACTIVE)
                self.loss = f"{name} could not be closed: {error}; try `rosbag reindex {written}`"
            return self.loss

    def _writer(self, topic: str) -> Callable[[Any], None]:
        """Return what writes the messages of a topic."""

        def write(message: Any) -> None:
            header = dict(message._connection_header, topic=topic)
            # a topic that the node itself subscribes to has messages of its type
            raw = hasattr(message, "_buff")
            kind = SimpleNamespace(_md5sum=header["md5sum"], _full_text=header["message_definition"])
            content = (header["type"], message._buff, kind._md5sum, kind) if raw else message
            with self._lock:
                if self._bag is None:
                    return
                try:
                    self._bag.write(topic, content, self._now(), raw=raw, connection_header=header)
                except OSError as error:
                    self.lost += 1
                    self.loss = f"{self.lost} messages are missing: {error.strerror or error}"

        return write
