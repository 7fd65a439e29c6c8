"""The table of `mrl ports` for a terminal."""

import os
from typing import Any, Dict, List

from rich.console import Console
from rich.table import Table
from rich.text import Text

from mrl_driver.robot.battery import voltage_text

Row = Dict[str, Any]
EMULATED = "without a board:  mrl-sim --link ttySIM0   serves an emulated robot"


def show(rows: List[Row], probed: bool) -> None:
    """Print the ports; say what to do if there is none, or if none was asked."""
    console = Console(highlight=False)
    if not rows:
        console.print(f"no serial port found; plug the board in, and check with: dmesg | tail\n\n{EMULATED}")
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    for title in ("port", "device", "state", *(["robot"] if probed else [])):
        table.add_column(title, overflow="fold")
    for row in rows:
        table.add_row(_port(row), _kind(row), _state(row), *([_robot(row)] if probed else []))
    console.print(table)
    if any(row["arduino"] or row["name"] for row in rows):
        if not probed:
            console.print("\nfind the robots:  mrl ports --probe   (resets the boards)", style="dim")
    else:
        console.print(f"\n{EMULATED}", style="dim")


def _port(row: Row) -> Text:
    text = Text(row["device"])
    if row["name"]:
        text.append(f"\n{row['name']}", style="bold cyan")
    return text


def _kind(row: Row) -> Text:
    text = Text(row["kind"])
    detail = "  ".join(part for part in (row["usb"], row["serial"]) if part)
    return text.append(f"\n{detail}", style="dim") if detail else text


def _state(row: Row) -> Text:
    if row["used_by"]:
        return Text(f"in use by {row['used_by']}", style="yellow")
    if not os.path.exists(row["device"]):
        return Text("does not exist", style="red")
    if not row["permitted"]:
        who = "only root may open it" if row["group"] in ("", "root") else f"join group {row['group']}"
        return Text(f"no permission; {who}", style="red")
    return Text("free", style="green")


def _robot(row: Row) -> Text:
    if not row["asked"]:
        if row["used_by"] or not row["permitted"]:
            return Text("not asked", style="dim")  # its state says why
        return Text(f"not asked; mrl ports --probe {row['device']}", style="dim")
    if row["error"]:
        return Text(row["error"], style="yellow")
    model = row["model"] or ("no id set" if not row["robot_id"] else "unknown model")
    text = Text(f"{model} {row['robot_id'] or ''}".strip(), style="bold green")
    battery = voltage_text(row["battery_v"])
    return text.append(f"\nfirmware {row['firmware_version']}, battery {battery}", style="dim")
