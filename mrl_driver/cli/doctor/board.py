"""Checks of a connected board: identity, power supply, faults, link.  The robot stands still."""

import math
import time
from typing import TYPE_CHECKING, Dict, Iterator, List, Mapping, NamedTuple, Optional, Sequence

from mrl_driver.protocol.table import BY_NAME, FAULTS, REASONS, SENSOR_BY_NAME
from mrl_driver.robot import imu
from mrl_driver.robot.hold import Hold
from mrl_driver.robot.models import RobotModel
from mrl_driver.session.handshake import Board
from mrl_driver.session.sensor_polling import Reading, text
from mrl_driver.session.session import Status
from mrl_driver.view.words import stop_of

from .findings import FAULT, NOTE, OK, WARNING, Finding

if TYPE_CHECKING:
    from mrl_driver.driver import Driver

MEASURE_S = 1.0
ROUND_TRIPS = 40
SLOW_ROUND_TRIP_S = 0.05
"""A round trip above this is slow [s]: the serial link takes 3 ms, a USB adapter up to 16 ms more."""
MIN_SHARE = 0.9
"""Smallest acceptable share of the expected stream frames."""
_NETWORK = "bring robot and access point closer together, or use a channel with less traffic"
_PINS = {"front": "A0", "left": "A1", "right": "A2"}
_ADVICE = {
    "motor_board": "check the OMNI-3MD's power, and its I2C wires on A4 (SDA) and A5 (SCL)",
    "bus_hung": "a device holds the I2C bus: check the wires on A4 (SDA) and A5 (SCL), then switch power off and on",
    "eeprom": "set the parameters that must differ from the model's defaults again: mrl config set NAME VALUE",
    "id_unset": "mrl set-id ID (TraxBot 1-3, StingBot 4-5, Pioneer 6-10)",
    "sensor": "check the I2C wires and power of the thermopile (0x68) and the compass (0x60)",
    "imu": "check the IMU's wires on A4 (SDA) and A5 (SCL), and its power",
    "wiring": "set the bridge with: mrl config set bridge CHIP (such as l298n), then run: mrl calibrate wiring",
}
_FAULTY_STOPS = ("wheel_blocked", "encoder", "undervoltage")
_RESETS = {
    "watchdog": "the firmware hung and its watchdog restarted it; please report it with: mrl doctor --report",
    "brown_out": "the supply voltage dropped: check USB cable and hub, and every other load on the board's 5 V",
}


class LinkFigures(NamedTuple):
    """Measurements of the link."""

    rate_hz: float
    """Stream frames per second."""
    expected_hz: Optional[float]
    """None if the board streams as fast as it can."""
    lost: int
    garbage: Dict[str, int]
    round_trips_s: List[float]
    """Times from request to answer, ascending."""


def identity(board: Board, model: Optional[RobotModel]) -> Iterator[Finding]:
    """Check the board's identity and the capabilities of its firmware."""
    if board.robot_id == 0:
        yield Finding(FAULT, "robot id", "not set", _ADVICE["id_unset"])
    elif model is None or board.robot_id not in model.ids:
        yield Finding(
            WARNING,
            "robot id",
            f"no packaged model lists {board.robot_id}",
            "give the robot's file: --robot FILE.yaml",
        )
    else:
        yield Finding(OK, "robot", f"{model.name} {board.robot_id}")
    if board.version < 2:
        yield Finding(
            WARNING,
            "firmware",
            "1 (2013): works, but has no watchdog and no checksum",
            "mrl flash --port PORT",
        )
        return
    yield Finding(OK, "firmware", f"version {board.version}, protocol {board.protocol}")
    yield Finding(OK, "capabilities", ", ".join(sorted(board.capabilities)))
    if "watchdog" not in board.capabilities:
        yield Finding(
            FAULT,
            "watchdog",
            "the board has none: it does not stop if this computer fails",
            "mrl flash --port PORT",
        )


def supply(board: Board, model: Optional[RobotModel]) -> Iterator[Finding]:
    """Check battery and motor board, as far as the board measures them."""
    if model is not None and not model.drives:
        yield Finding(OK, "motors", "none: the board has sensors, and something else drives its robot")
        return
    if "no_battery" in board.capabilities:
        yield Finding(
            NOTE,
            "battery",
            "not measured",
            "connect its divider to A3, and set the parameter battery_divider",
        )
    else:
        yield from _battery(board, model)
    if "bridge" not in board.capabilities:
        yield _motor_board(board)


def _battery(board: Board, model: Optional[RobotModel]) -> Iterator[Finding]:
    text = f"{board.battery_v:.1f} V"
    if model is not None:
        levels = model.battery
        if board.battery_v < levels.off_v:
            yield Finding(
                FAULT, "battery", f"{text}: motor power is off", "switch it on, or connect the battery"
            )
        elif board.battery_v < levels.empty_v:
            yield Finding(
                FAULT, "battery", f"{text}: empty", f"charge it; it must have {levels.empty_v:g} V to start"
            )
        elif board.battery_v < levels.low_v:
            yield Finding(WARNING, "battery", f"{text}: low", "charge it soon")
        else:
            yield Finding(OK, "battery", f"{text} (full {levels.full_v:g} V, low below {levels.low_v:g} V)")


def _motor_board(board: Board) -> Finding:
    hot = board.temperature_c > 60
    return Finding(
        WARNING if hot else OK,
        "motor board",
        f"firmware {board.motor_board_version:.2f}, {board.temperature_c:.0f} degC",
        "let it cool down, and check that the wheels turn freely" if hot else "",
    )


def health(status: Optional[Status]) -> Iterator[Finding]:
    """Check the faults that the board reports, its last stop, and the cause of its last start."""
    if status is None:
        return
    words = dict(FAULTS)
    for fault in status.faults:
        yield Finding(FAULT, "board's fault", words[fault].rstrip("."), _ADVICE[fault])
    cause = status.reset_cause
    yield Finding(
        WARNING if cause in _RESETS else OK,
        "last start",
        f"{cause.replace('_', ' ')}, {status.uptime_s} s ago",
        _RESETS.get(cause, ""),
    )
    if status.stop_reason in _FAULTY_STOPS:
        why, remedy = stop_of(status.stop_reason)
        yield Finding(WARNING, "last stop", status.stop_reason.replace("_", " "), f"{why}: {remedy}")
    if status.impossible:
        yield Finding(
            NOTE,
            "encoders",
            f"{status.impossible} transitions skipped a state",
            "check the encoders' wires and ground, and keep them away from the motors' wires",
        )
    if status.clamped:
        yield Finding(
            NOTE,
            "speed ceiling",
            f"clamped {status.clamped} commands",
            "command lower speeds, or raise linear_ceiling with: mrl config set",
        )


def hold(found: Optional[Hold]) -> Iterator[Finding]:
    """Check whether other robots hold this one by radio."""
    if found is not None and found.held:
        advice = "look whether the place is free, then release it: ROS service release_hold, or Driver.release_hold()"
        yield Finding(WARNING, "radio", str(found), advice if found.state == "silent" else "")


def watch(driver: "Driver", seconds: float = MEASURE_S, trips: int = ROUND_TRIPS) -> LinkFigures:
    """Measure the stream, then the round trips of requests.

    Raises:
        BoardTimeout: the board stopped answering.
        LinkLost: the port went away.
    """
    before = driver.statistics
    driver.wait(seconds)
    count = driver.statistics.streamed - before.streamed
    times = sorted(_round_trip_s(driver) for _ in range(trips))
    seen = driver.statistics
    garbage = {
        reason: number - before.garbage.get(reason, 0)
        for reason, number in seen.garbage.items()
        if number > before.garbage.get(reason, 0)
    }
    expected = 50.0 if "period" in driver.board.capabilities else None
    return LinkFigures(count / seconds, expected, seen.lost - before.lost, garbage, times)


def _round_trip_s(driver: "Driver") -> float:
    start_s = time.perf_counter()
    driver.ask(BY_NAME["get_stream"].code)  # not get_debug: 2013 boards answer it with text as well
    return time.perf_counter() - start_s


def link(seen: LinkFigures, by_network: bool = False) -> Iterator[Finding]:
    """Check the quality of the link, by cable or network."""
    slow = seen.expected_hz is not None and seen.rate_hz < MIN_SHARE * seen.expected_hz
    expected = f" of {seen.expected_hz:.0f}" if seen.expected_hz is not None else ""
    yield Finding(
        WARNING if slow else OK,
        "telemetry",
        f"{seen.rate_hz:.0f}{expected} frames/s",
        ""
        if not slow
        else _NETWORK
        if by_network
        else "close busy programs, and connect the board without a USB hub",
    )
    damage = sum(seen.garbage.values())
    if seen.lost or damage:
        kinds = ", ".join(f"{count} {reason}" for reason, count in sorted(seen.garbage.items()))
        yield Finding(
            WARNING,
            "damage",
            f"{seen.lost} frames lost, {damage} pieces of data damaged" + (f" ({kinds})" if kinds else ""),
            _NETWORK if by_network else "use a shorter or better USB cable, away from the motor wires",
        )
    else:
        yield Finding(OK, "damage", "no frame lost or damaged")
    if not seen.round_trips_s:
        return
    middle, worst = seen.round_trips_s[len(seen.round_trips_s) // 2], seen.round_trips_s[-1]
    yield Finding(
        WARNING if middle > SLOW_ROUND_TRIP_S else OK,
        "latency",
        f"{middle * 1000:.1f} ms from request to answer, at worst {worst * 1000:.1f} ms",
        ""
        if middle <= SLOW_ROUND_TRIP_S
        else _NETWORK
        if by_network
        else "connect the board without a hub, and close busy programs",
    )


def sonars(ranges: Dict[str, float], board: Board) -> Iterator[Finding]:
    """Check the present reading of each sonar."""
    if (board.version >= 2 or board.capabilities) and "sonars" not in board.capabilities:
        yield Finding(NOTE, "sonars", "none: this firmware is the build for environment sensors")
        return
    for name, value in ranges.items():
        if math.isnan(value):
            pin = _PINS.get(name, "its pin")
            advice = f"check the sonar's power (D13), the trigger chain (D12) and its output on {pin}"
            yield Finding(FAULT, f"sonar {name}", "no reading", advice)
        else:
            words = (
                f"{value:.2f} m" if math.isfinite(value) else "nothing in range" if value > 0 else "too close"
            )
            yield Finding(OK, f"sonar {name}", words)


def build(driver: "Driver") -> Iterator[Finding]:
    """Check the build that the robot model names; 2013 boards do not report theirs."""
    text, _, advice = driver.build_warning.partition("; ")
    if text:
        yield Finding(WARNING, "build", text, advice)
    elif driver.build_assumed:
        yield Finding(
            NOTE,
            "build",
            "taken as sonar: a board of 2013 does not report it",
            "if it has environment sensors, write build: environment into the robot's YAML",
        )


def sensors(readings: Mapping[str, Reading], missing: Sequence[str] = ()) -> Iterator[Finding]:
    """Show the present reading of each other sensor that answers, and those that the board has without a reading."""
    for name, found in readings.items():
        yield Finding(OK, name, text(SENSOR_BY_NAME[name], found))
    for name in missing:
        yield Finding(WARNING, name, "no reading", "check its wires, see HARDWARE.md")


def gyro(driver: "Driver") -> Iterator[Finding]:
    """Check the IMU; no finding if the board has none."""
    state, found = driver.imu_state, driver.imu
    if state == imu.ABSENT and found is None:
        return
    if state == imu.OFF:
        yield Finding(NOTE, "imu", "not read, because that needs checksums and a fast serial link")
    elif state == imu.LEARNING:
        yield Finding(
            WARNING, "imu", "the bias of its gyro is not known", "let the robot stand still for a second"
        )
    elif state == imu.IN_USE and found is not None:
        bias = f"{math.degrees(found.bias_rad_s):+.2f} deg/s"
        yield Finding(OK, "imu", f"gives the heading together with the wheels; bias of the gyro: {bias}")
    else:
        text, _, advice = imu.REASONS.get(state, imu.REASONS[imu.SILENT]).partition(": ")
        yield Finding(FAULT, "imu", f"not used: {text}", advice)


def refusals(counts: Dict[str, int], has_motors: bool = True) -> Iterator[Finding]:
    """Check what the board has refused since its start.

    `noise` alone is normal when a port is opened, and `unavailable` on a board without motors, which gets stops too.
    """
    texts = {reason.name: reason.text.rstrip(".") for reason in REASONS}
    normal = ("noise",) if has_motors else ("noise", "unavailable")
    seen = {name: count for name, count in counts.items() if count and name not in normal}
    if seen:
        kinds = ", ".join(
            f"{count} x {texts[name][0].lower()}{texts[name][1:]}" for name, count in seen.items()
        )
        yield Finding(
            NOTE, "refused by board", kinds, "normal after an interrupted program; otherwise check the cable"
        )


def counters(driver: "Driver") -> Dict[str, int]:
    """Return the board's own counters by reason; empty with 2013 boards."""
    if driver.board.version < 2:
        return {}
    row = BY_NAME["read_counters"]
    return {field.name: value for field, value in zip(row.reply, driver.ask(row.code))}
