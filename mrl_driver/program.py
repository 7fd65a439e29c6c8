"""The program: its version, and the start of a command before its own error handling exists."""

import gc
import importlib
import os
import re
import signal
import sys
from typing import Any, Dict, Match, Sequence

from .errors import ConfigError

_OF_PIP = {"click": "click", "numpy": "numpy", "rich": "rich", "serial": "pyserial", "yaml": "PyYAML"}
"""Packages that pip has, by their modules; those of ROS come from apt alone."""
END_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)
"""Signals that end a program: Ctrl-C, kill, a closed terminal, Ctrl-backslash."""
REPEATED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Those of them that are ignored while a program ends; Ctrl-backslash still ends one that hangs."""
_OWN = ("", "mrl_driver", "sim_arduino", "ros1_bridge")


def start(name: str, module: str) -> Any:
    """Run the command `name`: the function `main` of `module`, which is imported now; returns what it returns.

    Ctrl-C during the imports ends the program without a message.  If a Python package is missing, now or later, the
    program ends with one line.

    Raises:
        SystemExit: a package is missing.
    """
    _open_closed_streams()
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:  # else a shell has it ignored, for a program in the background
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.disable()  # an import leaves no garbage worth a search
    try:
        run = importlib.import_module(module).main
        gc.freeze()  # nor do later searches need what it made
        gc.enable()
        signal.signal(signal.SIGINT, before)
        try:
            return run()
        finally:
            handle_end_signals(signal.SIG_IGN, REPEATED)  # Ctrl-C is still held
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package in _OWN:
            raise
        own = sys.prefix != sys.base_prefix  # a virtual environment, into which pip installs
        of_pip = f", or: pip install {_OF_PIP[package]}" if own and package in _OF_PIP else ""
        sys.stderr.write(
            f"{name}: the Python package {package} is missing; install it with: sudo apt install "
            f"python3-{package.replace('_', '-')}{of_pip}\n"
        )
        sys.exit(ConfigError.exit_code)


def handle_end_signals(
    handler: Any, numbers: Sequence[int] = END_SIGNALS, even_ignored: bool = False
) -> Dict[int, Any]:
    """Set the handler of these signals, and return those before.  Only for the main thread.

    An ignored signal stays ignored: `nohup` ignores SIGHUP, and a script SIGINT and SIGQUIT for a program in the
    background.  With `even_ignored` only SIGHUP does.
    """
    before: Dict[int, Any] = {}
    for number in numbers:
        if signal.getsignal(number) is not signal.SIG_IGN or (even_ignored and number != signal.SIGHUP):
            before[number] = signal.signal(number, handler)
    return before


def version(package: str = "mrl-driver") -> str:
    """Return the version of a Python package."""
    from importlib import metadata

    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown (not installed)"


_RANGE = re.compile(r" is not in the range (?:(\S+)(<=?))?x(?:([<>]=?)(\S+?))?\.?$")
_KIND = re.compile(r" is not a valid (float|integer)(?: range)?\.?$")
_WORDS = {"<": "below ", "<=": "at most ", ">": "above ", ">=": "at least "}


def in_plain_words(text: str) -> str:
    """Return an error of the library click with its words for kinds and ranges of numbers in plain English."""
    text = _KIND.sub(lambda kind: f", expected a {'whole ' * (kind[1] == 'integer')}number", text)
    return _RANGE.sub(lambda found: f", expected {_in_words(found)}", text)


def _in_words(found: Match[str]) -> str:
    least, from_, to, most = found.groups()
    if (from_, to) == ("<=", "<="):
        return f"{float(least):.12g} to {float(most):.12g}"
    above = f"{'above' if from_ == '<' else 'at least'} {float(least):.12g} and " if from_ else ""
    return f"{above}{_WORDS[to]}{float(most):.12g}"


def _open_closed_streams() -> None:
    """Let a standard stream that the caller has closed lead nowhere: otherwise a port gets its number, and messages."""
    for number, (name, mode) in enumerate((("stdin", "r"), ("stdout", "w"), ("stderr", "w"))):
        if getattr(sys, name) is None:
            os.open(os.devnull, os.O_RDWR)  # gets the lowest free number, which is that of the stream
            setattr(sys, name, os.fdopen(number, mode))
