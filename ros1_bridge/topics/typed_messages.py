"""The optional package `mrl_msgs`: one table of its messages, and the package as files.  Imports no ROS to write them.

`make mrl-msgs DIR=~/catkin_ws/src` writes the package, and catkin builds it.  Nodes publish its types where it can be
imported and has the fields of this table, and standard types elsewhere.
"""

import functools
import importlib
import os
import sys
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union
from xml.etree import ElementTree

from mrl_driver.errors import ConfigError
from mrl_driver.protocol.stop_reason import StopReason

REBUILD = (
    "mrl_msgs is of another version: standard types are published; run make mrl-msgs, and build it again"
)
_MANIFEST = Path(__file__).resolve().parents[2] / "package.xml"
_PACKAGE_XML = """<?xml version="1.0"?>
<package format="3">
  <name>mrl_msgs</name>
  {}
  <description>Messages of mrl_robots, written by `make mrl-msgs`</description>
  <license>BSD-3-Clause</license>
  <buildtool_depend>catkin</buildtool_depend>
  <build_depend>message_generation</build_depend>
  <exec_depend>message_runtime</exec_depend>
  <depend>std_msgs</depend>
</package>
"""
_CMAKE_LISTS = """cmake_minimum_required(VERSION 3.0.2)
project(mrl_msgs)
find_package(catkin REQUIRED COMPONENTS message_generation std_msgs)
add_message_files(FILES {})
generate_messages(DEPENDENCIES std_msgs)
catkin_package(CATKIN_DEPENDS message_runtime std_msgs)
"""
_ZONE = ("ZONE_NOT_WATCHED", "ZONE_OCCUPIED", "ZONE_CLEAR")


class Field(NamedTuple):
    """A field of a message; `names` are constants for its values 0, 1, 2 and so on."""

    kind: str
    name: str
    text: str
    names: Tuple[str, ...] = ()


MESSAGES: Dict[str, Tuple[str, Tuple[Field, ...]]] = {
    "RobotStatus": (
        "What a robot does, and why it does not, since the time of the stamp.",
        (
            Field("uint8", "mode", "what it may do", ("MODE_DRIVE", "MODE_POSE", "MODE_BLOCKED")),
            Field("uint8", "blocked_by", "a REASON if mode is MODE_BLOCKED"),
            Field("uint8", "stopped_by", "a REASON", tuple(f"REASON_{each.name}" for each in StopReason)),
            Field(
                "uint8", "operation_mode", "of the speed limits", ("OPERATION_AUTOMATIC", "OPERATION_MANUAL")
            ),
            Field("uint8", "moving", "of the wheels, as measured", ("STANDS", "MOVES", "MOVING_UNKNOWN")),
            Field("bool", "driving", "a command other than standstill is in force"),
            Field("bool", "safety_stop", "a safety function has stopped the robot, or holds it"),
            Field("uint8", "warning_zone", "with ~zones", _ZONE),
            Field("uint8", "outer_warning_zone", "with ~zones"),
            Field("uint8", "protective_zone", "with ~zones"),
        ),
    ),
    "WheelCounts": (
        "Counts of the wheels at the time of the stamp.",
        (
            Field("string[]", "name", "joint of each wheel"),
            Field("int64[]", "count", "counts of each wheel since the node's start, without wrap"),
        ),
    ),
    "Bumper": (
        "Sides at which a bumper is hit, or a cliff sensor sees no floor, since the time of the stamp.",
        tuple(Field("bool", side, f"the {side} side") for side in ("left", "right", "rear")),
    ),
    "Servo": (
        "A servo that has been moved; by its pulses, because the board does not measure its angle.",
        (
            Field("float64", "angle", "of the joint [rad]"),
            Field("float64", "low", "least angle that the robot's file allows [rad]"),
            Field("float64", "high", "largest angle that the robot's file allows [rad]"),
        ),
    ),
}


def definition(message: str) -> str:
    """The definition of a message, as its .msg file has it."""
    text, fields = MESSAGES[message]
    lines = [f"# {text}", "std_msgs/Header header"]
    for field in fields:
        lines += [f"{field.kind} {name}={value}" for value, name in enumerate(field.names)]
        lines.append(f"{field.kind} {field.name}  # {field.text}")
    return "\n".join(lines) + "\n"


def files() -> Dict[str, str]:
    """The package: text by path.  Version and maintainer are those of this one."""
    about = ElementTree.parse(_MANIFEST).getroot()
    own = [
        ElementTree.tostring(each, "unicode").strip()
        for each in about
        if each.tag in ("version", "maintainer")
    ]
    return {
        **{f"msg/{name}.msg": definition(name) for name in MESSAGES},
        "package.xml": _PACKAGE_XML.format("\n  ".join(own)),
        "CMakeLists.txt": _CMAKE_LISTS.format(" ".join(f"{name}.msg" for name in sorted(MESSAGES))),
    }


@functools.lru_cache(maxsize=None)
def typed(message: str) -> Any:
    """The class of a message; None if the package is missing, or has other fields than the table."""
    made = getattr(_installed(), message, None)
    return made if made is not None and made._full_text.startswith(definition(message)) else None


def is_other_version() -> bool:
    """Whether the package can be imported, but lacks a message or has other fields."""
    return _installed() is not None and any(typed(name) is None for name in MESSAGES)


def numbers(message: str, given: Mapping[str, Union[bool, str]]) -> Dict[str, Any]:
    """Values of fields, with constants by their names."""
    known = {name: value for field in MESSAGES[message][1] for value, name in enumerate(field.names)}
    return {name: known[value] if isinstance(value, str) else value for name, value in given.items()}


def _installed() -> Optional[Any]:
    try:
        return importlib.import_module("mrl_msgs.msg")
    except ImportError:
        return None


def main(arguments: Sequence[str]) -> List[str]:
    """Write the package into a folder, and return what was written; ConfigError if the folder is missing."""
    folder = Path(os.path.expanduser(arguments[0] if arguments else ""))
    if not arguments or not arguments[0] or not folder.is_dir():
        got = arguments[0] if arguments and arguments[0] else "nothing"
        raise ConfigError(
            f"DIR is {got}, expected the folder src of a catkin workspace: make mrl-msgs DIR=~/catkin_ws/src"
        )
    made = files()
    for name, text in made.items():
        path = folder / "mrl_msgs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return [str(folder / "mrl_msgs" / name) for name in made]


if __name__ == "__main__":
    try:
        sys.stdout.write("\n".join(main(sys.argv[1:])) + "\n")
    except (ConfigError, OSError) as error:
        sys.exit(f"mrl-msgs: {error}")
