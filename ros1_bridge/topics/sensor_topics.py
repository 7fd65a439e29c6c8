"""Publishes the sensors of the protocol table on the topics in `sensors.yaml`.  No node.

Topics of sensors that the board certainly has are advertised at the start.  A sensor that may be absent is advertised
when its first reading comes.
"""

import math
import os
import sys
from typing import Any, Callable, Dict, FrozenSet, NamedTuple, Tuple

from genpy import Time
from sensor_msgs.msg import FluidPressure, Illuminance, Imu, RelativeHumidity, Temperature
from std_msgs.msg import Float32, Float32MultiArray, UInt16

from mrl_driver import yaml_file
from mrl_driver.geometry import quaternion_of
from mrl_driver.protocol.table import SENSOR_BY_NAME
from mrl_driver.session.sensor_polling import Reading, of_board
from ros1_bridge.node.tf_names import beside

from .fast_publisher import direct_publisher
from .message_covariance import UNUSED_VARIANCE

FILE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "sensors.yaml")
Values = Tuple[float, ...]
_MOST = sys.float_info.max


class SensorTopic(NamedTuple):
    """One topic; the head of `sensors.yaml` explains the fields."""

    sensor: str
    type: str
    factor: float = 1.0
    variance: float = 0.0
    frame: str = ""


class MessageKind(NamedTuple):
    """A message class, and the function that writes values into its messages."""

    message: type
    fill: Callable[[Any, Values], None]


def fill_compass(message: Imu, values: Values) -> None:
    """Write a bearing [deg, clockwise from north] as a yaw (counter-clockwise from east, REP-103)."""
    message.orientation.z, message.orientation.w = quaternion_of(math.radians(90.0 - values[0]))


def _set(name: str, convert: Callable[[float], Any] = float) -> Callable[[Any, Values], None]:
    return lambda message, values: setattr(message, name, convert(values[0]))


KINDS: Dict[str, MessageKind] = {
    "std_msgs/UInt16": MessageKind(UInt16, _set("data", round)),
    "std_msgs/Float32": MessageKind(Float32, _set("data")),
    "std_msgs/Float32MultiArray": MessageKind(
        Float32MultiArray, lambda message, values: setattr(message, "data", list(values))
    ),
    "sensor_msgs/Temperature": MessageKind(Temperature, _set("temperature")),
    "sensor_msgs/RelativeHumidity": MessageKind(RelativeHumidity, _set("relative_humidity")),
    "sensor_msgs/FluidPressure": MessageKind(FluidPressure, _set("fluid_pressure")),
    "sensor_msgs/Illuminance": MessageKind(Illuminance, _set("illuminance")),
    "sensor_msgs/Imu": MessageKind(Imu, fill_compass),
}
"""Message types that a sensor can be published as."""


class SensorTopics:
    """Publishes sensor readings; raises ConfigError if `sensors.yaml` has an error."""

    def __init__(
        self,
        publisher_class: Callable[..., Any],
        base_frame: str,
        capabilities: FrozenSet[str],
        version: int,
        clock: Callable[[], Time],
        path: str = FILE,
    ) -> None:
        self._class, self._clock = publisher_class, clock
        known = {row.name for row in of_board(capabilities, version)}
        self._entries = {topic: each for topic, each in load(path).items() if each.sensor in known}
        self._messages = {topic: new_message(each, base_frame) for topic, each in self._entries.items()}
        self._out: Dict[str, Any] = {}
        for topic, each in self._entries.items():
            if SENSOR_BY_NAME[each.sensor].capability:
                self._publisher(topic)

    def on_sensor(self, event: Tuple[str, Reading]) -> None:
        """Publish a reading."""
        name, found = event
        for topic, entry in self._entries.items():
            if entry.sensor == name:
                message = self._messages[topic]
                fill(message, entry, found.values, self._clock())
                self._publisher(topic).publish(message)

    def _publisher(self, topic: str) -> Any:
        if topic not in self._out:
            kind = KINDS[self._entries[topic].type].message
            self._out[topic] = direct_publisher(self._class, topic, kind)
        return self._out[topic]


def new_message(entry: SensorTopic, base_frame: str) -> Any:
    """A message without values, with frame and variance set."""
    message = KINDS[entry.type].message()
    if hasattr(message, "header"):
        message.header.frame_id = beside(base_frame, entry.frame) if entry.frame else base_frame
    if hasattr(message, "variance"):
        message.variance = entry.variance
    if isinstance(message, Imu):  # only a heading: -1 means that there are no rates and no accelerations
        unused = UNUSED_VARIANCE
        message.orientation_covariance = [unused, 0, 0, 0, unused, 0, 0, 0, entry.variance]
        message.angular_velocity_covariance[0] = message.linear_acceleration_covariance[0] = -1
    return message


def fill(message: Any, entry: SensorTopic, values: Values, stamp: Time) -> None:
    """Write values (in the unit of the table's row) and their time into a message of `new_message`."""
    KINDS[entry.type].fill(message, tuple(value * entry.factor for value in values))
    if hasattr(message, "header"):
        message.header.stamp = stamp


def load(path: str = FILE) -> Dict[str, SensorTopic]:
    """Read the topics from a file; ConfigError, which names topic, key and value, if it is missing or has an error."""
    data = yaml_file.read_expected(path, "topics as YAML")
    reader = yaml_file.Reader(path)
    topics = reader.mapping("", data, "topics with their type")
    return {topic: _entry(reader, topic, found) for topic, found in topics.items()}


def _entry(reader: yaml_file.Reader, topic: str, found: Any) -> SensorTopic:
    reader.mapping(topic, found, f"the keys {', '.join(SensorTopic._fields)}")
    keys = reader.keys(topic, found, SensorTopic._fields, SensorTopic._fields)
    entry = SensorTopic(**{"sensor": topic, "type": None, **keys})
    number = yaml_file.is_number
    for key, good, expected in (
        ("sensor", entry.sensor in SENSOR_BY_NAME, ", ".join(SENSOR_BY_NAME)),
        ("type", entry.type in KINDS, ", ".join(KINDS)),
        ("factor", number(entry.factor, -_MOST, _MOST) and entry.factor != 0, "a number but 0"),
        ("variance", number(entry.variance, 0, _MOST), "0 or more"),
        ("frame", isinstance(entry.frame, str), "a frame"),
    ):
        if not good:
            raise reader.fail(f"{topic}.{key}", getattr(entry, key), expected)
    return entry
