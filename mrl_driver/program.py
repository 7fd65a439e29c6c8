"""The program: its version, and the start of a command before its own error handling exists."""

import importlib
import os
import signal
import sys

from .errors import ConfigError

_NAMES_FOR_PIP = {"serial": "pyserial", "yaml": "PyYAML"}
"""Names of packages that differ from the names of their modules."""
_OWN = ("", "mrl_driver", "sim_arduino", "ros1_bridge")


def start(name: str, module: str) -> None:
    """Run the command `name`: the function `main` of `module`, which is imported now.

    Ctrl-C during the imports ends the program without a message.  If a Python package is missing, now or later, the
    program ends with one line.

    Raises:
        SystemExit: a package is missing.
    """
    _open_closed_streams()
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:  # else a shell has it ignored, for a program in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        run = importlib.import_module(module).main
        signal.signal(signal.SIGINT, before)
        run()
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in _OWN:
            raise
        sys.stderr.write(
            f"{name}: the Python package {package} is missing; install it with: sudo apt install python3-{package}, "
            f"or: pip install {_NAMES_FOR_PIP.get(package, package)}\n"
        )
        sys.exit(ConfigError.exit_code)


def version() -> str:
    """Return the version of the package."""
    from importlib import metadata

    try:
        return metadata.version("mrl-driver")
    except metadata.PackageNotFoundError:
        return "unknown (not installed)"


def _open_closed_streams() -> None:
    """Let a standard stream that the caller has closed lead nowhere: otherwise a port gets its number, and messages."""
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is that of the stream
            setattr(sys, name, os.fdopen(number, mode))
