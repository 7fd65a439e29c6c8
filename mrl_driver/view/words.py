"""Why a robot stands, in words for newcomers.  No I/O.

The reasons are those of this program (`motion_command.STOPS`), of the board (`table.STOP_REASONS`), and the causes of
the ROS node (`stopped by` in its status).
"""

from typing import TYPE_CHECKING, Dict, NamedTuple

from mrl_driver.errors import BoardTimeout, HostBusy
from mrl_driver.problems import PROBLEMS

if TYPE_CHECKING:
    from mrl_driver.driver import Driver


class Stop(NamedTuple):
    """Why a robot stands, and what to do."""

    why: str
    """The end of a sentence that begins with `stopped: `; empty if somebody wanted the robot to stand."""
    remedy: str = ""
    """What must be done before the robot drives again; empty if a new command is enough."""
    code: str = ""
    """Code of the row in `problems`; empty if somebody wanted the robot to stand."""


ELSEWHERE = "another program drives"
"""In place of a stop reason: the robot does not stand, but drives by commands that this program does not see."""


def _stop(why: str, code: str, remedied: bool = True) -> Stop:
    """The words for a stop; with `remedied` its remedy is that of the problem with this code."""
    return Stop(why, PROBLEMS[code].remedy if remedied else "", code)


_BATTERY = _stop("the battery is empty or switched off", "battery_off")
_HELD = Stop("another robot holds this one by radio", "wait until that robot frees it", "radio_hold")
_NO_NUMBER = _stop("a command was not a number", "not_a_number", False)
_SILENT = _stop("no data arrived from the robot", "no_telemetry")
STOPS: Dict[str, Stop] = {
    "none": Stop(""),
    "user": Stop(""),
    "host": Stop(""),
    "not a number": _NO_NUMBER,
    "command not finite": _NO_NUMBER,
    "command timeout": _stop("no new command arrived in time", "command_timeout"),
    "command too late": _stop("a command arrived too late", "command_too_late"),
    "battery": _BATTERY,
    "undervoltage": _stop("the battery fell below the parameter undervoltage", "undervoltage"),
    "wheel mismatch": _stop("a wheel did not follow its command", "wheel_fault"),
    "wheel blocked": _stop("a wheel did not turn at full drive", "wheel_blocked"),
    "encoder": _stop("an encoder was silent or counted the other direction", "encoder_dead"),
    "motor board": _stop("the motor board did not answer", "motor_board"),
    "stale": _SILENT,
    "no telemetry": _SILENT,
    "no telemetry, may still be moving": _stop(
        "no data arrived from the robot, and it may still be moving", "may_be_moving"
    ),
    "link lost": _stop("the connection to the robot was lost", "link_lost"),
    "link watchdog": _stop("the robot heard no command in time", "command_timeout"),
    "restarted": _stop("the robot's board restarted", "board_restart", False),
    "boot": _stop("the robot's board has started", "board_restart", False),
    "stall": _stop("the robot's board was busy for too long", "board_stalled", False),
    "check ended": _stop("the program that drove the robot ended its session", "ended"),
    "closed": _stop("the program that drove the robot has ended", "ended"),
    "host paused": _stop("the computer that drives the robot was too busy", "late_host"),
    "radio hold": _HELD,
    "held": _HELD,
    "held by radio": _HELD,
    "emergency stop": _stop("the emergency stop is on", "emergency_stop"),
    "motors disabled": _stop("the motors are switched off", "motors_disabled"),
    "protective zone": _stop("an obstacle is too close", "protective_zone"),
    "change to manual mode": _stop("the robot was switched to manual mode", "manual_mode"),
    "commands without a pause": _stop("a program went on sending commands after a stop", "commands_unpaused"),
}
"""Each reason, with spaces instead of underscores."""


def stop_of(reason: str) -> Stop:
    """Return the words for a stop reason, written with underscores or spaces; an unknown reason is its own words."""
    name = reason.replace("_", " ")
    return STOPS.get(name) or Stop(name)


def why_stopped(reason: str) -> str:
    """Return why the robot stands, such as `no new command arrived in time`; empty if somebody stopped it."""
    return stop_of(reason).why


def stopped_text(reason: str) -> str:
    """Return `stopped`, with the reason unless somebody stopped the robot."""
    why = stop_of(reason).why
    return f"stopped: {why}" if why else "stopped"


def remedy_of(reason: str) -> str:
    """Return what must be done before the robot drives again; empty if a new command is enough."""
    return stop_of(reason).remedy


def stopped_by(driver: "Driver") -> str:
    """Return why the driver's robot stopped, in full: the wheel, or the radio that holds it, and what to do."""
    if driver.mismatch is not None:
        return f"stopped: {driver.mismatch}"
    if driver.hold is not None and driver.hold.held:
        return f"stopped: {driver.hold}"
    remedy = remedy_of(driver.stop_reason)
    return stopped_text(driver.stop_reason) + (f"; {remedy}" if remedy else "")


def stop_error(driver: "Driver", what: str) -> BoardTimeout:
    """Return the error for a drive that did not go on: `what` happened, why, and what to do."""
    stop = stop_of(driver.stop_reason)
    kind = HostBusy if stop.code == HostBusy.code else BoardTimeout
    why = stop.why + (f"; {stop.remedy}" if stop.remedy else "")
    return kind(f"{what}: {why or why_refused(driver, 'try again')}")


def why_refused(driver: "Driver", again: str = "press again") -> str:
    """Return why `Driver.drive` has refused a command, and what to do; `again` says how to send the next one."""
    if not driver.ready:
        return f"the robot sends no data or is just starting; when its data are back, {again}"
    if driver.battery_state in ("empty", "off"):
        return f"the battery is {driver.battery_state} at {driver.battery_v:.1f} V; charge it"
    if driver.mismatch is not None:
        return f"{driver.mismatch}; {again}"
    if driver.hold is not None and driver.hold.held:
        return str(driver.hold)
    return f"the robot takes no commands now; {again}"
