"""Layouts of plots for bags and MCAP files: each value is a field of a message on a topic of the node."""

import json
import re
import xml.etree.ElementTree
from pathlib import Path

import pytest
from roslib.message import get_message_class

ROOT = Path(__file__).parents[2]
LAYOUTS = ROOT / "docs" / "layouts"
README = (ROOT / "ros1_bridge" / "README.md").read_text()
TOPICS = dict(re.findall(r"^\| `([\w/]+)` \| (\w+/\w+) \|", README, re.MULTILINE))


def kind_of(path):
    """The type of `/topic/field/field`; an error if there is none."""
    topic = next(topic for topic in TOPICS if path.startswith(f"/{topic}/"))
    kind = TOPICS[topic]
    for field in path[len(topic) + 2 :].split("/"):
        message = get_message_class(kind)
        kind = dict(zip(message.__slots__, message._slot_types))[field]
    return kind


def shown_by_plotjuggler():
    for curve in xml.etree.ElementTree.parse(LAYOUTS / "plotjuggler_bag.xml").iter("curve"):
        yield from (
            [curve.get("curve_x"), curve.get("curve_y")] if curve.get("curve_x") else [curve.get("name")]
        )


FOXGLOVE = json.loads((LAYOUTS / "foxglove.json").read_text())


def shown_by_foxglove():
    for config in FOXGLOVE["configById"].values():
        for series in [*config.get("paths", ()), *filter(None, [config.get("xAxisPath")])]:
            yield series["value"].replace(".", "/")


@pytest.mark.parametrize("shown", [shown_by_plotjuggler, shown_by_foxglove])
def test_each_value_is_a_number_of_a_message(shown):
    kinds = {path: kind_of(path) for path in shown()}
    assert len(kinds) > 8 and set(kinds.values()) <= {"float32", "float64"}, kinds
