"""The diagnostic tasks of the node.  Imports no ROS: the node supplies the updater."""

from typing import Any, Dict

from mrl_driver.driver import Driver
from mrl_driver.robot.hold import CAPABILITY as HOLD
from mrl_driver.transport.baud_rates import FAST_BAUD
from ros1_bridge.control.commander import Commander
from ros1_bridge.node.robot_parameters import Parameters

from . import link_report, robot_status

Wrapper = Any
"""A diagnostic_updater.DiagnosticStatusWrapper."""


class Diagnostics:
    """Diagnostics of link, motion, battery, board and IMU, from the driver and the speed limiter."""

    def __init__(self, driver: Driver, commander: Commander, parameters: Parameters) -> None:
        self._driver, self._commander, self._parameters = driver, commander, parameters

    def add_to(self, updater: Any) -> None:
        """Add the tasks to a diagnostic_updater.Updater."""
        updater.add("Link", self._link)
        if self._driver.model is not None and self._driver.model.drives:
            updater.add("Motion", self._motion)
            updater.add("Battery", self._battery)
        updater.add("Board", self._board)
        if self._parameters.imu and "imu" in self._driver.board.capabilities:
            updater.add("IMU", self._imu)
        if HOLD in self._driver.board.capabilities:
            updater.add("Radio", self._radio)

    def _link(self, status: Wrapper) -> Wrapper:
        driver, parameters = self._driver, self._parameters
        slowed = parameters.fast and driver.link.baud != FAST_BAUD
        health = link_report.health(driver.ready, driver.link.age_s, slowed)
        values = link_report.values(
            parameters.port,
            driver.link.baud,
            driver.board,
            driver.link.statistics,
            driver.link.age_s,
            driver.telemetry,
        )
        return _filled(status, health, values)

    def _motion(self, status: Wrapper) -> Wrapper:
        commander = self._commander
        health = robot_status.motion_health(commander.driving, commander.stopped_by)
        return _filled(status, health, robot_status.motion_values(commander))

    def _battery(self, status: Wrapper) -> Wrapper:
        driver = self._driver
        assert driver.model is not None
        state, volts = driver.battery_state, driver.board.battery_v
        values = robot_status.battery_values(volts, state, driver.model.battery.capacity_ah)
        return _filled(status, robot_status.battery_health(state, volts), values)

    def _board(self, status: Wrapper) -> Wrapper:
        report = self._driver.status
        values = robot_status.board_values(report, self._driver.board.temperature_c)
        return _filled(status, robot_status.board_health(report), values)

    def _imu(self, status: Wrapper) -> Wrapper:
        state, imu = self._driver.imu_state, self._driver.imu
        return _filled(status, robot_status.imu_health(state), robot_status.imu_values(state, imu))

    def _radio(self, status: Wrapper) -> Wrapper:
        hold = self._driver.radio.hold
        if hold is None:
            return _filled(
                status, link_report.LinkHealth(link_report.WARN, "the board has not answered yet"), {}
            )
        return _filled(status, robot_status.radio_health(hold), robot_status.radio_values(hold))


def _filled(status: Wrapper, health: link_report.LinkHealth, values: Dict[str, str]) -> Wrapper:
    status.summary(health.level, health.message)
    for key, value in values.items():
        status.add(key, value)
    return status
