"""Alcohol, dust and heat over the map: what the node `environment_map` draws, through a real master."""

import math

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32, Float32MultiArray, UInt16
from visualization_msgs.msg import Marker, MarkerArray

from mrl_driver.errors import ConfigError
from mrl_driver.view.environment_cells import VARIABLES
from ros1_bridge.world import environment_map_node
from tests.waiting import wait_until

from .tables import Offered


class Survey:
    """A node on a robot whose place in the map the test decides."""

    def __init__(self, rig, *options):
        self.frames = f"{rig.name}/map", f"{rig.name}/base_link"
        names = (f"_{name}_frame:={frame}" for name, frame in zip(("map", "base"), self.frames))
        self.child = rig.program("environment_map", *names, *options)
        self.robot = tf2_ros.TransformBroadcaster()
        self.alcohol = rig.publisher("alcohol", UInt16)
        self.dust = rig.publisher("dust", Float32)
        self.heat = rig.publisher("thermopile", Float32MultiArray)
        self.drawn = rig.topic("environment_map", MarkerArray)

    def at(self, x_m, y_m):
        step = TransformStamped(child_frame_id=self.frames[1])
        step.header.frame_id, step.header.stamp = self.frames[0], rospy.Time.now()
        step.transform.translation.x, step.transform.translation.y = x_m, y_m
        step.transform.rotation.w = 1.0
        self.robot.sendTransform(step)

    def cells(self, name):
        """The middles of the cells of a list, without the legend's square, to the centimetre."""
        if not self.drawn.messages:
            return []
        (marker,) = (each for each in self.drawn.messages[-1].markers if each.ns == name)
        return sorted((round(point.x, 2), round(point.y, 2)) for point in marker.points[:-1])

    def until(self, condition, x_m, y_m, publisher, reading):
        def holds():
            self.at(x_m, y_m)
            publisher.publish(reading)
            return condition()

        wait_until(holds, step_s=0.05)

    def says(self, words):
        return any(words in line for line in self.child.output())


def test_readings_are_cells_where_the_robot_is_and_bad_ones_are_lines(rig):
    survey = Survey(rig, "_cell:=0.3")
    survey.until(
        lambda: survey.cells("alcohol alert") == [(0.55, 0.15)], 0.4, 0.2, survey.alcohol, UInt16(160)
    )
    assert survey.cells("alcohol notice") == []
    survey.until(lambda: (1.05, 0.15) in survey.cells("dust notice"), 1.0, 0.2, survey.dust, Float32(3000.0))
    hot = Float32MultiArray(data=[41.0] * 8)
    survey.until(lambda: (1.85, -0.15) in survey.cells("heat alert"), 2.0, -0.2, survey.heat, hot)
    bad = (
        (
            survey.alcohol,
            UInt16(1023),
            "alcohol: got 1023, expected 1 to 1022 counts; connect or calibrate the sensor alcohol (1 so far)",
        ),
        (survey.dust, Float32(math.nan), "dust: got nan, expected 0 to 1e+06 pcs/l"),
    )
    for publisher, reading, words in bad:
        survey.until(lambda: survey.says(words), 0.4, 0.2, publisher, reading)  # noqa: B023
    late = rig.topic("environment_map", MarkerArray).wait()[-1]
    assert [each for each in late.markers if each.ns == "heat alert legend"][0].text == "heat 39 degC"
    assert len(late.markers) == 13 and {each.action for each in late.markers} == {Marker.ADD}
    wait_until(
        lambda: survey.heat.publish(hot) or survey.says("pose: "), step_s=0.2
    )  # the robot's tf has ended
    Offered(rig, "environment_map").require_topics()


def test_a_clock_that_jumps_back_begins_the_map_again(rig, monkeypatch):
    """As when a bag is played in a loop.  This process has the machine's time; only the node has the bag's."""
    rospy.set_param("/use_sim_time", True)
    try:
        survey = Survey(rig)
    finally:
        rospy.delete_param("/use_sim_time")
    clock = rospy.Publisher("/clock", Clock, queue_size=1)
    now = [1000.0]

    def tick(back_s=None):
        now[0] = back_s or now[0] + 0.1
        clock.publish(Clock(rospy.Time.from_sec(now[0])))
        return rospy.Time.from_sec(now[0])

    monkeypatch.setattr(rospy.Time, "now", staticmethod(tick))
    here, there = [(0.17, 0.1)], [(1.17, 0.1)]  # the right third of a cell
    survey.until(lambda: survey.cells("alcohol alert") == here, 0.1, 0.1, survey.alcohol, UInt16(160))
    tick(500.0)
    survey.until(lambda: survey.cells("alcohol alert") == there, 1.1, 0.1, survey.alcohol, UInt16(160))
    assert survey.says("clock: it jumped back, and the map begins again (1 so far)")
    clock.unregister()


def test_a_wall_clock_that_is_set_back_leaves_the_map(rig, monkeypatch):
    set_ahead = rig.wall_clock(monkeypatch)
    survey = Survey(rig)
    here, there = (0.17, 0.1), (1.17, 0.1)
    survey.until(lambda: survey.cells("alcohol alert") == [here], 0.1, 0.1, survey.alcohol, UInt16(160))
    set_ahead(-3600.0)
    survey.until(lambda: there in survey.cells("alcohol alert"), 1.1, 0.1, survey.alcohol, UInt16(160))
    assert survey.cells("alcohol alert") == [here, there]


@pytest.mark.parametrize("title", [each.title for each in VARIABLES])
def test_thresholds_in_the_wrong_order_are_refused_by_name(title):
    given = {row.name: row.default for row in environment_map_node.PARAMETERS}
    given[f"{title}_notice"] = given[f"{title}_alert"]
    with pytest.raises(
        ConfigError, match=f"^parameter {title}_alert is .*, expected more than {title}_notice, "
    ):
        environment_map_node.variables_of(given)
