"""`mirror_node`: a real robot among virtual ones.

One node serves most tests.  The robot and the virtual one stand 1 m apart, nose to tail, and the messages of the tests
are those of the robot's driver.
"""

import math
import os

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Point, PoseWithCovarianceStamped, Quaternion
from geometry_msgs.msg import Pose as RosPose
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan, Range
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

from mrl_driver.geometry import Pose
from mrl_driver.robot.models import SonarMount, load
from mrl_driver.safety.free_distance import Scan
from ros1_bridge.topics.messages import mounts_of
from ros1_bridge.world.mirror_node import Place, arc_of
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.world.shared_robots import SharedRegistry
from tests.waiting import wait_until

MODEL = load("traxbot")
BODY = footprint_for(MODEL)
AWAY_M = 1.0
GAP_M = AWAY_M - BODY.length_m / 2 - MODEL.sonars["front"].x_m
"""From the front sonar to the tail of the virtual robot."""


class Driver:
    """The driver of the real robot, as far as the node sees it."""

    def __init__(self, rig):
        self._rig = rig
        self.base = f"{rig.name}/base_link"
        self._odom = rig.publisher("odom", Odometry)
        self._ranges = {name: rig.publisher(f"sonar/{name}", Range) for name in MODEL.sonars}
        self._timer = None
        self.odom_late_s = 0.0
        self._heard = {name: rig.topic(f"mirror/sonar/{name}", Range) for name in MODEL.sonars}
        self.heard = self._heard["front"]
        self.scans = rig.topic("mirror/scan", LaserScan)
        self.status = rig.topic("mirror/status", DiagnosticStatus)
        for topic in (*self._heard.values(), self.scans):
            topic.wait_for_publisher()

    def begin(self):
        """Publishes odometry, all the time."""
        self._timer = rospy.Timer(rospy.Duration(0.05), self._publish)

    def _publish(self, _):
        message = Odometry(child_frame_id=self.base)
        message.header.frame_id = f"{self._rig.name}/odom"
        message.header.stamp = rospy.Time.now() - rospy.Duration(self.odom_late_s)
        message.pose.pose.orientation.w = 1.0
        self._odom.publish(message)

    def end(self):
        """The odometry falls silent."""
        if self._timer is not None:
            self._timer.shutdown()
            self._timer.join()
            self._timer = None

    def hear(self, range_m, name="front", late_s=0.0):
        """What the node makes of a range of the real sonar; again if a busy machine held up the odometry."""

        def answer():
            heard = self._answer(range_m, name, late_s)
            return heard if not math.isnan(heard.range) or self._may_be_invalid(range_m, late_s) else None

        return wait_until(answer)

    def _may_be_invalid(self, range_m, late_s):
        return math.isnan(range_m) or self._timer is None or self.odom_late_s or late_s

    def _answer(self, range_m, name, late_s):
        message = Range(radiation_type=Range.ULTRASOUND, field_of_view=0.63, min_range=0.15, max_range=6.45)
        message.header.frame_id = f"{self._rig.name}/sonar_{name}"
        message.header.stamp = rospy.Time.now() - rospy.Duration(late_s)
        message.range = range_m
        self._ranges[name].publish(message)
        stamp = message.header.stamp
        return wait_until(
            lambda: next((m for m in self._heard[name].messages if m.header.stamp == stamp), None)
        )

    def said(self, *begins):
        """Waits until the status begins like one of these."""
        wait_until(lambda: self.status.messages[-1:] and self.status.messages[-1].message.startswith(begins))


def mirror(rig, name, *options):
    """Starts the node; its robot begins at (0, 0)."""
    return rig.program("mirror_node", f"_world_name:={name}", "_margin:=0", *options)


@pytest.fixture(scope="module")
def lab():
    """A shared world with a virtual robot ahead of the real one."""
    name = f"mirror_{os.getpid()}"
    registry = SharedRegistry(name)
    registry.place("virtual", Pose(AWAY_M, 0.0, 0.0), BODY)
    registry.name = name
    yield registry
    registry.close()


@pytest.fixture(scope="module")
def driver(module_rig, lab):
    """The driver of a robot whose node runs, with its mounts on tf."""
    mirror(module_rig, lab.name)
    made = Driver(module_rig)
    mounts = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    mounts.publish(TFMessage(mounts_of(made.base, MODEL.sonars, rospy.Time.now())))
    made.begin()
    try:
        for name in MODEL.sonars:
            made.hear(3.0, name)
        yield made
    finally:
        made.end()
        mounts.unregister()


@pytest.mark.parametrize(
    "real_m, heard_m", [(3.0, GAP_M), (0.3, 0.3), (math.nan, math.nan), (-math.inf, -math.inf)]
)
def test_range_is_that_of_the_virtual_robot_if_it_is_nearer_than_a_valid_one(driver, real_m, heard_m):
    assert driver.hear(real_m).range == pytest.approx(heard_m, abs=0.01, nan_ok=True)


def test_range_that_arrives_late_or_not_at_all_is_invalid(driver):
    assert math.isnan(driver.hear(3.0, late_s=10.0).range)
    assert driver.hear(3.0).range < math.inf
    begin = len(driver.heard.messages)
    assert math.isnan(driver.heard.wait(begin + 1)[begin].range), "silent"


def test_wall_of_the_virtual_room_is_not_heard(driver, lab):
    lab.place("virtual", Pose(AWAY_M, 9.0, 0.0), BODY)
    heard = driver.hear(math.inf).range
    lab.place("virtual", Pose(AWAY_M, 0.0, 0.0), BODY)
    assert heard == math.inf


def test_scan_for_the_zones_has_the_virtual_robot_where_the_sonars_look(driver):
    begin = len(driver.scans.messages)
    scan = wait_until(lambda: driver.scans.messages[begin + 1 :])[0]
    ahead = scan.ranges[round(-scan.angle_min / scan.angle_increment)]
    assert scan.header.frame_id == driver.base and ahead == pytest.approx(
        AWAY_M - BODY.length_m / 2, abs=0.01
    )
    rays = scan.ranges, scan.angle_min, scan.angle_increment
    seen = Scan(*rays, scan.range_min, Pose(0.0, 0.0, 0.0), scan.range_max)
    assert seen.gaps() == []
    assert seen.looks((1.0, 0.0)) and not seen.looks((-1.0, 0.0))


@pytest.mark.parametrize("late_s", [0.0, 10.0], ids=["silent", "late"])
def test_odometry_that_arrives_late_is_as_none(driver, lab, late_s):
    """The robot stays in the world, and hears nothing."""
    driver.odom_late_s = late_s
    if not late_s:
        driver.end()
    wait_until(lambda: math.isnan(driver.hear(3.0).range), what="a range that is invalid")
    driver.status.wait_for_more(1)
    before = len(driver.scans.messages)
    driver.status.wait_for_more(2)
    scans, there = driver.scans.messages[before:], [mover.name for mover in lab.others("virtual")]
    driver.odom_late_s = 0.0
    if not late_s:
        driver.begin()
    driver.said("ok", "no range")
    assert there == ["real"] and not scans


def test_robot_is_in_the_world_only_when_it_is_localised(rig, lab):
    mirror(rig, lab.name, "_name:=lost", "_localisation:=pose", "_map_frame:=hall")
    driver, place = Driver(rig), rig.publisher("amcl_pose", PoseWithCovarianceStamped)
    driver.begin()
    try:
        driver.said("not localised")
        before = [mover.name for mover in lab.others("virtual")]
        message = PoseWithCovarianceStamped(header=Header(frame_id="hall", stamp=rospy.Time.now()))
        message.pose.pose = RosPose(Point(3.0, 4.0, 0.0), Quaternion(w=1.0))
        place.publish(message)
        driver.said("ok")
    finally:
        driver.end()
    wait_until(lambda: [mover for mover in lab.others("virtual") if mover.name == "lost"], step_s=0.05)
    (lost,) = [mover for mover in lab.others("virtual") if mover.name == "lost"]
    assert "lost" not in before and lost.pose == pytest.approx((3.0, 4.0, 0.0))


def test_another_publisher_of_the_scan_makes_everything_invalid(rig, lab):
    """As a laser whose user forgot laser:=true: zones would get both scans by turns."""
    mirror(rig, lab.name, "_name:=beside", "_pose:=0,-9,0")  # out of earshot of the robot of the other tests
    driver = Driver(rig)
    laser = rospy.Publisher(f"{rig.ns}/mirror/scan", LaserScan, queue_size=1, latch=True)
    laser.publish(LaserScan())  # for a node that connects later, too
    try:
        driver.said(f"{rospy.get_name()} publishes {rig.ns}/mirror/scan too")
    finally:
        laser.unregister()


@pytest.mark.parametrize(
    "yaws_deg, arc_deg",
    [((0, 45, -45), (-63, 63)), ((0, 90, -90), (-18, 18)), ((180, 10), (-8, 28)), ((45, -50), (27, 63))],
)
def test_scan_is_free_only_where_sonars_leave_no_gap(yaws_deg, arc_deg):
    sonars = [SonarMount(0.0, 0.0, yaw_deg) for yaw_deg in yaws_deg]
    assert arc_of(sonars) == pytest.approx([math.radians(deg) for deg in arc_deg])


def test_frame_of_a_refused_pose_is_quoted_in_one_short_line():
    message = PoseWithCovarianceStamped()
    message.header.frame_id = "\x1b[2J\n[ERROR] " * 100
    with pytest.raises(ValueError) as refused:
        Place("amcl_pose", "map", Pose(0.0, 0.0, 0.0), None).localised(message)
    assert str(refused.value).isprintable() and len(str(refused.value)) < 150
