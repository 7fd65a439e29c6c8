"""Checks of a connected board: identity, power supply, faults, link.  The robot stands still."""

import math
from typing import TYPE_CHECKING, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence

from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.protocol.table import BY_NAME, FAULTS, REASONS, SENSOR_BY_NAME
from mrl_driver.robot import imu
from mrl_driver.robot.hold import Hold
from mrl_driver.robot.inputs import EMERGENCY, SAFETY, Inputs
from mrl_driver.robot.models import ECHO_INPUTS, RobotModel, SonarMount
from mrl_driver.robot.robot_state import assumes_sonars
from mrl_driver.session.handshake import Board
from mrl_driver.session.sensor_polling import Reading, text
from mrl_driver.session.session import Status
from mrl_driver.view.shown_state import NO_ODOMETRY, VIRTUAL
from mrl_driver.view.words import STOPS

from .findings import NOTE, Finding, fault, note, ok, warning, warning_if

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

MEASURE_S = 1.0
ROUND_TRIPS = 40
CALCULATED = "look for a fault that is set: mrl config get virtual_faults --port PORT"
"""Advice about a virtual robot, which has no cables and no battery that other advice could be for."""
HOT_C = 60.0  # temperature of the motor board that is too high [degC]
SLOW_ROUND_TRIP_S = 0.05
"""A round trip above this is slow [s]: the serial link takes 3 ms, a USB adapter up to 16 ms more."""
MIN_SHARE = 0.9  # smallest acceptable share of the expected stream frames
_NETWORK = "bring robot and access point closer together, or use a channel with less traffic"
_FAULTY_STOPS = {
    StopReason.WHEEL_BLOCKED: "wheel_blocked",
    StopReason.ENCODER: "encoder_dead",
    StopReason.UNDERVOLTAGE: "undervoltage",
}
"""Stops of the board that are problems, and their codes."""
_INPUT_CODES = {"bumper": "bumper_hit", "cliff": "cliff", "emergency": EMERGENCY}
_ECHO_ADVICE = "check its supply of 5 V, and its wires to the board"
_RESETS = {"watchdog": "firmware_hung", "brown_out": "brown_out"}
_FAULT_CODES = {"imu": "imu_dead"}  # codes of faults that differ from their names


class LinkFigures(NamedTuple):
    """Measurements of the link."""

    rate_hz: float  # stream frames per second
    expected_hz: Optional[float]  # None if the board streams as fast as it can
    lost: int
    garbage: Dict[str, int]
    round_trips_s: List[float]  # times from request to answer, ascending


def of_robot(driver: "Driver", findings: Iterator[Finding]) -> Iterator[Finding]:
    """Yield findings about the robot; one that is virtual gets its own advice."""
    virtual = driver.board.virtual
    return (
        each._replace(advice=CALCULATED) if virtual and each.advice and each.level != NOTE else each
        for each in findings
    )


def identity(board: Board, model: Optional[RobotModel]) -> Iterator[Finding]:
    """Check the board's identity and the capabilities of its firmware."""
    if board.robot_id == 0:
        yield fault("id_unset", "robot id", "not set")
    elif model is None or board.robot_id not in model.ids:
        advice = "give the robot's file: --robot FILE.yaml"
        yield warning("wrong_robot", "robot id", f"no packaged model lists {board.robot_id}", advice)
    else:
        yield ok("robot", f"{model.name} {board.robot_id}")
    if board.virtual:
        yield note("virtual", "virtual", VIRTUAL)
    if board.version < 2:
        yield warning("no_watchdog", "firmware", "1 (2013): works, but has no watchdog and no checksum")
        return
    yield ok("firmware", f"version {board.version}, protocol {board.protocol}")
    yield ok("capabilities", ", ".join(sorted(board.capabilities)))
    if "watchdog" not in board.capabilities:
        yield fault("no_watchdog", "watchdog", "the board has none: it does not stop if this computer fails")


def supply(board: Board, model: Optional[RobotModel]) -> Iterator[Finding]:
    """Check battery and motor board, as far as the board measures them."""
    if model is not None and not model.drives:
        yield ok("motors", "none: the board has sensors, and something else drives its robot")
        return
    if model is not None and not model.has_odometry:
        yield note("no_odometry", "odometry", NO_ODOMETRY)
    if "no_battery" in board.capabilities:
        yield note("no_battery", "battery", "not measured")
    else:
        yield from _battery(board, model)
    if "bridge" not in board.capabilities:
        text = f"firmware {board.motor_board_version:.2f}, {board.temperature_c:.0f} degC"
        yield warning_if(board.temperature_c > HOT_C, "hot", "motor board", text)


def _battery(board: Board, model: Optional[RobotModel]) -> Iterator[Finding]:
    text = f"{board.battery_v:.1f} V"
    if model is not None:
        levels = model.battery
        if board.battery_v < levels.off_v:
            yield fault("battery_off", "battery", f"{text}: motor power is off")
        elif board.battery_v < levels.empty_v:
            advice = f"charge it; it must have {levels.empty_v:g} V to start"
            yield fault("battery_empty", "battery", f"{text}: empty", advice)
        elif board.battery_v < levels.low_v:
            yield warning("battery_low", "battery", f"{text}: low")
        else:
            yield ok("battery", f"{text} (full {levels.full_v:g} V, low below {levels.low_v:g} V)")


def health(status: Optional[Status], wiring: str = "") -> Iterator[Finding]:
    """Check the faults that the board reports, its last stop, and the cause of its last start.

    `wiring` is what is wrong with the pins of an H-bridge board.
    """
    if status is None:
        return
    words = dict(FAULTS)
    words["wiring"] = wiring or words["wiring"]
    for name in status.faults:
        yield fault(_FAULT_CODES.get(name, name), "board's fault", words[name].rstrip("."))
    cause = status.reset_cause
    since = f"{cause.replace('_', ' ')}, {status.uptime_s} s ago"
    yield warning_if(cause in _RESETS, _RESETS.get(cause, ""), "last start", since)
    if status.stop_reason in _FAULTY_STOPS:
        reason = status.stop_reason
        yield warning(_FAULTY_STOPS[reason], "last stop", f"{reason.words}: {STOPS[reason].why}")
    if status.impossible:
        yield note("encoder_noise", "encoders", f"{status.impossible} transitions skipped a state")
    if status.clamped:
        yield note("clamped", "speed ceiling", f"clamped {status.clamped} commands")


def inputs(found: Optional[Inputs]) -> Iterator[Finding]:
    """Check the inputs that stop the robot; one that is active although nobody touches it may be broken."""
    if found is None:
        return
    first = (*found.active, *[EMERGENCY] * found.latched, "")[0]
    code = _INPUT_CODES.get(first.partition("_")[0], "")
    yield warning_if(bool(first), code, "inputs", f"{found}; {SAFETY}")


def hold(found: Optional[Hold]) -> Iterator[Finding]:
    """Check whether other robots hold this one by radio."""
    if found is not None and found.held:
        finding = warning("radio_hold", "radio", str(found))
        yield finding if found.state == "silent" else finding._replace(advice="")


def watch(driver: "Driver", seconds: float = MEASURE_S, trips: int = ROUND_TRIPS) -> LinkFigures:
    """Measure the stream, then the round trips of requests."""
    before = driver.link.statistics
    driver.wait(seconds)
    count = driver.link.statistics.streamed - before.streamed
    times = sorted(_round_trip_s(driver) for _ in range(trips))
    seen = driver.link.statistics
    garbage = {
        reason: number - before.garbage.get(reason, 0)
        for reason, number in seen.garbage.items()
        if number > before.garbage.get(reason, 0)
    }
    expected = 50.0 if "period" in driver.board.capabilities else None
    return LinkFigures(count / seconds, expected, seen.lost - before.lost, garbage, times)


def _round_trip_s(driver: "Driver") -> float:
    start_s = driver.now_s
    driver.ask(BY_NAME["get_stream"].code)  # not get_debug: 2013 boards answer it with text as well
    return driver.now_s - start_s


def link(seen: LinkFigures, by_network: bool = False) -> Iterator[Finding]:
    """Check the quality of the link, by cable or network."""
    slow = seen.expected_hz is not None and seen.rate_hz < MIN_SHARE * seen.expected_hz
    expected = f" of {seen.expected_hz:.0f}" if seen.expected_hz is not None else ""
    network = _NETWORK if by_network else ""
    rate = f"{seen.rate_hz:.0f}{expected} frames/s"
    yield warning_if(slow, "slow_telemetry", "telemetry", rate, network)
    damage = sum(seen.garbage.values())
    if seen.lost or damage:
        kinds = ", ".join(f"{count} {reason}" for reason, count in sorted(seen.garbage.items()))
        text = f"{seen.lost} frames lost, {damage} pieces of data damaged" + (f" ({kinds})" if kinds else "")
        yield warning("bad_cable", "damage", text, network)
    else:
        yield ok("damage", "no frame lost or damaged")
    if not seen.round_trips_s:
        return
    middle, worst = seen.round_trips_s[len(seen.round_trips_s) // 2], seen.round_trips_s[-1]
    text = f"{middle * 1000:.1f} ms from request to answer, at worst {worst * 1000:.1f} ms"
    yield warning_if(middle > SLOW_ROUND_TRIP_S, "slow_line", "latency", text, network)


def sonars(ranges: Mapping[str, float], board: Board, mounts: Mapping[str, SonarMount]) -> Iterator[Finding]:
    """Check the present reading of each sonar, of those that are mounted so."""
    if (board.version >= 2 or board.capabilities) and "sonars" not in board.capabilities:
        yield note("no_sonars", "sonars", "none: this firmware is the build for environment sensors")
        return
    for name, value in ranges.items():
        if math.isnan(value):
            advice = _ECHO_ADVICE if mounts[name].input in ECHO_INPUTS else ""
            yield fault("sonar_dead", f"sonar {name}", "no reading", advice)
        else:
            words = (
                f"{value:.2f} m" if math.isfinite(value) else "nothing in range" if value > 0 else "too close"
            )
            yield ok(f"sonar {name}", words)


def build(driver: "Driver") -> Iterator[Finding]:
    """Check the build that the robot model names; 2013 boards do not report theirs."""
    text, _, advice = driver.build_warning.partition("; ")
    if text:
        yield warning("build", "build", text, advice)
    elif driver.model is not None and assumes_sonars(driver.model, driver.board):
        yield note("build", "build", "taken as sonar: a board of 2013 does not report it")


def sensors(readings: Mapping[str, Reading], missing: Sequence[str] = ()) -> Iterator[Finding]:
    """Show the present reading of each other sensor that answers, and those that the board has without a reading."""
    for name, found in readings.items():
        yield ok(name, text(SENSOR_BY_NAME[name], found))
    for name in missing:
        yield warning("sensor_silent", name, "no reading")


def gyro(driver: "Driver") -> Iterator[Finding]:
    """Check the IMU; no finding if the board has none."""
    state, found = driver.imu_state, driver.imu
    if state == imu.ABSENT and found is None:
        return
    if state == imu.OFF:
        yield note("imu_off", "imu", "not read, because that needs checksums and a fast serial link")
    elif state == imu.LEARNING:
        yield warning("imu_learning", "imu", "the bias of its gyro is not known")
    elif state == imu.IN_USE and found is not None:
        bias = f"{math.degrees(found.bias_rad_s):+.2f} deg/s"
        yield ok("imu", f"gives the heading together with the wheels; bias of the gyro: {bias}")
    else:
        found_now = state if state in imu.CODES else imu.SILENT
        yield fault(imu.CODES[found_now], "imu", f"not used: {imu.CAUSES[found_now]}")


def refusals(counts: Dict[str, int], has_motors: bool = True) -> Iterator[Finding]:
    """Check what the board has refused since its start.

    `noise` is normal when a port is opened; `beyond_int16`, because each greeting begins with requests for boards of
    2013 (`table.WRAP`); and `unavailable` on a board without motors, which gets stops too.
    """
    texts = {reason.name: reason.text.rstrip(".") for reason in REASONS}
    normal = ("noise", "beyond_int16", *(() if has_motors else ("unavailable",)))
    seen = {name: count for name, count in counts.items() if count and name not in normal}
    if seen:
        kinds = ", ".join(
            f"{count} x {texts[name][0].lower()}{texts[name][1:]}" for name, count in seen.items()
        )
        yield note("refused_by_board", "refused by board", kinds)


def counters(driver: "Driver") -> Dict[str, int]:
    """Return the board's own counters by reason; empty with 2013 boards."""
    if driver.board.version < 2:
        return {}
    row = BY_NAME["read_counters"]
    return {field.name: value for field, value in zip(row.reply, driver.ask(row.code))}
