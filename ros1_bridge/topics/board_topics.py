"""All that a board reports, as topics: which board has which, and what publishes each.  No node."""

import math
from typing import Any, Callable, Dict, Optional

from diagnostic_msgs.msg import KeyValue
from genpy import Time
from std_msgs.msg import Bool, Header, String

from mrl_driver.driver import Driver, Telemetry
from mrl_driver.robot.imu import Imu
from mrl_driver.robot.inputs import CAPABILITY as INPUTS
from mrl_driver.robot.inputs import Inputs
from mrl_driver.robot.radio import CAPABILITY as RADIO
from mrl_driver.robot.radio import RadioText, format_address
from mrl_driver.session.events import SensorRead
from mrl_driver.session.handshake import Board
from ros1_bridge.node.robot_parameters import Parameters

from .fast_publisher import direct_publisher
from .publishers import Publishers
from .sensor_topics import SensorTopics
from .typed_messages import typed

SERVOS_S = 0.05
"""The angles of the servos are published after this time [s]."""


class BoardTopics:
    """Advertises the topics of a driver's board; its methods and attributes `on_...` are callbacks for the driver.

    The driver must know its board; `publishers` advertise what every board has.  `now` is the time of ROS, for what has
    no board time.  `on_sensor`, `on_imu` and `on_text` are None if the board has no sensors, IMU or radio, or the
    parameters turn them off.
    """

    def __init__(
        self,
        driver: Driver,
        publishers: Publishers,
        publisher_class: Callable[..., Any],
        parameters: Parameters,
        now: Callable[[], Time],
    ) -> None:
        board, model = driver.board, driver.model
        assert model is not None
        self._publishers, self._now = publishers, now
        self._has_battery = model.drives
        self.on_telemetry = publishers.telemetry
        self.on_sensor: Optional[Callable[[SensorRead], None]] = None
        self.on_imu: Optional[Callable[[Imu], None]] = None
        self.on_text: Optional[Callable[[RadioText], None]] = None
        self.on_inputs: Optional[Callable[[object], None]] = None  # takes all events
        if model.sonars and parameters.has("sonars"):
            publishers.sonars(now())
        if model.drives and parameters.publish_footprint:
            publishers.footprint(now())
        self.on_battery(board)
        if parameters.has("sensors"):
            base_frame, capabilities = parameters.base_frame, board.capabilities
            sensors = SensorTopics(publisher_class, base_frame, capabilities, board.version, now)
            self.on_sensor = sensors.on_sensor
            if parameters.imu and "imu" in capabilities:
                self.on_imu = publishers.imu(now()).on_imu
            if INPUTS in capabilities:
                self.on_inputs = input_topics(publisher_class, now)
            if RADIO in capabilities:
                self.on_text = radio_texts(publisher_class)

    def listen(self, driver: Driver) -> None:
        """Let the driver call this."""
        driver.on_telemetry(self.on_telemetry)
        if driver.servos.mounts:
            driver.on_telemetry(self._on_servos(driver))
        driver.on(Board, self.on_battery)
        if self.on_sensor is not None:
            driver.on(SensorRead, self.on_sensor)
        if self.on_imu is not None:
            driver.on(Imu, self.on_imu)
        if self.on_inputs is not None:
            driver.on_event(self.on_inputs)
            self.on_inputs(driver.inputs)
        if self.on_text is not None:
            driver.radio.on_text(self.on_text)

    def _on_servos(self, driver: Driver) -> Callable[[Telemetry], None]:
        """What publishes the angles of the servos, with some of the telemetry."""
        due_s = -math.inf

        def publish(telemetry: Telemetry) -> None:
            nonlocal due_s
            if telemetry.stamp_s >= due_s:
                due_s = telemetry.stamp_s + SERVOS_S
                self._publishers.servos(driver.servos.angles, self._now())

        return publish

    def on_battery(self, board: Board) -> None:
        """Publish voltage and temperature; boards without motors measure none."""
        if self._has_battery:
            self._publishers.battery(board, self._now())


def input_topics(publisher_class: Callable[..., Any], now: Callable[[], Time]) -> Callable[[object], None]:
    """Return what publishes changed `Inputs`, and at first advertises those that are connected; it ignores the rest.

    `bumper` and `cliff` have the active sides, such as `left right`; `emergency_stop` is true until it is released.
    """
    made = typed("Bumper")
    values: Dict[str, Callable[[Inputs], Any]] = {
        "bumper": lambda inputs: inputs.sides("bumper"),
        "cliff": lambda inputs: inputs.sides("cliff"),
        "emergency_stop": lambda inputs: inputs.latched,
    }
    outs: Dict[str, Any] = {}
    told: Dict[str, Any] = {}

    def publish(event: object) -> None:
        if not isinstance(event, Inputs):
            return
        for topic, value in values.items():
            found = value(event)
            if told.get(topic) == found or not any(name.startswith(topic) for name in event.connected):
                continue
            told[topic] = found
            if isinstance(found, bool):
                message = Bool(found)
            elif made is None:
                message = String(" ".join(found))
            else:
                message = made(header=Header(0, now(), ""), **dict.fromkeys(found, True))
            if topic not in outs:
                outs[topic] = direct_publisher(publisher_class, topic, type(message), latch=True)
            outs[topic].publish(message)

    return publish


def radio_texts(publisher_class: Callable[..., Any]) -> Callable[[RadioText], None]:
    """Advertise the texts that the board's radio receives; returns what publishes one with its sender's address."""
    out = direct_publisher(publisher_class, "xbee/received", KeyValue)
    return lambda text: out.publish(KeyValue(format_address(text.address), text.text))
