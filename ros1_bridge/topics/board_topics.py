"""All that a board reports, as topics: which board has which, and what publishes each.  No node."""

from typing import Any, Callable, Optional

from diagnostic_msgs.msg import KeyValue
from genpy import Time

from mrl_driver.driver import Driver
from mrl_driver.robot.imu import Imu
from mrl_driver.robot.radio import CAPABILITY as RADIO
from mrl_driver.robot.radio import RadioText, format_address
from mrl_driver.session.events import SensorRead
from mrl_driver.session.handshake import Board
from ros1_bridge.node.robot_parameters import Parameters

from .fast_publisher import direct_publisher
from .publishers import Publishers
from .sensor_topics import SensorTopics


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
        if driver.has_sonars and parameters.has("sonars"):
            publishers.sonars(now())
        self.on_battery(board)
        if parameters.has("sensors"):
            base_frame, capabilities = parameters.base_frame, board.capabilities
            sensors = SensorTopics(publisher_class, base_frame, capabilities, board.version, now)
            self.on_sensor = sensors.on_sensor
            if parameters.imu and "imu" in capabilities:
                self.on_imu = publishers.imu(now()).on_imu
            if RADIO in capabilities:
                self.on_text = radio_texts(publisher_class)

    def listen(self, driver: Driver) -> None:
        """Let the driver call this."""
        driver.on_telemetry(self.on_telemetry)
        driver.on(Board, self.on_battery)
        if self.on_sensor is not None:
            driver.on(SensorRead, self.on_sensor)
        if self.on_imu is not None:
            driver.on(Imu, self.on_imu)
        if self.on_text is not None:
            driver.radio.on_text(self.on_text)

    def on_battery(self, board: Board) -> None:
        """Publish voltage and temperature; boards without motors measure none."""
        if self._has_battery:
            self._publishers.battery(board, self._now())


def radio_texts(publisher_class: Callable[..., Any]) -> Callable[[RadioText], None]:
    """Advertise the texts that the board's radio receives; returns what publishes one with its sender's address."""
    out = direct_publisher(publisher_class, "xbee/received", KeyValue)
    return lambda text: out.publish(KeyValue(format_address(text.address), text.text))
