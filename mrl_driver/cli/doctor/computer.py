"""Checks of the computer and the port, without opening it."""

import getpass
import grp
import os
import shlex
import stat
import sys
from typing import Iterator, List

from mrl_driver.transport.port_info import (
    ARDUINO_VENDORS,
    Port,
    is_terminal,
    opening_group,
    programs_named,
    udev_properties,
    user_of,
)
from mrl_driver.transport.reconnect import may_be_there

from .findings import NOTE, WARNING, Finding, fault, note, ok, problem, warning

IDLE_LATENCY_MS = 2
"""An FTDI adapter delays bytes by its latency timer, 16 ms by default; a longer time than this one gives a note."""


def check(name: str, port: Port) -> Iterator[Finding]:
    """Run all checks; `port` is the port that `name` leads to."""
    yield from _permission(name)
    yield from _modem_manager(port)
    yield from _brltty(name, port)
    holder = user_of(name) if is_terminal(name) else ""
    if holder:
        yield fault("port_busy", "in use", f"{name} is in use by {holder}")
    yield from _latency_timer(port)


def _as_root(words: str) -> str:
    """Return the command that runs this program as root; sudo does not search a virtual environment."""
    program = sys.argv[:1] if os.path.basename(sys.argv[0]) == "mrl" else [sys.executable, "-m", "mrl_driver"]
    return f"sudo {shlex.join(program)} {words}"


def _permission(name: str) -> Iterator[Finding]:
    try:
        if not stat.S_ISCHR(os.stat(name).st_mode):
            return
    except (OSError, ValueError):
        return
    group = opening_group(name)
    if os.access(name, os.R_OK | os.W_OK):
        yield ok("permission", f"you may open {name}" + (f" (group {group})" if group else ""))
    elif not group:
        advice = f"let udev give serial ports to group dialout: {_as_root('system install')}"
        yield fault("port_denied", "permission", f"only root may open {name}", advice)
    elif group in groups_by_file():
        text = f"you are in group {group}, but you logged in before you were added"
        advice = f"log out and in again, or for this terminal: newgrp {group}"
        yield fault("port_denied", "permission", text, advice)
    else:
        advice = f"sudo usermod -aG {group} $USER, then log out and in"
        yield fault(
            "port_denied", "permission", f"you may not open {name}: it belongs to group {group}", advice
        )


def groups_by_file() -> List[str]:
    """Return the user's groups by the system's files; those of the login session may be older."""
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        return []
    return [each.gr_name for each in grp.getgrall() if user in each.gr_mem]


def _modem_manager(port: Port) -> Iterator[Finding]:
    """Check ModemManager: it writes `AT` to new serial ports for some seconds, unless a udev rule prevents that."""
    if port.vendor is None:
        return
    if not programs_named("ModemManager"):
        yield ok("ModemManager", "not running")
    elif udev_properties(port.device).get("ID_MM_DEVICE_IGNORE") == "1":
        yield ok("ModemManager", "runs, but leaves this port alone")
    else:
        known = port.vendor in ARDUINO_VENDORS
        yield problem(
            NOTE if known else WARNING,
            "modem_manager",
            "ModemManager",
            "runs, and may keep the port busy for some seconds after the board is plugged in",
            f"{_as_root('system install')}, or: sudo systemctl disable --now ModemManager",
        )


def _brltty(name: str, port: Port) -> Iterator[Finding]:
    """Check brltty: about a second after an adapter was plugged in, it takes it for a Braille display, and its port is
    gone.
    """
    missing = not may_be_there(name)
    if not missing and port.vendor in (None, *ARDUINO_VENDORS):
        return
    if programs_named("brltty"):
        yield warning(
            "brltty",
            "brltty",
            "runs, and takes CH340, CP210x, FTDI and PL2303 adapters for Braille displays: their ports vanish",
            f"unless you use a Braille display: {_as_root('system install --mask-brltty')}, then plug the board in",
        )
    elif not missing:
        yield ok("brltty", "not running")


def _latency_timer(port: Port) -> Iterator[Finding]:
    path = f"/sys/bus/usb-serial/devices/{os.path.basename(port.device)}/latency_timer"
    try:
        with open(path, encoding="ascii") as file:
            timer_ms = int(file.read())
    except (OSError, ValueError):
        return
    if timer_ms > IDLE_LATENCY_MS:
        text = f"holds bytes back for up to {timer_ms} ms"
        yield note("usb_latency", "USB adapter", text, f"echo 1 | sudo tee {path}")
