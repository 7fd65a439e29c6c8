"""Renders the parameters of robot_node into the launch files that pass them on.

An argument whose doc begins with `~` is a parameter: its row has doc and default.  A default that is computed stays.
`robot.launch` has all parameters.
"""

import re
from pathlib import Path
from typing import List, Tuple
from xml.sax.saxutils import quoteattr

from ros1_bridge.node.parameters import Row, default_text
from ros1_bridge.node.robot_parameters import ROWS

FOLDER = Path(__file__).resolve().parent.parent / "launch"
_ARGUMENT = re.compile(r'  <arg name="(\w+)" default="([^"]*)" doc="~[^"]*"/>\n')
_PARAMETER = re.compile(r'    <param name="(\w+)" value="([^"]*)"[^>]*/>\n')
_BY_NAME = {row.name: row for row in ROWS}


def files() -> List[Tuple[Path, str]]:
    """The launch files and their text."""
    made = [(path, path.read_text(encoding="utf-8")) for path in sorted(FOLDER.glob("*.launch"))]
    return [(path, (render_all if path.name == "robot.launch" else render)(text)) for path, text in made]


def render(text: str) -> str:
    """The text of a launch file, with the arguments that it has."""
    return _ARGUMENT.sub(lambda found: _argument(_BY_NAME[found[1]], found[2]), text)


def render_all(text: str) -> str:
    """The text of a launch file, with an argument for each parameter but those that are computed from others."""
    defaults, values = dict(_ARGUMENT.findall(text)), dict(_PARAMETER.findall(text))
    computed = {name for name, value in values.items() if value != f"$(arg {name})"}
    arguments = [_argument(row, defaults.get(row.name, "")) for row in ROWS if row.name not in computed]
    parameters = [_parameter(row, values.get(row.name, f"$(arg {row.name})")) for row in ROWS]
    for pattern, lines in ((_ARGUMENT, arguments), (_PARAMETER, parameters)):
        before, *_, after = re.split(f"(?:{pattern.pattern})+", text, maxsplit=1)
        text = before + "".join(lines) + after
    return text


def _argument(row: Row, default: str) -> str:
    if row.default is not None and "$(" not in default:
        default = default_text(row)
    extent = ", ".join(str(each) or "empty" for each in row.choices)
    extent = f"{row.low:g} to {row.high:g} {row.unit}" if row.kind is float else extent
    doc = f"~{row.name}: {row.text}" + (f" [{extent}]" if extent else "")
    return f"  <arg name={quoteattr(row.name)} default={quoteattr(default)} doc={quoteattr(doc)}/>\n"


def _parameter(row: Row, value: str) -> str:
    kind = ' type="str"' if row.kind is str else ""
    return f"    <param name={quoteattr(row.name)} value={quoteattr(value)}{kind}/>\n"
