"""The tables of the bridge's README are what the running node offers."""

import re

import pytest
import rosgraph
import rospy
import rosservice
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from tf2_msgs.msg import TFMessage

from ros1_bridge.parameters import ROWS
from ros1_bridge.processes import wait_until

from .rig import ROOT, START_S

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


class Offered:
    """What a node offers, with the rig's namespace taken off."""

    def __init__(self, rig):
        self._ns, self._name = rig.ns, f"{rig.ns}/robot_node"
        self._master = rosgraph.Master("/tests")

    def _of_node(self, index):
        return [name for name, nodes in self._master.getSystemState()[index] if self._name in nodes]

    def topics(self, index):
        names = [name for name in self._of_node(index) if name not in SHARED]
        types = dict(self._master.getTopicTypes())  # asked later, so that it knows each of the names
        return {name.replace(f"{self._ns}/", ""): types[name] for name in names}

    def services(self):
        names = [name for name in self._of_node(2) if not LOGGERS.match(name)]
        return {name.replace(f"{self._ns}/", ""): rosservice.get_service_type(name) for name in names}


@pytest.fixture(scope="module")
def offered(module_rig):
    rig = module_rig
    rig.node(rig.board().port, "_allow_calibration:=true", "_allow_gains:=true")
    rig.tf, rig.static = rig.topic("/tf", TFMessage), rig.topic("/tf_static", TFMessage)
    rig.topic("odom", Odometry).wait()
    rospy.wait_for_service(f"{rig.ns}/robot_node/gains/set_parameters", START_S)
    made = Offered(rig)
    made.rig = rig
    assert wait_until(lambda: "/diagnostics" in made.topics(0), START_S)
    return made


def test_published_topics_are_those_of_the_table(offered):
    assert offered.topics(0) == first_two(table("### Published topics", "topic"))


def test_subscribed_topics_are_those_of_the_table(offered):
    assert offered.topics(1) == first_two(table("### Subscribed topics", "topic"))


def test_services_are_those_of_the_table(offered):
    assert offered.services() == first_two(table("### Services", "service"))


def test_frames_are_those_of_the_table(offered):
    rig, wanted = offered.rig, first_two(table("### Frames", "frame"))

    def seen():
        every = [t for topic in (rig.tf, rig.static) for m in topic.messages for t in m.transforms]
        own = [t for t in every if t.child_frame_id.startswith(f"{rig.name}/")]
        return {t.child_frame_id.split("/")[1]: t.header.frame_id.split("/")[1] for t in own}

    assert wait_until(lambda: seen() == wanted, START_S), seen()


def test_environment_topics_are_those_of_the_table(rig):
    rig.node(rig.board("--environment", "--robot", "traxbot").port)
    rig.topic("compass", Imu).wait()
    rospy.wait_for_service(f"{rig.ns}/robot_node/limits/set_parameters", START_S)
    wanted = first_two(table("in place of the sonars", "topic"))
    topics = Offered(rig).topics(0)
    assert wanted.items() <= topics.items()
    assert not any(name.startswith("sonar/") for name in topics)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_parameter_is_in_the_table(row):
    cells = next(cells for cells in table("### Parameters", "parameter") if cells[0] == f"~{row.name}")
    if row.kind is bool:
        default, allowed = str(row.default).lower(), "true, false"
    elif row.kind is float:
        default, allowed = f"{row.default:g}", f"{row.low:g} to {row.high:g}"
    else:
        default = "none: must be given" if row.default is None else str(row.default)
        allowed = ", ".join(map(str, row.choices)) or "text"
    assert cells[1:] == [default, allowed, row.unit, row.text]


def test_table_has_no_other_parameters():
    assert [cells[0] for cells in table("### Parameters", "parameter")] == [f"~{row.name}" for row in ROWS]


def test_launch_files_are_those_of_the_table():
    named = re.findall(r"`(\w+\.launch)`", README.split("## Launch files")[1].split("## Node")[0])
    assert sorted(named) == sorted(path.name for path in (ROOT / "ros1_bridge" / "launch").glob("*.launch"))
