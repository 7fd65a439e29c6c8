"""Why a robot stands, in words for newcomers.  No I/O."""

from typing import TYPE_CHECKING, Dict, NamedTuple

from mrl_driver.errors import BoardError, BoardTimeout, HostBusy, WheelFault
from mrl_driver.problems import PROBLEMS
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.safety.wheel_monitor import BOARD_STOPS, FAST, POWERLESS, REVERSED, Mismatch

if TYPE_CHECKING:
    from mrl_driver.driver import Driver


class Stop(NamedTuple):
    """Why a robot stands, and what to do."""

    why: str
    """The end of a sentence that begins with `stopped: `; empty if somebody wanted the robot to stand."""
    remedy: str = ""  # what must be done before the robot drives again; empty if a new command is enough
    code: str = ""  # code of the row in `problems`; empty if somebody wanted the robot to stand


def _stop(why: str, code: str, remedied: bool = True) -> Stop:
    """The words for a stop; with `remedied` its remedy is that of the problem with this code."""
    return Stop(why, PROBLEMS[code].remedy if remedied else "", code)


_S = StopReason
STOPS: Dict[StopReason, Stop] = {
    _S.NONE: Stop(""),
    _S.USER: Stop(""),
    _S.HOST: Stop(""),
    _S.NOT_A_NUMBER: _stop("a command was not a number", "not_a_number", False),
    _S.COMMAND_TIMEOUT: _stop("no new command arrived in time", "command_timeout"),
    _S.COMMAND_TOO_LATE: _stop("a command arrived too late", "command_too_late"),
    _S.BATTERY: _stop("the battery is empty or switched off", "battery_off"),
    _S.UNDERVOLTAGE: _stop("the battery fell below the parameter undervoltage", "undervoltage"),
    _S.WHEEL_MISMATCH: _stop("a wheel did not follow its command", "wheel_fault"),
    _S.WHEEL_BLOCKED: _stop("a wheel did not turn at full drive", "wheel_blocked"),
    _S.ENCODER: _stop("an encoder was silent or counted the other direction", "encoder_dead"),
    _S.MOTOR_BOARD: _stop("the motor board did not answer", "motor_board"),
    _S.NO_TELEMETRY: _stop("no data arrived from the robot", "no_telemetry"),
    _S.MAY_BE_MOVING: _stop("no data arrived from the robot, and it may still be moving", "may_be_moving"),
    _S.LINK_LOST: _stop("the connection to the robot was lost", "link_lost"),
    _S.LINK_WATCHDOG: _stop("the robot heard no command in time", "command_timeout"),
    _S.RESTARTED: _stop("the robot's board restarted", "board_restart", False),
    _S.BOOT: _stop("the robot's board has started", "board_restart", False),
    _S.STALL: _stop("the robot's board was busy for too long", "board_stalled", False),
    _S.CHECK_ENDED: _stop("the program that drove the robot ended its session", "ended"),
    _S.CLOSED: _stop("the program that drove the robot has ended", "ended"),
    _S.HOST_PAUSED: _stop("the computer that drives the robot was too busy", "late_host"),
    _S.HELD: Stop("another robot holds this one by radio", "wait until that robot frees it", "radio_hold"),
    _S.BUMPER: _stop("a bumper was hit", "bumper_hit"),
    _S.CLIFF: _stop("a cliff sensor sees no floor", "cliff"),
    _S.EMERGENCY_STOP: _stop("the emergency stop is on", "emergency_stop"),
    _S.MOTORS_DISABLED: _stop("the motors are switched off", "motors_disabled"),
    _S.PROTECTIVE_ZONE: _stop("an obstacle is too close", "protective_zone"),
    _S.MANUAL_MODE: _stop("the robot was switched to manual mode", "manual_mode"),
    _S.COMMANDS_UNPAUSED: _stop("a program went on sending commands after a stop", "commands_unpaused"),
    _S.RELEASED: Stop("the control was released"),
    _S.GOAL_REACHED: Stop("the goal is reached"),
    _S.GOAL_BLOCKED: Stop("the goal was not reached"),
    _S.GOAL_CHANGED: Stop("the goal changed while the control was held"),
    _S.PAGE_LEFT: Stop("the driving page has left"),
    _S.HELM_GIVEN_UP: Stop("the helm was given up"),
    _S.HELM_HANDED_OVER: Stop("the helm changes hands"),
    _S.DRIVEN_ELSEWHERE: Stop("another program drives"),
    _S.UNKNOWN: Stop("for a reason that this version does not know"),
}


def stopped_text(reason: StopReason) -> str:
    """Return `stopped`, with the reason unless somebody stopped the robot."""
    why = STOPS[reason].why
    return f"stopped: {why}" if why else "stopped"


def remedied_text(reason: StopReason) -> str:
    """Return `stopped_text`, and what must be done before the robot drives again."""
    return "; ".join(filter(None, (stopped_text(reason), STOPS[reason].remedy)))


def stopped_by(driver: "Driver") -> str:
    """Return why the driver's robot stopped, in full: the wheel, or the radio that holds it, and what to do."""
    if driver.mismatch is not None:
        return f"stopped: {driver.mismatch}"
    if driver.radio.hold is not None and driver.radio.hold.held:
        return f"stopped: {driver.radio.hold}"
    return remedied_text(driver.stop_reason)


_MISMATCHES = {REVERSED: "wheel_reversed", POWERLESS: "wheels_powerless", FAST: "speed_scale"}


def fault_code(mismatch: Mismatch) -> str:
    """Return the code of the problem that a wheel has."""
    return BOARD_STOPS.get(mismatch.reason) or _MISMATCHES.get(mismatch.cause, "wheel_dead")


def stop_error(driver: "Driver", what: str) -> BoardError:
    """Return the error for a drive that did not go on: `what` happened, why, and what to do."""
    if driver.mismatch is not None:
        fault = WheelFault(f"{what}: {driver.mismatch}")
        fault.code = BOARD_STOPS.get(driver.mismatch.reason, fault.code)
        return fault
    stop = STOPS[driver.stop_reason]
    if driver.stop_reason is StopReason.BATTERY and driver.battery_state == "empty":
        stop = _stop("the battery is empty", "battery_empty")
    kind = HostBusy if stop.code == HostBusy.code else BoardTimeout
    why = stop.why + (f"; {stop.remedy}" if stop.remedy else "")
    error = kind(f"{what}: {why or why_refused(driver, 'try again')}")
    error.code = stop.code or kind.code
    return error


def why_refused(driver: "Driver", again: str = "press again") -> str:
    """Return why `Driver.drive` has refused a command, and what to do; `again` says how to send the next one."""
    if not driver.ready:
        return f"the robot sends no data or is just starting; when its data are back, {again}"
    if driver.battery_state in ("empty", "off"):
        return f"the battery is {driver.battery_state} at {driver.board.battery_v:.1f} V; charge it"
    if driver.mismatch is not None:
        return f"{driver.mismatch}; {again}"
    if driver.radio.hold is not None and driver.radio.hold.held:
        return str(driver.radio.hold)
    if driver.inputs is not None and (driver.inputs.active or driver.inputs.latched):
        return str(driver.inputs)
    return f"the robot takes no commands now; {again}"
