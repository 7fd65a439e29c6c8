"""The diagnostic tasks of the node.  Imports no ROS: the node supplies the updater."""

from typing import Any, Callable

from mrl_driver.driver import Driver
from mrl_driver.robot.hold import CAPABILITY as HOLD
from mrl_driver.transport.baud_rates import FAST_BAUD
from ros1_bridge.control.commander import Commander
from ros1_bridge.node.robot_parameters import Parameters

from . import link_report, robot_status
from .link_report import Report


class Diagnostics:
    """Diagnostics of link, motion, battery, board, IMU and radio, from the driver and the commander."""

    def __init__(self, driver: Driver, commander: Commander, parameters: Parameters) -> None:
        self._driver, self._commander, self._parameters = driver, commander, parameters

    def add_to(self, updater: Any) -> None:
        """Add the tasks to a diagnostic_updater.Updater."""
        driver, model = self._driver, self._driver.model
        updater.add("Link", _task(self._link))
        if model is not None and model.drives:
            capacity_ah = model.battery.capacity_ah
            updater.add("Motion", _task(lambda: robot_status.motion_report(self._commander)))
            updater.add(
                "Battery",
                _task(
                    lambda: robot_status.battery_report(
                        driver.battery_state, driver.board.battery_v, capacity_ah
                    )
                ),
            )
        updater.add(
            "Board", _task(lambda: robot_status.board_report(driver.status, driver.board.temperature_c))
        )
        if self._parameters.imu and "imu" in driver.board.capabilities:
            updater.add("IMU", _task(lambda: robot_status.imu_report(driver.imu_state, driver.imu)))
        if HOLD in driver.board.capabilities:
            updater.add("Radio", _task(lambda: robot_status.radio_report(driver.radio.hold)))

    def _link(self) -> Report:
        driver, parameters = self._driver, self._parameters
        slowed = parameters.fast and driver.link.baud != FAST_BAUD
        values = link_report.values(
            parameters.port,
            driver.link.baud,
            driver.board,
            driver.link.statistics,
            driver.link.age_s,
            driver.telemetry,
        )
        return link_report.health(driver.ready, driver.link.age_s, slowed)._replace(values=values)


def _task(report: Callable[[], Report]) -> Callable[[Any], Any]:
    """What an updater calls with a diagnostic_updater.DiagnosticStatusWrapper."""

    def fill(status: Any) -> Any:
        level, message, values = report()
        status.summary(level, message)
        for key, value in values.items():
            status.add(key, value)
        return status

    return fill
