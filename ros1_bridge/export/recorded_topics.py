"""A recording as messages: the topics of robot_node, and all frames of the serial line."""

import codecs
from typing import Any, Callable, Optional

from genpy import Time
from rosgraph_msgs.msg import Log

from mrl_driver.driver import Telemetry
from mrl_driver.driver.recorded import RecordedDriver
from mrl_driver.protocol import Frame
from mrl_driver.protocol.table import BY_CODE
from mrl_driver.robot.imu import Imu
from mrl_driver.session.events import SensorRead
from mrl_driver.session.handshake import Board
from ros1_bridge.node.robot_parameters import Parameters
from ros1_bridge.topics.board_topics import BoardTopics
from ros1_bridge.topics.publishers import Publishers

FRAMES = "frames"
"""The topic with all frames and remarks.  Its type, Log, has a stamp, and every tool that shows ROS's log shows it."""
TO_BOARD, FROM_BOARD, DRIVER = "to_board", "from_board", "driver"
"""Names in the messages of `FRAMES`; the last one is that of remarks."""
_LATEST_S = 2.0**32 - 2  # ROS counts seconds in 32 bits


def now_ns(recorded: RecordedDriver) -> int:
    """Return the wall clock at the time that is being played [ns since 1970]."""
    return round((recorded.now_s + ahead_s(recorded)) * 1e9)


def ahead_s(recorded: RecordedDriver) -> float:
    """Return by how much the wall clock is ahead of the driver's [s]; a damaged value moves into ROS's range."""
    now_s = recorded.now_s
    return min(max(-now_s, recorded.clock_ahead_s), _LATEST_S - now_s)


class RecordedTopics:
    """Publishes what a recording holds, while `RecordedDriver.play` runs.

    As in robot_node, the robot's topics begin with its first telemetry.  Topics that tell of the node itself, such as
    `status`, are not in a recording.  `publisher_class` makes a publisher of a topic, as rospy.Publisher.
    """

    def __init__(
        self, recorded: RecordedDriver, publisher_class: Callable[..., Any], parameters: Parameters
    ) -> None:
        self._recorded, self._class, self._parameters = recorded, publisher_class, parameters
        self._topics: Optional[BoardTopics] = None
        self._frames, self._log = publisher_class(FRAMES, Log), Log()
        recorded.on_sent(lambda sent: self._tell(TO_BOARD, sent.data, sent.event))
        recorded.on_heard(lambda heard: self._tell(FROM_BOARD, heard.data, heard.event))
        recorded.on_remark(lambda remark: self._tell(DRIVER, remark.text.encode("utf-8", "replace")))
        recorded.on_telemetry(self._on_telemetry)
        recorded.on(Imu, self._passing("on_imu"))
        recorded.on(Board, self._passing("on_battery"))
        recorded.on(SensorRead, self._on_sensor)
        recorded.radio.on_text(self._passing("on_text"))

    def _now(self) -> Time:
        return Time(*divmod(now_ns(self._recorded), 10**9))

    # -- the robot

    def _begin(self) -> BoardTopics:
        recorded, parameters = self._recorded, self._parameters
        assert recorded.model is not None
        publishers = Publishers(
            self._class,
            ConnectionError,
            parameters,
            recorded.model,
            clock=lambda: ahead_s(recorded),  # the difference of both is exact
            monotonic=lambda: 0.0,
        )
        self._topics = BoardTopics(recorded, publishers, self._class, parameters, self._now)
        return self._topics

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        topics = self._topics or self._begin()
        topics.on_telemetry(telemetry)

    def _on_sensor(self, read: SensorRead) -> None:
        model, topics = self._recorded.model, self._topics
        if topics is None and model is not None and not model.drives:
            topics = self._begin()
        if topics is not None and topics.on_sensor is not None:
            topics.on_sensor(read)

    def _passing(self, name: str) -> Callable[[Any], None]:
        """Return what passes events to this method of the topics, once they have begun, if they have it."""

        def take(event: Any) -> None:
            on_event = getattr(self._topics, name, None)
            if on_event is not None:
                on_event(event)

        return take

    # -- the line

    def _tell(self, name: str, data: bytes, event: Any = None) -> None:
        """Publish bytes, escaped as in recordings, with the name of the command or what is wrong with them."""
        log = self._log
        log.header.stamp, log.name = self._now(), name
        log.msg = codecs.escape_encode(data)[0].decode("ascii")
        row = BY_CODE.get(event.code) if isinstance(event, Frame) else None
        damaged = event is not None and not isinstance(event, Frame)
        log.function = event.reason if damaged else row.name if row is not None else ""
        log.level = Log.WARN if damaged else Log.INFO
        self._frames.publish(log)
