"""All that a board reports, as topics: which board has which, and what publishes each.  No node."""

import time
from typing import Any, Callable, Optional, Type

from genpy import Time

from mrl_driver.driver import Driver
from mrl_driver.robot.imu import Imu
from mrl_driver.session.events import SensorRead
from mrl_driver.session.handshake import Board
from ros1_bridge.node.robot_parameters import Parameters

from .publishers import Publishers
from .sensor_topics import SensorTopics


class BoardTopics:
    """Advertises the topics of a driver's board, and publishes what the driver receives.

    Args:
        driver: a driver that knows its board.
        publisher_class, lost, clock, monotonic: as for `Publishers`.
        now: the time of ROS, for what has no board time.

    Attributes:
        on_sensor, on_imu: for the driver's callbacks; None if the board has no sensors, or no IMU, or the node does not
            publish them.
    """

    def __init__(
        self,
        driver: Driver,
        publisher_class: Callable[..., Any],
        lost: Type[Exception],
        parameters: Parameters,
        now: Callable[[], Time],
        clock: Callable[[], float] = time.time,
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        board, model = driver.board, driver.model
        assert model is not None
        self._now = now
        self.publishers = Publishers(publisher_class, lost, parameters, model, clock, monotonic)
        self.on_telemetry = self.publishers.telemetry
        self.on_sensor: Optional[Callable[[SensorRead], None]] = None
        self.on_imu: Optional[Callable[[Imu], None]] = None
        if driver.has_sonars and parameters.has("sonars"):
            self.publishers.sonars(now())
        if model.drives:
            self.on_battery(board)
        if parameters.has("sensors"):
            base_frame, capabilities = parameters.base_frame, board.capabilities
            sensors = SensorTopics(publisher_class, base_frame, capabilities, board.version, now)
            self.on_sensor = sensors.on_sensor
            if parameters.imu and "imu" in capabilities:
                self.on_imu = self.publishers.imu(now()).on_imu

    def on_battery(self, board: Board) -> None:
        """Publish voltage and temperature of a board with motors."""
        self.publishers.battery(board, self._now())
