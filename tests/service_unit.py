"""The unit of the robot's service, as systemd reads it."""

import configparser
import shlex
from pathlib import Path
from typing import Dict, List

from mrl_driver.host import system_setup


def installed(root: Path) -> configparser.ConfigParser:
    """The unit that is installed below `root`."""
    system_setup.install("ada", str(root))
    unit = configparser.ConfigParser(interpolation=None, strict=False)
    unit.optionxform = str  # type: ignore[assignment, method-assign]
    unit.read(root / system_setup.UNIT)
    return unit


def environment(unit: configparser.ConfigParser) -> Dict[str, str]:
    """What the unit itself sets."""
    words = shlex.split(unit["Service"]["Environment"])
    return {name: value for name, value in (word.split("=", 1) for word in words)}


def start_line(unit: configparser.ConfigParser, locks: Path, port: str = "/dev/mrl-NAME") -> List[str]:
    """The words that systemd runs, with another folder for locks, and another port."""
    line = unit["Service"]["ExecStart"].replace("/run/lock", str(locks))
    return shlex.split(line.replace("/dev/mrl-%I", port).replace("%I", "NAME"))
