"""Renders the command table and the robot models into the firmware's `protocol.h` and into `firmware/PROTOCOL.md`,
the pins of the chips into its `chip_pins.h`, the form of a robot's file into a JSON Schema for editors, the table of
problems into `docs/troubleshooting.md`, and the wirings of the robots in `docs/robots` into diagrams.

    python -m mrl_driver.generate            writes the files
    python -m mrl_driver.generate --check    exit code 1 and one line per stale file; writes nothing

The files are committed, so that the Arduino IDE and editors need no Python.
"""

import sys
from functools import partial
from pathlib import Path
from typing import Callable, Dict, Mapping, Sequence, Tuple

from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.protocol import table
from mrl_driver.robot import models
from mrl_driver.yaml_form import schema_text

from .chip_header import chip_header
from .cpp_header import header
from .reference import reference
from .troubleshooting import troubleshooting
from .wiring_diagram import wiring_diagram

ROOT = Path(__file__).resolve().parent.parent.parent

FILES: Dict[str, Callable[[], str]] = {
    "firmware/mrl_firmware/src/serial/protocol.h": header,
    "firmware/mrl_firmware/src/hal/chip_pins.h": chip_header,
    "firmware/PROTOCOL.md": reference,
    "docs/troubleshooting.md": troubleshooting,
    "mrl_driver/robot/models/robot.schema.json": lambda: schema_text(
        "Robot model of mrl-driver", models.RobotFile().schema()
    ),
    **{
        f"docs/robots/{path.stem}.svg": partial(wiring_diagram, str(path))
        for path in sorted((ROOT / "docs" / "robots").glob("*.yaml"))
    },
}


def main(arguments: Sequence[str]) -> int:
    """Write what is stale, or with `--check` only name it; returns the exit code.  An error is one line."""
    try:
        _require_unique_rows()
        files = {name: (ROOT / name, render()) for name, render in FILES.items()}
    except MrlError as error:
        sys.stderr.write(f"{error}\n")
        return error.exit_code
    return write_stale(files, "python -m mrl_driver.generate", arguments)


def _require_unique_rows() -> None:
    """Raise ConfigError unless the commands' codes run from 1 without a gap, and each command has its own name."""
    codes, names = [row.code for row in table.COMMANDS], [row.name for row in table.COMMANDS]
    free = min({*range(1, len(codes) + 2)} - {*codes})
    wrong = [
        f"{code} {name}"
        for code, name in zip(codes, names)
        if not 0 < code <= len(codes) or codes.count(code) + names.count(name) > 2
    ]
    if wrong:
        raise ConfigError(
            f"{table.__file__}: got {', '.join(wrong)}, expected each code and name once, and codes without a gap: "
            f"the next free one is {free}"
        )


def write_stale(files: Mapping[str, Tuple[Path, str]], command: str, arguments: Sequence[str]) -> int:
    """Write the files, by name, that do not hold their text; with `--check` name them, and return 1 if there is one."""
    stale = {
        name: (path, text)
        for name, (path, text) in files.items()
        if not path.exists() or path.read_text(encoding="utf-8") != text
    }
    if "--check" in arguments:
        for name in stale:
            sys.stderr.write(f"{name} is stale; render it with: {command}\n")
        return 1 if stale else 0
    for path, text in stale.values():
        path.parent.mkdir(exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return 0
