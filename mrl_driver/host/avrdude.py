"""Uploads a firmware image to an Arduino Uno with `avrdude`, and explains its errors in one line."""

import os
import re
import subprocess
from typing import Callable, List, Optional, Tuple, Type

from mrl_driver.errors import (
    BoardRefused,
    BoardTimeout,
    ConfigError,
    LinkLost,
    MrlError,
    NotARobot,
    PortBusy,
    PortDenied,
    PortMissing,
)

BAUD = 115200
"""Baud rate of the Uno's bootloader."""
PROGRAM = "avrdude"
MARKS = 100
"""Number of progress marks of an upload: 50 for writing, 50 for reading back."""
_ATTEMPTS = 3
"""Attempts before giving up.  avrdude makes ten of 5 s each; a board that fails three never answers."""
_ATTEMPT = re.compile(r"attempt (\d+) of \d+: not in sync")


_EXPLANATIONS: Tuple[Tuple[str, Type[MrlError], str], ...] = (
    (
        "permission denied",
        PortDenied,
        "no permission for {port}; join its group with: sudo usermod -aG dialout $USER, then log out and in",
    ),
    (
        "resource busy|locked",
        PortBusy,
        "{port} is in use by another program; close that program, then try again",
    ),
    ("no such file|cannot set attributes|is a directory", PortMissing, "{port} is not a serial port"),
    (
        "expected signature|invalid device signature",
        BoardRefused,
        "the chip at {port} is not an ATmega328P, expected an Arduino Uno; nothing was written",
    ),
    (
        "verif.*(error|mismatch)|content mismatch|first mismatch",
        BoardRefused,
        "the data read back from {port} differ from the image; try again with a shorter USB cable",
    ),
    (
        "input/output error|no such device",
        LinkLost,
        "{port} went away during the upload; check the cable, then try again",
    ),
    (
        "not in sync|not responding",
        NotARobot,
        "no bootloader answers at {port} (not in sync): check that it is an Arduino Uno, unplug everything "
        "from D0 and D1 (such as an XBee shield), press reset and try again",
    ),
    (
        "timeout|timed out",
        BoardTimeout,
        "{port} stopped answering during the upload; press reset and try again",
    ),
    ("file format|invalid record|checksum", ConfigError, "{image} is damaged, expected Intel HEX"),
)
"""Messages of avrdude 6.3 to 7.3 and their errors, the most specific first."""


def command(port: str, image: str) -> List[str]:
    """Return the command line of the upload; avrdude itself reads back and compares."""
    return [
        PROGRAM,
        "-p",
        "m328p",
        "-c",
        "arduino",
        "-b",
        str(BAUD),
        "-P",
        port,
        "-D",
        "-U",
        f"flash:w:{image}:i",
    ]


def upload(port: str, image: str, advance: Callable[[float], None] = lambda marks: None) -> None:
    """Write an image and read it back; `advance` is called with the number of new progress marks, `MARKS` in all.

    Raises:
        ConfigError: the image is missing or damaged, or avrdude is not installed.
        LinkError: the port cannot be used.
        NotARobot: no bootloader answers.
        BoardRefused: the chip is not an ATmega328P, or the data read back differ.
        MrlError: avrdude failed in another way; the text is avrdude's.
    """
    if not os.path.isfile(image):
        raise ConfigError(f"image {image!r} does not exist, expected a .hex file")
    try:
        process = subprocess.Popen(
            command(port, image),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
        )
    except FileNotFoundError:
        raise ConfigError("avrdude is not installed; install it with: sudo apt install avrdude") from None
    try:
        output = _read_output(process, advance)
    finally:
        process.terminate()
        process.wait()
    if process.returncode:
        raise explain(output, port, image)


def _read_output(process: "subprocess.Popen[bytes]", advance: Callable[[float], None]) -> str:
    """Return avrdude's output until it ends or has made `_ATTEMPTS` attempts."""
    assert process.stderr is not None
    output = ""
    for chunk in iter(lambda: os.read(process.stderr.fileno(), 4096), b""):  # type: ignore[union-attr]
        text = chunk.decode("utf-8", "replace")
        output += text
        advance(text.count("#"))
        attempts = _ATTEMPT.findall(output)
        if attempts and int(attempts[-1]) >= _ATTEMPTS:
            return output
    process.wait()
    return output


def explain(output: str, port: str, image: str) -> MrlError:
    """Return the error for avrdude's output."""
    for pattern, kind, text in _EXPLANATIONS:
        if re.search(pattern, output, re.IGNORECASE):
            return kind(text.format(port=port, image=image))
    return MrlError(f"avrdude failed: {_last_line(output) or 'it printed no reason'}")


def _last_line(output: str) -> Optional[str]:
    lines = [line.strip() for line in output.splitlines() if line.strip() and "#" not in line]
    return next((line for line in reversed(lines) if "error" in line.lower()), lines[-1] if lines else None)
