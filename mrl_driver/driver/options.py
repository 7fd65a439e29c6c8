"""The options of a driver, and the check of their ranges."""

import math
import threading
from numbers import Integral, Real
from typing import Any, Callable, Dict, NamedTuple, Optional, Type

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import BAUD, BY_NAME, INT16_MAX
from mrl_driver.robot.models import BUILDS, Limits
from mrl_driver.session.handshake import TIMEOUT_S
from mrl_driver.transport.baud_rates import SLOWEST_BAUD, SLOWEST_IMU_MS

FASTEST_BAUD = 4_000_000
LEAST_IMU_MS = BY_NAME["start_imu_stream"].request[0].low
COMMAND_TIMEOUT_S = 0.5
"""Default of `Options.command_timeout_s`: the robot drives at most this long after the last `drive` [s]."""

QUEUED_S = 0.1
"""`Options.queued_s` of programs that get their commands through a queue [s]."""


class Options(NamedTuple):
    """How a `Driver` behaves; the defaults suit the packaged robots."""

    period_ms: int = 20
    """Time between the telemetry frames that listeners get [ms], 0 to 10000.  Above 50 the board streams several times
    as often (a whole number), so that its silence is still noticed in time.  2013 boards stream as fast as they can.
    """
    watchdog_ms: int = 250
    """The board stops the robot after this time without a frame from the host [ms]; 0 turns the watchdog off.  2013
    boards have no watchdog.
    """
    check: bool = True
    """Put a checksum on every frame, if the board supports it."""
    command_timeout_s: Optional[float] = COMMAND_TIMEOUT_S
    """Stop the robot if `drive` was not called for this long, 0.01 to 3600 [s].  With None the last command stays in
    force until `stop`, `close` or the end of the program: the robot keeps driving if the program hangs.
    """
    queued_s: float = 0.0
    """After a pause of this program (`Driver.since_pause_s`), refuse commands to move for this time, 0 to 10 [s].  A
    program whose commands come through a queue, such as a subscriber's, sets `QUEUED_S`: what waited there is too old.
    """
    ignore_battery: bool = False
    """Start, and keep driving, with an empty battery."""
    robot_id: Optional[int] = None
    """Refuse a board with another robot id, 1 to 32767; None accepts any that suits the model."""
    any_id: bool = False
    """Accept a board with any robot id for the given model; used to set the id."""
    identify: bool = False
    """Only identify the board, and let requests be sent that turn no motor: there is no telemetry.  Boards without
    motors stream nothing before their id is set.
    """
    greeting_s: float = TIMEOUT_S
    """Time for the board's first answer [s]."""
    port_timeout_s: float = 0.0
    """Wait this long for a port that cannot be opened yet, 0 to 3600 [s]: it is tried again whatever the error is.  The
    last error ends the wait.  `on_event` gets `Awaited` for each new reason.
    """
    reconnect: bool = False
    """If the port goes away after connecting, search it instead of failing with LinkLost.  The search accepts the same
    name, or another port with the same USB vendor and product, if the same robot id answers on it.  `on_event` gets
    `Lost` and `Reconnected`.  Between them `drive` returns False; after them the robot waits for a new command.  An
    open `Link` given as port is not searched.
    """
    record: Optional[str] = None
    """File for a recording of all bytes in both directions with their times, see `recording`.  An existing file is
    overwritten.
    """
    fast: bool = False
    """Raise the line to 500000 baud if board and line support it, and go back to 115200 if errors appear; `on_event`
    then gets `Slowed`.  Only for device names, opened at 115200.
    """
    line_baud: int = BAUD
    """Baud rate of the link, if it is slower than the port's baud rate (as with radios).  The stream's period and the
    time between commands are adapted to it.
    """
    imu_period_ms: int = 20
    """Time between the readings of an IMU on the board [ms], 10 to 40; 0 turns it off, and the heading comes from the
    wheels alone.  It needs checksums, because only frames with them have board time, and a line that is fast enough.
    """
    build: str = ""
    """Build of the board's firmware, `sonar` or `environment`; empty for that of the robot model.  2013 boards do not
    report it; other boards are only compared with it.
    """
    tap: Optional[Callable[[str, bytes], None]] = None
    """Called with the direction and each chunk of bytes: `>` to the board, before sending; `<` from the board, on
    arrival.  It must be quick and must not raise.  An open `Link` given as port is not tapped.
    """


DEFAULTS = Options()


HEARD = (
    *("period_ms", "watchdog_ms", "check", "robot_id", "any_id", "ignore_battery", "identify", "line_baud"),
    *("imu_period_ms", "build"),
)
"""The options that change what the listeners of a driver get."""


def heard_options(options: Options) -> Dict[str, Any]:
    """Return the options that change what the listeners of a driver get, by name."""
    return {name: getattr(options, name) for name in HEARD}


def require_range(
    name: str, value: Any, low: float, high: float, unit: str, kind: Type[Any] = Integral
) -> None:
    """Raise ConfigError unless `value` is a number of this kind (`Integral` or `Real`) from `low` to `high`."""
    if isinstance(value, bool) or not isinstance(value, kind) or not low <= value <= high:
        whole = ", a whole number" if kind is Integral else ""
        raise ConfigError(f"{name} is {value!r}, expected {low} to {high} {unit}{whole}")


def require_timeout(name: str, value: Any) -> Optional[float]:
    """Return a time to wait that the system can wait [s]; None waits without an end.

    Raises:
        ConfigError: not a number, or NaN, with which a wait would never end.
    """
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, Real) or value != value:
        raise ConfigError(
            f"{name} is {value!r}, expected a number of seconds, or None to wait without an end"
        )
    return min(float(value), threading.TIMEOUT_MAX)


def require_baud(name: str, value: Any) -> None:
    """Raise ConfigError unless `value` is a baud rate at which a board can stream."""
    require_range(name, value, SLOWEST_BAUD, FASTEST_BAUD, "Bd")


def require_options(options: Options) -> None:
    """Raise ConfigError unless each option is in its range; the bounds in ms come from the command table."""
    require_range("period_ms", options.period_ms, 0, 10000, "ms")
    require_range("watchdog_ms", options.watchdog_ms, 0, 10000, "ms")
    if options.robot_id is not None:
        require_range("robot_id", options.robot_id, 1, INT16_MAX, "(or None)")
    if options.imu_period_ms != 0:
        require_range("imu_period_ms", options.imu_period_ms, LEAST_IMU_MS, SLOWEST_IMU_MS, "ms (or 0)")
    require_range("greeting_s", options.greeting_s, 0.1, 3600, "s", Real)
    require_range("port_timeout_s", options.port_timeout_s, 0, 3600, "s", Real)
    require_baud("line_baud", options.line_baud)
    for name in ("check", "ignore_battery", "any_id", "identify", "reconnect", "fast"):
        value = getattr(options, name)
        if not isinstance(value, bool):
            raise ConfigError(f"{name} is {value!r}, expected True or False")
    if options.record is not None and (not isinstance(options.record, str) or not options.record):
        raise ConfigError(f"record is {options.record!r}, expected the name of a file")
    if options.build not in ("", *BUILDS):
        raise ConfigError(f"build is {options.build!r}, expected {' or '.join(BUILDS)}")
    if options.tap is not None and not callable(options.tap):
        raise ConfigError(f"tap is {options.tap!r}, expected a function of direction and bytes")
    require_range("queued_s", options.queued_s, 0, 10, "s", Real)
    if options.command_timeout_s is not None:
        require_range("command_timeout_s", options.command_timeout_s, 0.01, 3600, "s", Real)


def require_limits(limits: Limits) -> None:
    """Raise ConfigError unless each speed is positive and fits into a frame, and each acceleration is positive.

    The lateral speed may be zero; an acceleration may be infinite.
    """
    for name, value in limits._asdict().items():
        most = math.inf if "acceleration" in name else INT16_MAX / 1000
        if not (0 < value <= most or (value == 0 and name == "lateral_m_s")):
            raise ConfigError(f"limit {name} is {value!r}, expected more than 0, at most {most:g}")
