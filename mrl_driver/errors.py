"""All errors that the project raises on purpose.

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
_NO_THREAD = "can't start new thread"  # words of Python's RuntimeError
_LONGEST = 1000  # longest message [characters]


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
    code = ""  # code of the row in `problems`; empty if the message says all there is to say

    def __init_subclass__(cls, exit_code: int = 0, code: str = "") -> None:
        """Take the codes of a class; one that is not given is that of its base."""
        super().__init_subclass__()
        cls.exit_code, cls.code = exit_code or cls.exit_code, code or cls.code

    @property
    def line(self) -> str:
        """The message with its code, as programs print it."""
        return f"{self}  [{self.code}]" if self.code else str(self)

    def __str__(self) -> str:
        return one_line(super().__str__())


class ConfigError(MrlError, ValueError, exit_code=2):
    """A parameter, option or YAML value is missing, misspelt or out of range."""


class LinkError(MrlError, exit_code=3, code="link_error"):
    """The serial port cannot be used."""


class PortMissing(LinkError, code="port_missing"):
    """The port does not exist, or is not a serial port."""


class PortDenied(LinkError, exit_code=4, code="port_denied"):
    """The user may not open the port."""


class PortBusy(LinkError, exit_code=5, code="port_busy"):
    """Another program has the port open."""


class LinkLost(LinkError, exit_code=6, code="link_lost"):
    """The port was open and went away."""


class BoardError(MrlError, exit_code=7, code="board_error"):
    """The expected board does not answer, or cannot be used."""


class NotARobot(BoardError, TimeoutError, code="not_a_robot"):
    """Nothing on the port speaks the frame protocol."""


class WrongRobot(BoardError, exit_code=8, code="wrong_robot"):
    """A robot answers, but not the configured one."""


class BatteryDead(BoardError, exit_code=9, code="battery_dead"):
    """The motors have no power, or the battery is too low to start."""


class BoardTimeout(BoardError, TimeoutError, exit_code=10, code="board_timeout"):
    """A known board did not answer in time."""


class HostBusy(BoardTimeout, code="late_host"):
    """The robot was not driven or answered in time because this computer was too busy."""


class BoardRefused(BoardError, exit_code=11, code="board_refused"):
    """The board refused a request."""


class WheelFault(BoardError, exit_code=14, code="wheel_fault"):
    """A wheel does not follow its command, because of its encoder, wiring, power, or an obstacle."""


class FrameError(MrlError, ValueError, exit_code=12):
    """The command table does not allow the frame that this program wanted to send."""


class SimulatorError(MrlError, exit_code=13, code="simulator_error"):
    """The emulator cannot be built or started."""


class OutputError(MrlError, exit_code=15, code="output_error"):
    """Output cannot be printed or written to a file."""


class GoalMissed(MrlError, exit_code=16, code="goal_missed"):
    """The robot gave up its goal: it was blocked, or the time was over."""
