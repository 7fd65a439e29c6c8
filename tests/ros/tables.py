"""The tables of the bridge's README, and what a running node offers."""

import re

import rosgraph
import rosservice

from .rig import ROOT

README = (ROOT / "ros1_bridge" / "README.md").read_text(encoding="utf-8")
SHARED = {"/rosout": "rosgraph_msgs/Log"}
LOGGERS = re.compile(r".*/(get_loggers|set_logger_level)$")


def table(heading, first):
    """Rows of the table under a heading whose first column is `first`, as lists of cells."""
    after = README.split(heading, 1)[1]
    lines = after[after.index(f"| {first} |") :].splitlines()
    rows = []
    for line in lines[2:]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip().strip("`") for cell in line.strip("|").split("|")])
    return rows


def first_two(rows):
    return {row[0]: row[1] for row in rows}


def cells_of(row):
    """A parameter as its table says it: name, default, range, unit, text."""
    if row.kind is bool:
        default, allowed = str(row.default).lower(), "true, false"
    elif row.kind is float:
        default, allowed = f"{row.default:g}", f"{row.low:g} to {row.high:g}"
    else:
        default = "none: must be given" if row.default is None else str(row.default) or "empty"
        allowed = ", ".join(str(each) or "empty" for each in row.choices) or "text"
    return [f"~{row.name}", default, allowed, row.unit, row.text]


class Offered:
    """What a node offers, with the rig's namespace taken off."""

    def __init__(self, rig, node="robot_node"):
        self._ns, self._node, self._name = rig.ns, node, f"{rig.ns}/{node}"
        self._master = rosgraph.Master("/tests")

    def _of_node(self, index):
        return [name for name, nodes in self._master.getSystemState()[index] if self._name in nodes]

    def topics(self, index):
        """Name to type: published (0) or subscribed (1)."""
        names = [name for name in self._of_node(index) if name not in SHARED]
        types = dict(self._master.getTopicTypes())  # asked later, so that it knows each of the names
        return {name.replace(f"{self._ns}/", ""): types[name] for name in names}

    def services(self):
        """Name to type."""
        names = [name for name in self._of_node(2) if not LOGGERS.match(name)]
        return {name.replace(f"{self._ns}/", ""): rosservice.get_service_type(name) for name in names}

    def require_topics(self, *ignored):
        """Require the topics of the node's table, beside those that begin with one of the ignored words."""
        rows = table(f"## Node `{self._node}`", "topic")
        for index, way in enumerate(("out", "in")):
            topics = {name: kind for name, kind in self.topics(index).items() if not name.startswith(ignored)}
            assert topics == first_two([row for row in rows if row[2] == way])
