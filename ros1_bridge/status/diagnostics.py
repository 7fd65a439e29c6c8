"""The diagnostic tasks of the node.  Imports no ROS: the node supplies the updater."""

from functools import partial
from typing import Any, Callable, Dict

from mrl_driver.driver import Driver
from mrl_driver.robot.hold import CAPABILITY as HOLD
from mrl_driver.transport.baud_rates import FAST_BAUD
from mrl_driver.view.shown_state import VIRTUAL
from ros1_bridge.control.commander import Commander
from ros1_bridge.node.robot_parameters import Parameters

from . import link_report
from .link_report import WARN, Report
from .robot_status import battery_report, board_report, imu_report, inputs_report, motion_report, radio_report

_KNOWS_SILENCE = ("Link", "Motion")


def add_tasks(updater: Any, driver: Driver, commander: Commander, parameters: Parameters) -> None:
    """Add the diagnostics of link, motion, battery, board, IMU, radio and inputs to a diagnostic_updater.Updater."""
    capabilities, model = driver.board.capabilities, driver.model
    tasks: Dict[str, Callable[[], Report]] = {"Link": lambda: _link(driver, parameters)}
    if model is not None and model.drives:
        capacity_ah = model.battery.capacity_ah
        tasks["Motion"] = lambda: motion_report(commander, model.has_odometry)
        tasks["Battery"] = lambda: battery_report(driver.battery_state, driver.board.battery_v, capacity_ah)
    tasks["Board"] = lambda: board_report(driver.status, driver.board.temperature_c)
    if parameters.imu and "imu" in capabilities:
        tasks["IMU"] = lambda: imu_report(driver.imu_state, driver.imu)
    if HOLD in capabilities:
        tasks["Radio"] = lambda: radio_report(driver.radio.hold)
    if driver.inputs is not None:
        tasks["Inputs"] = lambda: inputs_report(driver.inputs)
    for name, report in tasks.items():
        updater.add(name, _task(report if name in _KNOWS_SILENCE else partial(_last_known, driver, report)))


def _last_known(driver: Driver, report: Callable[[], Report]) -> Report:
    """The report; while no data arrives, its values are old, and it is at least a warning."""
    level, message, values = report()
    if driver.ready:
        return Report(level, message, values)
    return Report(max(level, WARN), f"{message}; last known: the robot sends no data", values)


def _link(driver: Driver, parameters: Parameters) -> Report:
    link = driver.link
    slowed = parameters.fast and link.baud != FAST_BAUD
    values = link_report.values(
        parameters.port, link.baud, driver.board, link.statistics, link.age_s, driver.telemetry
    )
    report = link_report.health(driver.ready, link.age_s, slowed)._replace(values=values)
    return report._replace(message=f"{report.message}; {VIRTUAL}") if driver.board.virtual else report


def _task(report: Callable[[], Report]) -> Callable[[Any], Any]:
    """What an updater calls with a diagnostic_updater.DiagnosticStatusWrapper."""

    def fill(status: Any) -> Any:
        level, message, values = report()
        status.summary(level, message)
        for key, value in values.items():
            status.add(key, value)
        return status

    return fill
