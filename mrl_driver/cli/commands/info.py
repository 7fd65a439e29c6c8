"""`mrl info`: identity of the robot on a port."""

import math
from typing import TYPE_CHECKING, Any, Dict

import click

from mrl_driver.robot.models import kind_of
from mrl_driver.robot.radio import format_address
from mrl_driver.view.shown_state import NO_ODOMETRY, VIRTUAL, has_motors, has_odometry, sensor_texts

from . import shared
from .shared import Run, run_options

if TYPE_CHECKING:
    from mrl_driver.driver import Driver


@click.command()
@run_options(shared.fast_option, shared.json_option)
def info(run: Run) -> None:
    """Show the identity of the robot on a port.

    \b
    Examples:
      mrl info --port /dev/ttyACM0
      mrl info --robot lab3 --json
    """
    port = shared.require_port(run.target)
    with run.connected() as driver:
        shared.await_gyro(driver)
        shared.await_sensors(driver)
        facts, sensors = describe(driver, port), sensor_texts(driver)
    shown = {**facts, "sensors": [f"{name} {value}" for name, value in sensors.items()]}
    run.print(facts, "\n".join(f"{key.replace('_', ' '):>20}  {_text(shown[key])}" for key in shown))


def _text(value: Any) -> str:
    if isinstance(value, float) and math.isnan(value):
        return "not measured"
    if isinstance(value, (list, tuple)):
        return ", ".join(map(str, value)) or "none"
    return "unknown" if value is None else str(value)


def describe(driver: "Driver", port: str) -> Dict[str, Any]:
    """Return the facts about a connected robot: numbers in SI units, with the unit at the end of the key."""
    board, status = driver.board, driver.status
    facts: Dict[str, Any] = {
        "port": port,
        "line_baud": driver.link.baud,
        "robot": driver.model.name if driver.model else None,
        "robot_id": board.robot_id,
        **({"virtual": VIRTUAL} if board.virtual else {}),
        "drive": kind_of(driver.model.drive) if driver.model else None,
        "firmware_version": board.version,
        "protocol_version": board.protocol,
        "capabilities": sorted(board.capabilities),
        "motor_board_version": board.motor_board_version,
        "battery_v": board.battery_v,
        "battery_state": math.nan if math.isnan(board.battery_v) else driver.battery_state,
        "temperature_c": board.temperature_c,
        "imu": driver.imu_state,
        "sonars": sorted(driver.model.sonars) if driver.model else [],
        "sensors": {name: list(found.values) for name, found in driver.sensors.items()},
    }
    if has_motors(driver.model) and not has_odometry(driver.model):
        facts["odometry"] = NO_ODOMETRY
    if driver.imu is not None and driver.imu.bias_known:
        facts["gyro_bias_rad_s"] = driver.imu.bias_rad_s
    if driver.radio.hold is not None:
        facts["hold"] = driver.radio.hold.state
        if driver.radio.hold.holders:
            facts["holder"] = format_address(driver.radio.hold.holder)
    if driver.inputs is not None:
        facts["inputs"] = list(driver.inputs.connected)
        facts["active_inputs"] = list(driver.inputs.active)
        facts["emergency_stop_latched"] = driver.inputs.latched
    if status is not None:
        facts.update(
            uptime_s=status.uptime_s,
            reset_cause=status.reset_cause,
            stop_reason=status.stop_reason,
            faults=list(status.faults),
        )
        if status.impossible is not None:
            facts["impossible_transitions"] = status.impossible
        problem = driver.parameters.wiring_problem() if "wiring" in status.faults else ""
        if problem:
            facts["wiring"] = problem
    if driver.warning:
        facts["note"] = driver.warning.replace("--port PORT", f"--port {port}")
    return facts
