"""All errors that the project raises on purpose.

    MrlError                    exit code 1
    +-- ConfigError             2   a parameter, option or YAML value is missing, misspelt or out of range
    +-- LinkError               3   the serial port
    |   +-- PortMissing         3   no such port, or it is not a serial port
    |   +-- PortDenied          4   no permission
    |   +-- PortBusy            5   another program uses it
    |   +-- LinkLost            6   the port was open and went away
    +-- BoardError              7   the board
    |   +-- NotARobot           7   nothing, or something else, answers (also a TimeoutError)
    |   +-- WrongRobot          8   a robot answers, but not the configured one
    |   +-- BatteryDead         9   the motors have no power, or too little to start
    |   +-- BoardTimeout       10   a known board did not answer in time (also a TimeoutError)
    |   |   +-- HostBusy       10   because this computer was too busy
    |   +-- BoardRefused       11   the board refused a request
    |   +-- WheelFault         14   a wheel does not follow its command
    +-- FrameError             12   the command table does not allow this frame (also a ValueError)
    +-- SimulatorError         13   the emulator cannot be built or started
    +-- OutputError            15   output cannot be printed or written to a file
    +-- GoalMissed             16   the robot gave up its goal

Each message is one line: what was got, what was expected, what to do.  The command line prints it with its code, such
as `[port_busy]`, and exits with `exit_code`; libraries only raise.  `mrl explain CODE` says more (`problems`).
"""

import contextlib
import errno
from typing import Dict, Iterator, Type

_SHORTAGES: Dict[int, str] = {
    errno.EMFILE: "this program has too many files open; close some, or allow more with: ulimit -n 4096",
    errno.ENFILE: "this computer has too many files open; end other programs",
    errno.ENOMEM: "no memory is left; end other programs",
    errno.ENOBUFS: "no memory is left for network connections; end other programs",
}
_NO_THREAD = "can't start new thread"
"""Words of Python's RuntimeError."""
_LONGEST = 1000
"""Longest message [characters]."""


def one_line(text: str) -> str:
    """Return a message that may quote files of others.

    What is not printable is escaped, such as line ends and orders to a terminal.  Of a message that is too long, the
    middle is left out.
    """
    if not text.isprintable():
        text = "".join(each if each.isprintable() else repr(each)[1:-1] for each in text)
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 405]} ... {text[-400:]}"


def shortage(error: BaseException) -> str:
    """Return what the computer has run out of, and what to do; empty if the error has another reason."""
    if isinstance(error, MemoryError):
        return _SHORTAGES[errno.ENOMEM]
    if isinstance(error, RuntimeError) and str(error) == _NO_THREAD:
        return "no thread can be started; end other programs, or allow more with: ulimit -u 4096"
    return _SHORTAGES.get(error.errno or 0, "") if isinstance(error, OSError) else ""


@contextlib.contextmanager
def shortages(what: str, kind: Type["MrlError"]) -> Iterator[None]:
    """In this block, raise `kind` if descriptors, threads or memory run out; its text begins with `what`."""
    try:
        yield
    except (OSError, RuntimeError, MemoryError) as error:
        reason = shortage(error)
        if not reason:
            raise
        raise kind(f"{what}: {reason}") from None


class MrlError(Exception):
    """Base of all errors; `exit_code` is the exit code of the command line.  Its text is always one line."""

    exit_code = 1
    code = ""
    """Code of the row in `problems`; empty if the message says all there is to say."""

    @property
    def line(self) -> str:
        """The message with its code, as programs print it."""
        return f"{self}  [{self.code}]" if self.code else str(self)

    def __str__(self) -> str:
        return one_line(super().__str__())


class ConfigError(MrlError, ValueError):
    """A parameter, option or YAML value is missing, misspelt or out of range."""

    exit_code = 2


class LinkError(MrlError):
    """The serial port cannot be used."""

    exit_code = 3
    code = "link_error"


class PortMissing(LinkError):
    """The port does not exist, or is not a serial port."""

    code = "port_missing"


class PortDenied(LinkError):
    """The user may not open the port."""

    exit_code = 4
    code = "port_denied"


class PortBusy(LinkError):
    """Another program has the port open."""

    exit_code = 5
    code = "port_busy"


class LinkLost(LinkError):
    """The port was open and went away."""

    exit_code = 6
    code = "link_lost"


class BoardError(MrlError):
    """The expected board does not answer, or cannot be used."""

    exit_code = 7
    code = "board_error"


class NotARobot(BoardError, TimeoutError):
    """Nothing on the port speaks the frame protocol."""

    code = "not_a_robot"


class WrongRobot(BoardError):
    """A robot answers, but not the configured one."""

    exit_code = 8
    code = "wrong_robot"


class BatteryDead(BoardError):
    """The motors have no power, or the battery is too low to start."""

    exit_code = 9
    code = "battery_dead"


class BoardTimeout(BoardError, TimeoutError):
    """A known board did not answer in time."""

    exit_code = 10
    code = "board_timeout"


class HostBusy(BoardTimeout):
    """The robot was not driven or answered in time because this computer was too busy."""

    code = "late_host"


class BoardRefused(BoardError):
    """The board refused a request."""

    exit_code = 11
    code = "board_refused"


class WheelFault(BoardError):
    """A wheel does not follow its command, because of its encoder, wiring, power, or an obstacle."""

    exit_code = 14
    code = "wheel_fault"


class FrameError(MrlError, ValueError):
    """The command table does not allow the frame that this program wanted to send."""

    exit_code = 12


class SimulatorError(MrlError):
    """The emulator cannot be built or started."""

    exit_code = 13
    code = "simulator_error"


class OutputError(MrlError):
    """Output cannot be printed or written to a file."""

    exit_code = 15
    code = "output_error"


class GoalMissed(MrlError):
    """The robot gave up its goal: it was blocked, or the time was over."""

    exit_code = 16
    code = "goal_missed"
