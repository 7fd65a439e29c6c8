"""The transform from map to odom, and the laser's place on the robot."""

import math
from types import SimpleNamespace

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, TransformStamped
from hypothesis import given
from hypothesis import strategies as st

from mrl_driver.geometry import Pose, quaternion_of
from ros1_bridge.control.zone_feed import MountFinder
from ros1_bridge.node.plane_poses import correction
from tests.waiting import wait_until

from .tables import Offered


@given(*[st.builds(Pose, st.floats(-5, 5), st.floats(-5, 5), st.floats(-3, 3))] * 2)
def test_correction_puts_odometry_at_its_place(place, odometry):
    placed = correction(place, odometry).compose(*odometry)
    assert placed[:2] == pytest.approx(place[:2], abs=1e-9)
    assert math.remainder(placed[2] - place[2], math.tau) == pytest.approx(0, abs=1e-9)


def test_transform_can_be_looked_up_at_the_time_of_the_next_scan(rig):
    """At first both frames agree; then the robot is where the mapper says it is, until the mapper falls silent."""
    map_frame, odom, base = (f"{rig.name}/{name}" for name in ("map", "odom", "base_link"))
    frames = (f"_map_frame:={map_frame}", f"_odom_frame:={odom}", f"_base_frame:={base}")
    child = rig.program("map_to_odom", *frames)
    buffer = tf2_ros.Buffer()
    listener = tf2_ros.TransformListener(buffer)
    robot = tf2_ros.TransformBroadcaster()

    def refused():
        return any("is 12.00 m and 0 deg from where" in line for line in child.output())

    def drive():
        """The robot is at 1, 0 by odometry, now."""
        step = TransformStamped(child_frame_id=base)
        step.header.frame_id, step.header.stamp = odom, rospy.Time.now()
        step.transform.translation.x, step.transform.rotation.w = 1.0, 1.0
        robot.sendTransform(step)
        return step.header.stamp

    def place():
        """Where it is in the map at the newest time of its odometry, without waiting for a newer transform."""
        drive()
        if not buffer.can_transform(odom, base, rospy.Time()):
            return None
        stamp = buffer.get_latest_common_time(odom, base)
        if not buffer.can_transform(map_frame, base, stamp):
            return None
        at = buffer.lookup_transform(map_frame, base, stamp).transform.translation
        return pytest.approx((at.x, at.y), abs=1e-6)

    wait_until(lambda: place() == (1.0, 0.0), step_s=0.02)
    poses = rig.publisher("slam_out_pose", PoseStamped)

    def is_placed(x_m=2.0):
        pose = PoseStamped()
        pose.header.frame_id, pose.header.stamp = map_frame, drive()
        pose.pose.position.x, pose.pose.position.y = x_m, 3.0
        pose.pose.orientation.z, pose.pose.orientation.w = quaternion_of(1.0)
        poses.publish(pose)
        return place() == (x_m, 3.0)

    wait_until(is_placed, step_s=0.02)
    wait_until(lambda: is_placed(14.0) or refused(), step_s=0.02)
    assert refused() and place() == (2.0, 3.0)  # no motion explains 12 m
    wait_until(lambda: is_placed(14.0), step_s=0.02)  # but no better pose has come for 2 s
    Offered(rig, "map_to_odom").require_topics()

    def was_there():
        """Half a second ago."""
        return buffer.can_transform(map_frame, odom, rospy.Time.now() - rospy.Duration(0.5))

    wait_until(was_there)
    wait_until(lambda: not was_there())  # the mapper is silent
    listener.unregister()


def test_pose_of_the_last_second_that_a_stamp_can_have_is_refused(rig):
    child, poses = rig.program("map_to_odom"), rig.publisher("slam_out_pose", PoseStamped)
    pose = PoseStamped()
    pose.header.stamp, pose.pose.orientation.w = rospy.Time(2**32 - 1), 1.0

    def ends_or_refuses():
        poses.publish(pose)
        refused = any("ahead of this node's clock" in line for line in child.output())
        return refused or child.exit_code is not None

    wait_until(ends_or_refuses, step_s=0.02)
    assert child.exit_code is None


@pytest.fixture
def finder(monkeypatch):
    """A finder on a robot with a laser in front, one behind, which looks back, and one with a place that is none."""
    places = {"front": (0.1, 0.0, 1.0), "rear": (-0.1, 1.0, 0.0), "nan": (math.nan, 0.0, 1.0)}

    def lookup_transform(_base, frame, _time):
        if frame not in places:
            raise tf2_ros.LookupException(f"no {frame}")
        x, turn_z, turn_w = places[frame]
        at, turn = SimpleNamespace(x=x, y=0.0, z=0.0), SimpleNamespace(x=0.0, y=0.0, z=turn_z, w=turn_w)
        return SimpleNamespace(transform=SimpleNamespace(translation=at, rotation=turn))

    buffer = SimpleNamespace(lookup_transform=lookup_transform)
    monkeypatch.setattr(tf2_ros, "Buffer", lambda: buffer)
    monkeypatch.setattr(
        tf2_ros, "TransformListener", lambda _: SimpleNamespace(unregister=lambda: places.pop("front", None))
    )
    return MountFinder("base_link")


def test_place_is_looked_up_once(finder):
    assert finder.mount("front") == finder.mount("front") == (0.1, 0.0, 0.0)


def test_scan_of_a_second_laser_is_not_taken_for_one_of_the_first(finder):
    """Its points would be on the wrong side of the robot."""
    finder.mount("front")
    assert finder.mount("rear") is None
    assert finder.trouble == "it is in frame 'rear', expected 'front' as before: the zones watch one laser"


def test_place_that_is_not_finite_is_none(finder):
    assert finder.mount("nan") is None and "expected finite numbers" in finder.trouble
    assert finder.mount("nowhere") is None and "'nowhere' has no place on the robot" in finder.trouble
    assert finder.mount("front") == (0.1, 0.0, 0.0), "a later place is taken"


@pytest.mark.parametrize("before", ["front", "nowhere"])
def test_frame_of_a_scan_is_quoted_in_one_line(finder, before):
    """tf repeats the whole frame in its error."""
    finder.mount(before)
    finder.mount("\x1b[2J\n[ERROR] " * 1000)
    assert finder.trouble.isprintable() and len(finder.trouble) < 1200
