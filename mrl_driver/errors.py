"""Every error the project raises on purpose.

    MrlError                    exit code 1
    +-- ConfigError             2   a parameter, option or YAML value is missing, misspelt or out of range
    +-- LinkError               3   the serial port
    |   +-- PortMissing         3   no such port, or it is not a serial port
    |   +-- PortDenied          4   no permission
    |   +-- PortBusy            5   another program has it
    |   +-- LinkLost            6   it was there and went away
    +-- BoardError              7   what answers, or does not, on the port
    |   +-- NotARobot           7   nothing, or something else, answers (also a TimeoutError)
    |   +-- WrongRobot          8   a robot answers, but not the configured one
    |   +-- BatteryDead         9   the motors have no power, or too little to start
    |   +-- BoardTimeout       10   a known board did not answer in time (also a TimeoutError)
    |   +-- BoardRefused       11   the board said no
    |   +-- WheelFault         14   a wheel does not do what it was told
    +-- FrameError             12   this program asked for a frame that the table forbids (also a ValueError)
    +-- SimulatorError         13   the emulator cannot be built or started
    +-- OutputError            15   what was to be printed or kept in a file cannot be written

Each message is one line: what was got, what was expected, what to do.  The command line prints it and
exits with `exit_code`; libraries only raise.
"""


class MrlError(Exception):
    """Base of all errors; `exit_code` is what the command line exits with."""

    exit_code = 1


class ConfigError(MrlError, ValueError):
    """A parameter, option or YAML value is missing, misspelt or out of range."""

    exit_code = 2


class LinkError(MrlError):
    """The serial port cannot be used."""

    exit_code = 3


class PortMissing(LinkError):
    """The port does not exist, or is no serial port."""


class PortDenied(LinkError):
    """The user may not open the port."""

    exit_code = 4


class PortBusy(LinkError):
    """Another program has the port open."""

    exit_code = 5


class LinkLost(LinkError):
    """The port was open and went away."""

    exit_code = 6


class BoardError(MrlError):
    """What answers on the port, or does not, is not what was asked for."""

    exit_code = 7


class NotARobot(BoardError, TimeoutError):
    """Nothing on the port speaks the frame protocol."""


class WrongRobot(BoardError):
    """A robot answers, but not the configured one."""

    exit_code = 8


class BatteryDead(BoardError):
    """The motors have no power, or the battery is too low to start."""

    exit_code = 9


class BoardTimeout(BoardError, TimeoutError):
    """A known board did not answer in time."""

    exit_code = 10


class BoardRefused(BoardError):
    """The board answered that it will not."""

    exit_code = 11


class WheelFault(BoardError):
    """A wheel does not do what it was told: encoder, wiring, power, or something in its way."""

    exit_code = 14


class FrameError(MrlError, ValueError):
    """A frame was to be sent that the command table forbids."""

    exit_code = 12


class SimulatorError(MrlError):
    """The emulator cannot be built or started."""

    exit_code = 13


class OutputError(MrlError):
    """What was to be printed or kept in a file cannot be written."""

    exit_code = 15
