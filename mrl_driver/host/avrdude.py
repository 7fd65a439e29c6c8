"""Uploads a firmware image to an Arduino with `avrdude`, and explains its errors in one line."""

import os
import re
import select
import subprocess
from typing import Callable, List, Optional, Sequence, Tuple, Type

from mrl_driver import errors
from mrl_driver.errors import ConfigError, MrlError, NotARobot
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560, Chip
from mrl_driver.transport.link import denied

BAUDS = (115200, 57600)
"""Baud rates of bootloaders: of Uno, Nano and Mega, and of Nanos with the old bootloader.

Source: `boards.txt` of the Arduino core, `upload.speed` of uno, nano and mega."""
_BOARDS = {ATMEGA328P: "-p m328p -c arduino", ATMEGA2560: "-p m2560 -c wiring"}
"""Chip and bootloader in avrdude's words; the Mega's speaks STK500 version 2."""
PROGRAM = "avrdude"
MARKS = 100  # number of progress marks of an upload: 50 for writing, 50 for reading back
_ATTEMPTS, _EARLY_ATTEMPTS = 3, 2
"""Failed attempts before giving up, at the last baud rate and at those before.  avrdude makes ten of 5 s each to reach
a bootloader; a board that fails three never answers."""
HALF = "the board may have half a firmware, which may turn the motors: switch their power off, then flash it again"
"""What an upload that was cut may leave: pages of the new firmware next to those of the old one."""
_WRITES = "Writing |"
_UNREACHED, _SILENT = r"attempt \d+ of \d+: not in sync", "not responding|out of sync|timeout"
"""What avrdude says after each attempt before it writes, and from then on for each answer that is missing: it tries the
next page, which takes hours for all of them.
"""
SILENT_S = 20.0
"""avrdude says something each 5 s.  If the port goes away, it says nothing and never ends [s]."""


_EXPLANATIONS: Tuple[Tuple[str, Type[MrlError], str], ...] = (
    (
        "(open|reading|process|locate) .*config",
        ConfigError,
        "avrdude does not find its own configuration file; install both with: sudo apt install avrdude",
    ),
    ("permission denied", errors.PortDenied, "{denied}"),
    (
        "resource busy|locked",
        errors.PortBusy,
        "{port} is in use by another program; close that program, then try again",
    ),
    ("no such file|cannot set attributes|is a directory", errors.PortMissing, "{port} is not a serial port"),
    (
        "expected signature|invalid device signature",
        errors.BoardRefused,
        "the chip at {port} is not that of an Arduino {board}; nothing was written",
    ),
    (
        "verif.*(error|mismatch)|content mismatch|first mismatch",
        errors.BoardRefused,
        f"the data read back from {{port}} differ from the image; {HALF}, with a shorter USB cable",
    ),
    (
        "input/output error|no such device",
        errors.LinkLost,
        f"{{port}} went away during the upload; {HALF}, and check the cable",
    ),
    (
        rf"(?s){re.escape(_WRITES)}.*({_SILENT}|timed out|protocol)",
        errors.BoardTimeout,
        f"{{port}} stopped answering, or bytes were damaged, during the upload; {HALF}, after a reset",
    ),
    (
        "not in sync|not responding|timeout|timed out|protocol",
        NotARobot,
        "no bootloader answers at {port} (not in sync): check that it is an Arduino Uno, Nano or Mega, unplug "
        "everything from D0 and D1 (such as an XBee shield), press reset and try again",
    ),
    ("file format|invalid record|checksum", ConfigError, "{image} is damaged, expected Intel HEX"),
)
"""Messages of avrdude 6.3 to 7.3 and their errors, the most specific first."""


def command(port: str, image: str, baud: int = BAUDS[0], chip: Chip = ATMEGA328P) -> List[str]:
    """Return the command line of the upload; avrdude itself reads back and compares."""
    board = f"{_BOARDS[chip]} -b {baud} -P".split()
    return [PROGRAM, *board, port, "-D", "-U", f"flash:w:{image}:i"]


def upload(
    port: str,
    image: str,
    advance: Callable[[float], None] = lambda marks: None,
    bauds: Sequence[int] = BAUDS[:1],
    chip: Chip = ATMEGA328P,
) -> None:
    """Write an image and read it back; `advance` is called with the number of new progress marks, `MARKS` in all.

    `bauds` are the baud rates of the bootloader to try, one after the other.  ConfigError if the image is missing or
    damaged, or avrdude is not installed; LinkError, NotARobot or BoardRefused by `_EXPLANATIONS`; else MrlError with
    avrdude's own text.
    """
    if not os.path.isfile(image):
        raise ConfigError(f"image {image!r} does not exist, expected a .hex file")
    for baud in bauds:
        last = baud == bauds[-1]
        output = _run(command(port, image, baud, chip), advance, _ATTEMPTS if last else _EARLY_ATTEMPTS)
        if output is None:
            return
        error = explain(output, port, image, chip)
        if last or not isinstance(error, NotARobot):
            raise error


def _run(words: List[str], advance: Callable[[float], None], most_attempts: int) -> Optional[str]:
    """Run avrdude until `most_attempts` have failed, or it falls silent; return its output if it failed, or None."""
    null, output = subprocess.DEVNULL, ""
    try:
        process = subprocess.Popen(words, stdin=null, stdout=null, stderr=subprocess.PIPE)
    except FileNotFoundError:
        raise ConfigError("avrdude is not installed; install it with: sudo apt install avrdude") from None
    try:
        assert process.stderr is not None
        while select.select([process.stderr], [], [], SILENT_S)[0]:
            text = os.read(process.stderr.fileno(), 4096).decode("utf-8", "replace")
            if not text:
                process.wait()
                break
            output += text
            advance(text.count("#"))
            before, writes, since = output.partition(_WRITES)
            failed = re.findall(_SILENT, since) if writes else re.findall(_UNREACHED, before)
            if len(failed) >= most_attempts:
                break
        else:
            output += "timeout"
    finally:
        process.terminate()
        process.wait()
    return output if process.returncode else None


def explain(output: str, port: str, image: str, chip: Chip = ATMEGA328P) -> MrlError:
    """Return the error for avrdude's output."""
    said = output.replace(image, "\0i").replace(port, "\0p")  # names may have words of errors
    for pattern, kind, text in _EXPLANATIONS:
        if re.search(pattern, said, re.IGNORECASE):
            return kind(text.format(port=port, image=image, board=chip.board, denied=denied(port)))
    last = _last_line(said) or "it printed no reason"
    return MrlError(f"avrdude failed: {last}".replace("\0i", image).replace("\0p", port))


def _last_line(output: str) -> Optional[str]:
    """The last line that names an error.  avrdude goes on after that of a port without modem lines."""
    lines = [line.strip() for line in output.splitlines() if line.strip() and "#" not in line]
    lines = [line for line in lines if "TIOCM" not in line] or lines
    return next((line for line in reversed(lines) if "error" in line.lower()), lines[-1] if lines else None)
