"""`mrl ports`: list the serial ports, and the robots on them."""

import os
from typing import Any, Dict, List, Optional, Tuple

import click

from mrl_driver.errors import ConfigError
from mrl_driver.host import named_robots
from mrl_driver.protocol.table import BAUD
from mrl_driver.robot.battery import voltage_text

from .shared import Between, complete_port, json_option, print_json, require_device

Row = Dict[str, Any]
Cell = List[Tuple[str, str]]  # texts and their styles
EMULATED = "without a board:  mrl-sim --link ttySIM0   serves an emulated robot"


@click.command()
@click.argument("port", nargs=-1, shell_complete=complete_port)
@click.option(
    "--probe",
    is_flag=True,
    help="Identify robots: on boards made by Arduino, named robots, and each PORT.  Opening a port resets its board.",
)
@click.option(
    "--wait",
    "wait_s",
    type=Between(0.5, 60.0),
    metavar="S",
    help="Time for a board's first answer [s]; default: 8 on USB ports, where a board of 2013 needs 5.4, else 4.",
)
@json_option
def ports(port: Tuple[str, ...], probe: bool, wait_s: Optional[float], as_json: bool) -> None:
    """List serial ports, and the robots on them.

    Opens no port without --probe, because opening resets an Arduino Uno, and other devices may be connected.  --probe
    opens boards whose USB vendor is Arduino, the ports of named robots, and each PORT, all at the same time.  It never
    opens a port that is in use.

    \b
    Examples:
      mrl ports
      mrl ports --probe
      mrl ports --probe --wait 4            shorter; a board of 2013 on USB may need 6 s
      mrl ports --probe /dev/ttyUSB0        a copy of the Uno, with another USB vendor
    """
    for name, value in (("PORT", port), ("--wait", wait_s)):
        if value and not probe:
            raise ConfigError(f"{name} is given without --probe, expected both or neither")
    for each in port:
        require_device(each)
    rows = _rows(port)
    if probe:
        _ask(rows, port, wait_s)
    if as_json:
        print_json(list(rows.values()))
        return
    _show(list(rows.values()), probe)


def _rows(asked: Tuple[str, ...]) -> Dict[str, Row]:
    """Return all existing ports and the requested ones, by device."""
    from mrl_driver.transport.port_info import Port, facts, facts_of

    named = {os.path.realpath(each.port): name for name, each in named_robots.read().items() if each.port}
    rows = {each.device: dict(each._asdict(), name=named.get(each.device)) for each in facts()}
    for port in [*asked, *named]:
        device = os.path.realpath(port)
        if device not in rows and (port in asked or os.path.exists(device)):
            found = facts_of(Port(device))._asdict()
            rows[device] = dict(found, device=port, name=named.get(device))
    return rows


def _ask(rows: Dict[str, Row], asked: Tuple[str, ...], wait_s: Optional[float]) -> None:
    """Ask the robots on the ports that may be opened, and add the answers to their rows."""
    from mrl_driver.driver.probe import patience_s, probe_all

    from .progress import progress

    allowed = {os.path.realpath(port) for port in asked}
    chosen: List[Tuple[str, int, float]] = []
    for device, row in rows.items():
        row["asked"] = (row["arduino"] or bool(row["name"]) or device in allowed) and not row["used_by"]
        if row["asked"]:
            patience = patience_s(resets=bool(row["usb"])) if wait_s is None else wait_s
            baud = named_robots.read()[row["name"]].baud if row["name"] else BAUD
            chosen.append((row["device"], baud, patience))
    by_device = {row["device"]: row for row in rows.values()}
    with progress("asking", len(chosen)) as advance:
        for device, answer in probe_all(chosen):
            by_device[device].update(answer._asdict())
            advance(1)


# -- the table


def _show(rows: List[Row], probed: bool) -> None:
    """Print the ports; say what to do if there is none, or if none was asked."""
    from rich.console import Console  # late: the list of commands loads this module
    from rich.table import Table
    from rich.text import Text

    console = Console(highlight=False)
    if not rows:
        hint = "plug the board in with a cable for data, and check with: dmesg | tail"
        console.print(f"no serial port found; {hint}\n\n{EMULATED}")
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    columns = {"port": _port, "device": _kind, "state": _state, **({"robot": _robot} if probed else {})}
    for title in columns:
        table.add_column(title, overflow="fold")
    for row in rows:
        table.add_row(*(Text.assemble(*cell(row)) for cell in columns.values()))
    console.print(table)
    if any(row["arduino"] or row["name"] for row in rows):
        if not probed:
            console.print("\nfind the robots:  mrl ports --probe   (resets the boards)", style="dim")
    else:
        console.print(f"\n{EMULATED}", style="dim")


def _port(row: Row) -> Cell:
    return [(row["device"], ""), (f"\n{row['name']}" if row["name"] else "", "bold cyan")]


def _kind(row: Row) -> Cell:
    detail = "  ".join(part for part in (row["usb"], row["serial"]) if part)
    return [(row["kind"], ""), (f"\n{detail}" if detail else "", "dim")]


def _state(row: Row) -> Cell:
    if row["used_by"]:
        return [(f"in use by {row['used_by']}", "yellow")]
    if not os.path.exists(row["device"]):
        return [("does not exist", "red")]
    if not row["permitted"]:
        who = "only root may open it" if row["group"] in ("", "root") else f"join group {row['group']}"
        return [(f"no permission; {who}", "red")]
    return [("free", "green")]


def _robot(row: Row) -> Cell:
    if not row["asked"]:
        if row["used_by"] or not row["permitted"]:
            return [("not asked", "dim")]  # its state says why
        return [(f"not asked; mrl ports --probe {row['device']}", "dim")]
    if row["error"]:
        return [(row["error"], "yellow")]
    model = row["model"] or ("no id set" if not row["robot_id"] else "unknown model")
    battery, virtual = voltage_text(row["battery_v"]), "virtual " if "virtual" in row["capabilities"] else ""
    return [
        (f"{virtual}{model} {row['robot_id'] or ''}".strip(), "bold green"),
        (f"\nfirmware {row['firmware_version']}, battery {battery}", "dim"),
    ]
