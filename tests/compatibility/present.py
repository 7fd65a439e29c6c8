"""What docs/compatibility.md promises, as this tree has it: lines of a kind, a name, and words.

python -m tests.compatibility.present >tests/compatibility/0.5.0.txt      # the promise of a release
"""

import ast
import importlib
import inspect
import json
import re
from pathlib import Path
from typing import Any, Dict, Iterator, List, Sequence, Tuple
from xml.etree import ElementTree

import click

from mrl_driver import errors
from mrl_driver.cli.main import cli
from mrl_driver.driver import Driver
from mrl_driver.protocol import REPLIES, REQUESTS, encode_reply, encode_request, table
from mrl_driver.protocol.stop_reason import STOP_REASONS
from mrl_driver.robot import models, wiring
from mrl_driver.robot.chips import CHIPS
from sim_arduino.board import parameter_store
from sim_arduino.serve.main import parser
from tests.models import four_wheels, model

Line = Tuple[str, str, List[str]]
"""Kind, name, words."""

ROOT = Path(__file__).resolve().parents[2]
PUBLIC = {
    "mrl_driver.driver": "-Board Driver -Imu Options -SensorRead -Status -Telemetry",
    "mrl_driver.driver.driver_recorder": "-DriverRecorder",
    "mrl_driver.driver.link_status": "-LinkStatus",
    "mrl_driver.driver.parameters": "-Parameters",
    "mrl_driver.driver.radio": "-Radio",
    "mrl_driver.driver.recorded": "RecordedDriver",
    "mrl_driver.driver.servos": "-Servos",
    "mrl_driver.driver.simulated": "SteppedDriver",
    "mrl_driver.errors": " ".join(
        f"-{name}()" for name, each in vars(errors).items() if inspect.isclass(each)
    ),
    "mrl_driver.geometry": "Pose",
    "mrl_driver.protocol": "Frame FrameDecoder Garbage encode_reply encode_request",
    "mrl_driver.protocol.table": "BY_NAME COMMANDS",
    "mrl_driver.robot.models": "-RobotModel load",
    "mrl_driver.view.shown_state": "line snapshot",
    "mrl_driver.view.trail": "Trail",
    "sim_arduino.board": "PythonBoard()",
    "sim_arduino.hardware.laser": "LaserScanner",
    "sim_arduino.hardware.wiring": "Plant()",
    "sim_arduino.serve.factory": "Options make",
    "sim_arduino.testing": "EmulatedBoard",
    "sim_arduino.world.grid_map": "draw write",
    "sim_arduino.world.world_file": "load",
}
"""What programs import, by module: a name with its arguments, and of a class its public members.

With `-` they do not make it, so its arguments are no promise; with `()` only these are.
"""

TABLES: Dict[str, Sequence[Any]] = {
    "baud": table.BAUDS,
    "bridge": table.BRIDGES,
    "capability": table.CAPABILITIES,
    "fault": table.FAULTS,
    "hold_state": table.HOLD_STATES,
    "input": table.INPUTS,
    "parameter": table.SETTINGS,
    "pin": table.PINS,
    "refusal": table.REASONS,
    "reset_cause": table.RESET_CAUSES,
    "stop_reason": STOP_REASONS,
    "virtual_fault": table.VIRTUAL_FAULTS,
    "wheel": table.WHEELS,
    "wiring_bit": table.WIRING,
    "wiring_problem": table.WIRING_PROBLEMS,
}
"""Whose rows and bits the frames number."""


def python_names() -> Iterator[Line]:
    """Names that programs import; an argument that may be left out ends with `=`."""
    for module, names in PUBLIC.items():
        for word in names.split():
            name = word.strip("-()")
            found = getattr(importlib.import_module(module), name)
            made = callable(found) and word[0] != "-"
            yield "python", f"{module}.{name}", _arguments(found) if made else []
            if inspect.isclass(found) and not word.endswith("()"):
                yield from _members(f"{module}.{name}", found)


def _members(path: str, found: type) -> Iterator[Line]:
    """Public members of a class that its base does not have, and the attributes that its docstring names."""
    base = next((each for each in found.__mro__[1:] if each in (Driver, Exception, tuple)), object)
    for name in (each for each in dir(found) if each[0] != "_" and each not in dir(base)):
        member = getattr(found, name)
        static = isinstance(inspect.getattr_static(found, name), (staticmethod, classmethod))
        yield (
            "python",
            f"{path}.{name}",
            _arguments(member)[not static :] if inspect.isroutine(member) else [],
        )
    documented = (inspect.getdoc(found) or "").partition("Attributes:\n")[2].partition("\n\n")[0]
    for name in re.findall(r"^    (\w+): ", documented, re.M):
        yield "python", f"{path}.{name}", []


def _arguments(found: Any) -> List[str]:
    marks = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    rows = list(inspect.signature(found).parameters.values())
    if inspect.isclass(found) and inspect.isfunction(found.__init__):  # on 3.8, a Generic hides its arguments
        rows = list(inspect.signature(found.__init__).parameters.values())[1:]
    return [marks.get(row.kind, "") + row.name + "=" * (row.default is not row.empty) for row in rows]


def error_codes() -> Iterator[Line]:
    """Errors with their bases, the exit code of `mrl`, and the code for `mrl explain`."""
    for name, each in vars(errors).items():
        if inspect.isclass(each):
            bases = [base.__name__ for base in each.__mro__[1:-3]]
            yield "error", name, [*bases, f"exit:{each.exit_code}", f"code:{each.code}"]


def commands() -> Iterator[Line]:
    """Commands with their options, entry points, fixtures."""
    yield from _of_click("mrl", cli, click.Context(cli))
    simulator = [option for action in parser()._actions for option in action.option_strings]
    yield "command", "mrl-sim", simulator
    calls = ast.walk(ast.parse((ROOT / "setup.py").read_text(encoding="utf-8")))
    points = next(each for each in calls if isinstance(each, ast.keyword) and each.arg == "entry_points")
    for group, rows in ast.literal_eval(points.value).items():
        yield "entry_point", group, [row.split("=")[0] for row in rows]
    plugin = (ROOT / "sim_arduino/testing/pytest_plugin.py").read_text(encoding="utf-8")
    for name in re.findall(r"@pytest\.fixture.*\ndef ([a-z]\w+)", plugin):
        yield "fixture", name, []
    yield "pytest", "options", re.findall(r'^ +"(--[\w-]+)"', plugin, re.M)


def _of_click(name: str, command: click.Command, ctx: click.Context) -> Iterator[Line]:
    given = [option for row in command.params for option in (*row.opts, *row.secondary_opts)]
    yield "command", name.replace(" ", "_"), [each if each[0] == "-" else each.upper() for each in given]
    if isinstance(command, click.Group):
        for each in command.list_commands(ctx):
            found = command.get_command(ctx, each)
            assert found is not None
            yield from _of_click(f"{name} {each}", found, click.Context(found, parent=ctx))


def frames() -> Iterator[Line]:
    """Requests and replies with the bytes of their smallest and largest numbers, and with names and units of these."""
    for row in table.COMMANDS:
        ways = (
            ("request", REQUESTS, encode_request, row.request, row.optional),
            ("reply", REPLIES, encode_reply, row.reply, row.optional_reply),
        )
        for kind, direction, encode, fields, optional in ways:
            if row.code not in direction.shapes:
                continue
            needed = fields[: len(fields) - optional]
            ends = [
                [each.low for each in fields],
                [each.high for each in fields],
                [each.low for each in needed],
            ]
            wires = dict.fromkeys(encode(row.code, *each).decode("ascii").strip() for each in ends)
            yield kind, row.name, [*wires, *(_with_unit(each) for each in fields)]
    for name, rows in TABLES.items():
        yield "table", name, [_row(each) for each in rows]


def _row(row: Any) -> str:
    if isinstance(row, table.Parameter):
        return _with_unit(row)
    return str(row if isinstance(row, (str, int)) else row[0])


def _with_unit(row: Any) -> str:
    return f"{row.name}[{row.unit.replace(' ', '_')}]"


README = (ROOT / "ros1_bridge" / "README.md").read_text(encoding="utf-8")


def ros_names() -> Iterator[Line]:
    """Nodes, launch files with arguments, and the tables of the bridge's README, which are those of running nodes."""
    for path in sorted((ROOT / "ros1_bridge" / "nodes").iterdir()):
        yield "node", path.name, []
    for path in sorted((ROOT / "ros1_bridge" / "launch").glob("*.launch")):
        given = [
            each for each in ElementTree.parse(str(path)).getroot().iter("arg") if "value" not in each.attrib
        ]
        yield "launch", path.name, sorted({str(each.get("name")) for each in given})
    for section in re.split(r"^## ", README, flags=re.M)[1:]:
        of = (re.findall(r"`(\w+)`", section.splitlines()[0]) or [section.split()[0].lower()])[0]
        rows = re.findall(r"^\| `([\w/]+)` \| (\w+/\w+) \|", section, re.M)
        if rows:
            yield "topic", of, list(dict.fromkeys(f"{name}={kind}" for name, kind in rows))
        for heading, text in re.findall(
            r"^### Parameters(?: of `(\w+)`)?\n(.*?)(?=^#|\Z)", section, re.M | re.S
        ):
            yield "ros_parameter", heading or of, re.findall(r"^\| `~(\w+)` \|", text, re.M)
        for frame, parent in re.findall(r"^\| `(\w+)` \| `(\w+)` \|", section, re.M):
            yield "frame", frame, [parent]


def robot_files() -> Iterator[Line]:
    """Keys of robots' files with those of their sections, and the packaged models."""
    schema = json.loads(Path(models.SCHEMA).read_text(encoding="utf-8"))
    yield "robot_file", "keys", list(dict.fromkeys(_keys(schema)))
    yield "robot_file", "models", models.packaged()


def _keys(schema: Dict[str, Any], section: str = "") -> Iterator[str]:
    for key, inner in schema.get("properties", {}).items():
        yield section + key
        yield from _keys(inner, f"{section}{key}.")
    for branch in ("then", "else", "additionalProperties", "items"):
        if isinstance(schema.get(branch), dict):
            yield from _keys(schema[branch], section)


def eeproms() -> Iterator[Line]:
    """What boards store, as bytes from address 0 and as parameters; most numbers differ from the model's."""
    robots = {"omni3md": model("traxbot"), "bridge": model("duo"), "bridge_mega": four_wheels("mecanum")}
    for name, robot in robots.items():
        rows = (*table.SETTINGS, *wiring.rows(CHIPS[robot.chip]))
        values = parameter_store.first(robot.ids[0], robot)
        for row in rows[: len(values)]:
            if row.number and row.high > 5 and row not in table.PINS and row.name not in ("bridge", "wiring"):
                values[row.number] = min(row.high, values[row.number] + row.number)
        used = parameter_store.image(values).rstrip(b"\xff").hex()
        yield "eeprom", name, [used, *(f"{row.name}={value}" for row, value in zip(rows, values))]


def lines() -> Iterator[Line]:
    """All that is promised and has a name; no bytes that are stored."""
    for each in (python_names, error_codes, commands, frames, ros_names, robot_files):
        yield from each()


if __name__ == "__main__":
    for kind, name, words in (*lines(), *eeproms()):
        print(kind, name, *words)  # noqa: T201
