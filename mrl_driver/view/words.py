"""Why a robot stands, in words for newcomers.  No I/O.

The reasons are those of this program (`motion_command.STOPS`), of the board (`table.STOP_REASONS`), and the causes of
the ROS node (`stopped by` in its status).
"""

from typing import TYPE_CHECKING, Dict, NamedTuple

if TYPE_CHECKING:
    from mrl_driver.driver import Driver


class Stop(NamedTuple):
    """Why a robot stands, and what to do."""

    why: str
    """The end of a sentence that begins with `stopped: `; empty if somebody wanted the robot to stand."""
    remedy: str = ""
    """What must be done before the robot drives again; empty if a new command is enough."""


ELSEWHERE = "another program drives"
"""In place of a stop reason: the robot does not stand, but drives by commands that this program does not see."""

_BATTERY = Stop("the battery is empty or switched off", "charge it, or switch it on")
_HELD = Stop("another robot holds this one by radio", "wait until that robot frees it")
_NO_NUMBER = Stop("a command was not a number")
_SILENT = Stop("no data arrived from the robot", "check its power and its cable or radio")
STOPS: Dict[str, Stop] = {
    "none": Stop(""),
    "user": Stop(""),
    "host": Stop(""),
    "not a number": _NO_NUMBER,
    "command not finite": _NO_NUMBER,
    "command timeout": Stop("no new command arrived in time"),
    "command too late": Stop("a command arrived too late", "release the control and press it again"),
    "battery": _BATTERY,
    "undervoltage": Stop("the battery fell below the parameter undervoltage", "charge it"),
    "wheel mismatch": Stop("a wheel did not follow its command", "check wheels, wires and motor power"),
    "wheel blocked": Stop(
        "a wheel did not turn at full drive", "check that it turns freely, and the motor's wires"
    ),
    "encoder": Stop(
        "an encoder was silent or counted the other direction",
        "check its wires, then run: mrl calibrate wiring",
    ),
    "motor board": Stop("the motor board did not answer", "check its wires and its power"),
    "stale": _SILENT,
    "no telemetry": _SILENT,
    "no telemetry, may still be moving": Stop(
        "no data arrived from the robot, and it may still be moving", "stop it by hand"
    ),
    "link lost": Stop("the connection to the robot was lost", "check its cable or radio"),
    "link watchdog": Stop("the robot heard no command in time"),
    "restarted": Stop("the robot's board restarted"),
    "boot": Stop("the robot's board has started"),
    "stall": Stop("the robot's board was busy for too long"),
    "check ended": Stop("the program that drove the robot ended its session"),
    "closed": Stop("the program that drove the robot has ended"),
    "host paused": Stop("the computer that drives the robot was paused"),
    "radio hold": _HELD,
    "held": _HELD,
    "held by radio": _HELD,
    "emergency stop": Stop("the emergency stop is on", "release it"),
    "motors disabled": Stop("the motors are switched off", "switch them on with the service enable_motors"),
    "protective zone": Stop("an obstacle is too close", "drive away from it"),
    "change to manual mode": Stop("the robot was switched to manual mode"),
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
