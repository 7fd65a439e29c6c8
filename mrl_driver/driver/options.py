"""The options of a driver, and the check of their ranges."""

import math
import threading
from numbers import Integral
from typing import Any, Callable, Dict, NamedTuple, Optional, Tuple

from mrl_driver.arguments import number_of, require_function, require_kind, require_text, shown
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
    as often (a whole number), so that its silence is still noticed in time.  2013 boards stream as fast as they can."""
    watchdog_ms: int = 250
    """The board stops the robot after this time without a frame from the host [ms]; 0 turns the watchdog off.  2013
    boards have no watchdog."""
    check: bool = True
    """Put a checksum on every frame, if the board supports it."""
    command_timeout_s: Optional[float] = COMMAND_TIMEOUT_S
    """Stop the robot if `drive` was not called for this long, 0.01 to 3600 [s].  With None the last command stays in
    force until `stop`, `close` or the end of the program: the robot keeps driving if the program hangs."""
    queued_s: float = 0.0
    """After a pause of this program (`Driver.link`), refuse commands to move for this time, 0 to 10 [s].  A
    program whose commands come through a queue, such as a subscriber's, sets `QUEUED_S`: what waited there is too old.
    """
    ignore_battery: bool = False
    """Start, and keep driving, with an empty battery."""
    robot_id: Optional[int] = None
    """Refuse a board with another robot id, 1 to 32767; None accepts any that suits the model."""
    virtual: Optional[bool] = None
    """Refuse a board whose robot is real (True) or calculated by the board (False); None accepts both, but a real one
    alone if the model is a file's: such a file describes a real robot."""
    any_id: bool = False
    """Accept a board with any robot id for the given model; used to set the id."""
    identify: bool = False
    """Only identify the board, and let requests be sent that turn no motor: there is no telemetry.  Boards without
    motors stream nothing before their id is set."""
    greeting_s: float = TIMEOUT_S
    """Time for the board's first answer [s]."""
    port_timeout_s: float = 0.0
    """Wait this long for a port that cannot be opened yet, 0 to 3600 [s]: it is tried again whatever the error is.  The
    last error ends the wait.  `on_event` gets `Awaited` for each new reason."""
    reconnect: bool = False
    """If the port goes away after connecting, search it instead of failing with LinkLost.  The search accepts the same
    name, or another port with the same USB vendor and product, if the same robot id answers on it.  `on_event` gets
    `Lost` and `Reconnected`.  Between them `drive` returns False; after them the robot waits for a new command.  An
    open `Link` given as port is not searched."""
    record: Optional[str] = None
    """File for a recording of all bytes in both directions with their times, see `recording`.  An existing file is
    overwritten."""
    fast: bool = False
    """Raise the line to 500000 baud if board and line support it, and go back to 115200 if errors appear; `on_event`
    then gets `Slowed`.  Only for device names, opened at 115200."""
    line_baud: int = BAUD
    """Baud rate of the link, if it is slower than the port's baud rate (as with radios).  The stream's period and the
    time between commands are adapted to it."""
    imu_period_ms: int = 20
    """Time between the readings of an IMU on the board [ms], 10 to 40; 0 turns it off, and the heading comes from the
    wheels alone.  It needs checksums, because only frames with them have board time, and a line that is fast enough."""
    build: str = ""
    """Build of the board's firmware, `sonar` or `environment`; empty for that of the robot model.  2013 boards do not
    report it; other boards are only compared with it."""
    tap: Optional[Callable[[str, bytes], None]] = None
    """Called with the direction and each chunk of bytes: `>` to the board, before sending; `<` from the board, on
    arrival.  It must be quick and must not raise.  An open `Link` given as port is not tapped."""


DEFAULTS = Options()

HEARD = (
    *("period_ms", "watchdog_ms", "check", "robot_id", "any_id", "ignore_battery", "identify", "line_baud"),
    *("imu_period_ms", "build", "virtual"),
)
"""The options that change what the listeners of a driver get."""

RANGES: Dict[str, Tuple[float, float, str]] = {
    "period_ms": (0, 10000, "ms"),
    "watchdog_ms": (0, 10000, "ms"),
    "robot_id": (1, INT16_MAX, "(or None)"),
    "imu_period_ms": (LEAST_IMU_MS, SLOWEST_IMU_MS, "ms (or 0)"),
    "greeting_s": (0.1, 3600, "s"),
    "port_timeout_s": (0, 3600, "s"),
    "line_baud": (SLOWEST_BAUD, FASTEST_BAUD, "Bd"),
    "queued_s": (0, 10, "s"),
    "command_timeout_s": (0.01, 3600, "s"),
}
"""Lowest and highest value of each option that is a number, and its unit."""
OFF: Dict[str, Optional[int]] = {"robot_id": None, "imu_period_ms": 0, "command_timeout_s": None}
"""Values outside the range of these options."""


def require_range(name: str, value: Any, low: float, high: float, unit: str, whole: bool = True) -> Any:
    """Return a number as int, or as float if it need not be `whole`; raise ConfigError unless it is in its range."""
    number = number_of(value)
    if not low <= number <= high or (whole and not isinstance(value, Integral)):
        kind = ", a whole number" if whole else ""
        raise ConfigError(f"{name} is {shown(value)}, expected {low} to {high} {unit}{kind}")
    return int(value) if whole else number


def require_timeout(name: str, value: Any) -> Optional[float]:
    """Return a time to wait that the system can wait [s]; None waits without an end.

    Raises:
        ConfigError: not a number, or NaN, with which a wait would never end.
    """
    if value is None:
        return None
    number = number_of(value)
    if math.isnan(number):
        raise ConfigError(
            f"{name} is {shown(value)}, expected a number of seconds, or None to wait without an end"
        )
    return min(number, threading.TIMEOUT_MAX)


def require_options(options: Options) -> Options:
    """Return the options, with numbers of Python's own types; raise ConfigError if one has another type or range."""
    require_kind("options", options, Options, "Options")
    for name in ("check", "ignore_battery", "any_id", "identify", "reconnect", "fast"):
        require_kind(name, getattr(options, name), bool, "True or False")
    if options.virtual is not None:
        require_kind("virtual", options.virtual, bool, "True, False or None")
    if options.record is not None:
        require_text("record", options.record, "the name of a file")
    if not isinstance(options.build, str) or options.build not in ("", *BUILDS):
        raise ConfigError(f"build is {shown(options.build)}, expected {' or '.join(BUILDS)}")
    if options.tap is not None:
        require_function("tap", options.tap)
    numbers = {}
    for name, (low, high, unit) in RANGES.items():
        value, off = getattr(options, name), OFF.get(name, RANGES)
        if value is not off and number_of(value) != off:
            numbers[name] = require_range(name, value, low, high, unit, whole=not name.endswith("_s"))
    return options._replace(**numbers)


def require_limits(limits: Limits) -> Limits:
    """Return the limits with numbers as float.  Limits with a default may be zero; an acceleration may be infinite.

    Raises:
        ConfigError: a speed is not positive or does not fit into a frame, or an acceleration is not positive.
    """
    require_kind("limits", limits, Limits, "Limits")
    numbers = {name: number_of(value) for name, value in limits._asdict().items()}
    for name, number in numbers.items():
        most = math.inf if name.endswith("_s2") else INT16_MAX / 1000
        if not (0 < number <= most or (number == 0 and name in Limits._field_defaults)):
            value = shown(getattr(limits, name))
            raise ConfigError(f"limit {name} is {value}, expected more than 0, at most {most:g}")
    return limits._replace(**numbers)
