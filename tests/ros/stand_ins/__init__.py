"""Names and types of the packages that Debian lacks: one table for each, from its documentation and sources.

Each `PACKAGE.yaml` names its sources.  `nodes` maps the type of a node (the `type` of <node>) to

    publishes, subscribes    topic: message type
    services, calls          service: its type; `calls` are services that the node calls
    actions                  name: action type, without `Action`
    reconfigure              namespaces with a dynamic_reconfigure server
    parameters               private parameter: kind (see `fault_of`)
    spaces                   namespace of parameters: its group
    chosen                   parameter that selects a plugin: the default; the plugin's parameters are in the namespace
                             that has its class name
    listed                   parameters that are a list of {name, type}: parameters of type are in namespace name
    words                    string of names separated by blanks: group of the namespaces with these names
    structs                  parameter that is a list of mappings: key: kind
    inputs                   such a parameter, whose `topic` keys are subscribed: message type
    numbered                 parameter with a topic: message type; N stands for a number

`groups` has parameters, spaces, chosen, listed and words of a namespace; its key is a plugin type or a word of our own.
A name that begins with ~ is in the node's private namespace.
"""

import re
from pathlib import Path
from typing import Any, Dict, List, Mapping, NamedTuple, Set

from mrl_driver import yaml_file

FOLDER = Path(__file__).resolve().parent
_KEYS = {
    *("publishes", "subscribes", "services", "calls", "actions", "reconfigure", "parameters"),
    *("spaces", "chosen", "listed", "words", "structs", "inputs", "numbered"),
}


class Table(NamedTuple):
    """What one node of one package has."""

    package: str
    node: str
    rows: Mapping[str, Any]

    def names(self, *keys: str) -> Mapping[str, str]:
        """Name to type of all rows of these keys."""
        return {name: kind for key in keys for name, kind in self.rows.get(key, {}).items()}


def _load() -> Dict[str, Any]:
    return {path.stem: yaml_file.read(str(path)) for path in sorted(FOLDER.glob("*.yaml"))}


def is_plugin(group: str) -> bool:
    """A group with the name of a class, by which pluginlib finds it; the others have words of our own."""
    return "/" in group or "::" in group


_FILES = _load()
PACKAGES = tuple(_FILES)
GROUPS: Dict[str, Any] = {
    name: group for file in _FILES.values() for name, group in file.get("groups", {}).items()
}
PLUGIN_PACKAGES = {
    name: package for package, file in _FILES.items() for name in file.get("groups", {}) if is_plugin(name)
}
"""Plugin type to the package whose table has it."""


def nodes_of(package: str) -> List[str]:
    """Types of a package's nodes; empty for one that has plugins only."""
    return list(_FILES[package].get("nodes", {}))


def table(package: str, node: str) -> Table:
    """The table of a node.

    Raises:
        KeyError: there is none.
    """
    rows = _FILES[package]["nodes"][node]
    assert set(rows) <= _KEYS, f"{package}: {set(rows) - _KEYS} are not keys of a table"
    return Table(package, node, rows)


def fault_of(kind: Any, value: Any) -> str:
    """What is wrong with a value, as `got 7, expected int 0 5`; empty if nothing is.

    A kind is `bool`, `str`, `int` or `double` with optional lowest and highest value, `list` with an optional length,
    `footprint`, or the list of the strings that are allowed.
    """
    return "" if _fits(kind, value) else f"got {value!r}, expected {kind}"


def _fits(kind: Any, value: Any) -> bool:
    if isinstance(kind, list):
        return value in kind
    name, *bounds = kind.split()
    if name in ("bool", "str"):
        return isinstance(value, bool if name == "bool" else str)
    if name in ("list", "footprint"):
        return isinstance(value, list) and bounds in ([], [str(len(value))])
    if (
        isinstance(value, bool)
        or not isinstance(value, (int, float))
        or (name == "int" and value != int(value))
    ):
        return False
    low, high = (*map(float, bounds), *(float("-inf"), float("inf"))[len(bounds) :])
    return low <= value <= high


def faults(node: Table, given: Mapping[str, Any]) -> List[str]:
    """What the real node does not know or take of its private parameters: a line for each; empty if all is well.

    Args:
        node: its table.
        given: its private namespace, namespaces as mappings, as rospy.get_param("~") returns it.
    """
    found = _faults("~", node.rows, given)
    for key, struct in node.rows.get("structs", {}).items():
        for index, item in enumerate(given.get(key, [])):
            found += [f"~{key}[{index}]: {line}" for line in _struct_faults(struct, item)]
    return found


def _struct_faults(struct: Mapping[str, Any], item: Any) -> List[str]:
    if not isinstance(item, dict) or set(item) != set(struct):
        return [f"got {item!r}, expected the keys {', '.join(struct)}"]
    named = {key: fault_of(kind, item[key]) for key, kind in struct.items()}
    return [f"{key}: {fault}" for key, fault in named.items() if fault]


def _faults(place: str, rows: Mapping[str, Any], given: Mapping[str, Any]) -> List[str]:
    spaces, found = _spaces(rows, given), []
    for name, value in given.items():
        if name in spaces:
            group = spaces[name]
            if group not in GROUPS:
                found.append(f"{place}{name}: no table has plugin {group}")
            elif not isinstance(value, dict):
                found.append(f"{place}{name}: got {value!r}, expected a namespace")
            else:
                found += _faults(f"{place}{name}/", GROUPS[group], value)
            continue
        kind = _kind(rows.get("parameters", {}), name)
        if kind is None:
            found.append(f"{place}{name} is unknown to the real node")
        elif fault_of(kind, value):
            found.append(f"{place}{name}: {fault_of(kind, value)}")
    return found


def _kind(parameters: Mapping[str, Any], name: str) -> Any:
    return parameters.get(name, parameters.get(re.sub(r"^([a-z]+)\d+", r"\1N", name)))


def _spaces(rows: Mapping[str, Any], given: Mapping[str, Any]) -> Dict[str, str]:
    """Namespaces below a node or group, and the group of each."""
    spaces = dict(rows.get("spaces", {}))
    for key, default in rows.get("chosen", {}).items():
        chosen = given.get(key, default)
        spaces[chosen.rsplit("/", 1)[-1]] = chosen
    for key in rows.get("listed", []):
        spaces.update({item["name"]: item["type"] for item in given.get(key, [])})
    for key, group in rows.get("words", {}).items():
        spaces.update({name: group for name in given.get(key, "").split()})
    return spaces


def plugins_of(node: Table, given: Mapping[str, Any]) -> Set[str]:
    """Types of all plugins that a node loads with these private parameters."""
    return {group for group in _plugins(node.rows, given) if is_plugin(group)}


def _plugins(rows: Mapping[str, Any], given: Mapping[str, Any]) -> Set[str]:
    spaces = _spaces(rows, given)
    found = set(spaces.values())
    for name, group in spaces.items():
        if group in GROUPS and isinstance(given.get(name), dict):
            found |= _plugins(GROUPS[group], given[name])
    return found


def install(folder: Path) -> None:
    """Make all packages in a folder, with empty programs as nodes."""
    for package in PACKAGES:
        (folder / package).mkdir(parents=True)
        text = f"<package format='2'><name>{package}</name><version>1.0.0</version></package>"
        (folder / package / "package.xml").write_text(text)
        for node in nodes_of(package):
            path = folder / package / node
            path.write_text("#!/bin/sh\n")
            path.chmod(0o755)
