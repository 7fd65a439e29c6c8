"""How a driver behaves: its options, and what they may be."""

from typing import Any, Callable, NamedTuple, Optional

from mrl_driver.errors import ConfigError
from mrl_driver.session.handshake import TIMEOUT_S

COMMAND_TIMEOUT_S = 0.5
"""A robot drives at most this long after the last `drive`, unless its program chose otherwise [s]."""


class Options(NamedTuple):
    """How a `Driver` behaves; the defaults suit the packaged robots."""

    period_ms: int = 20
    """Time between frames that listeners are told of, 0 to 10000.  Above 50 the board streams a whole number of times
    as often, so that its silence is noticed as soon.  2013 boards stream as fast as they can.
    """
    watchdog_ms: int = 250
    """The board stops the robot when it has heard nothing for so long; 0 turns that off.  2013 boards have
    none.
    """
    check: bool = True
    """Have every frame carry a check value, where the board can."""
    command_timeout_s: Optional[float] = COMMAND_TIMEOUT_S
    """Stop the robot when `drive` was not called for this long, 0.01 to 3600.  None keeps the last command in force
    until `stop`, `close` or the end of the program: the robot then drives on if the program hangs.
    """
    ignore_battery: bool = False
    """Start, and drive on, with an empty battery."""
    any_id: bool = False
    """Take a board whatever its robot id, for the model given; meant for setting the id."""
    greeting_s: float = TIMEOUT_S
    """How long a board may take to answer at first."""
    reconnect: bool = False
    """Search a port that went away, once connected, instead of failing with LinkLost: the same name, or another
    port of the same USB vendor and product, that the same robot id answers on.  `on_event` tells of `Lost` and
    `Reconnected`; between them `drive` returns False, and after them the robot waits for a new command.  An open
    `Link` given as port is not searched.
    """
    record: Optional[str] = None
    """File that gets every byte both ways with its time, see `recording`; one that is there is overwritten."""
    fast: bool = False
    """Raise the line to 500000 baud where board and line can, and go back to 115200 when errors show, which `on_event`
    tells as `Slowed`.  Only for device names, opened at 115200.
    """
    line_baud: int = 115200
    """What the line carries [Bd], where that is less than the port's baud rate, as with radios: the stream's period and
    the commands' pace are as slow as it demands.
    """
    tap: Optional[Callable[[str, bytes], None]] = None
    """Called with each chunk of bytes, and which way it goes: `>` to the board before it is sent, `<` from it as it
    comes.  It must be quick, and not raise; an open `Link` given as port is not listened to.
    """


DEFAULTS = Options()


def demand(name: str, value: Any, low: float, high: float, unit: str, *kinds: type) -> None:
    """Raise ConfigError unless `value` is of one of `kinds` and in its range."""
    if type(value) not in kinds or not low <= value <= high:
        raise ConfigError(f"{name} is {value!r}, expected {low:g} to {high:g} {unit}")


def demand_options(options: Options) -> None:
    """Raise ConfigError unless each option is in its range; bounds in ms are those of the command table."""
    demand("period_ms", options.period_ms, 0, 10000, "ms", int)
    demand("watchdog_ms", options.watchdog_ms, 0, 10000, "ms", int)
    demand("greeting_s", options.greeting_s, 0.1, 3600, "s", int, float)
    demand("line_baud", options.line_baud, 300, 4_000_000, "Bd", int)
    if type(options.reconnect) is not bool:
        raise ConfigError(f"reconnect is {options.reconnect!r}, expected True or False")
    if options.record is not None and (not isinstance(options.record, str) or not options.record):
        raise ConfigError(f"record is {options.record!r}, expected the name of a file")
    if options.command_timeout_s is not None:
        demand("command_timeout_s", options.command_timeout_s, 0.01, 3600, "s", int, float)
