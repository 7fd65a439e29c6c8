"""What a frame becomes on the topics."""

import math

import pytest
from genpy import Time
from hypothesis import given, settings
from hypothesis import strategies as st

from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from mrl_driver.robot.odometry import Twist, Wheels
from mrl_driver.robot.robot_state import Telemetry
from ros1_bridge.node.robot_parameters import check
from ros1_bridge.topics import messages
from ros1_bridge.topics.publishers import Publishers

from .fake_topics import Topics

MODEL = models.load("traxbot")
WHEEL_RADIUS_M = 0.039
COUNTS_A_TURN = 2796.8
STAMP = Time(5, 0)


def published(*heard, fresh=(), yaw_rad=0.0, twist=Twist(0.0, 0.0), counts=Wheels(0, 0)):  # noqa: B008
    """Topics after one frame."""
    topics = Topics(*heard)
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), MODEL, clock=lambda: 100.0)
    out.sonars(STAMP)
    ranges = {"front": 1.5, "left": 2.5, "right": 3.5}
    out.telemetry(Telemetry(50.0, 50.0, Pose(1.0, 2.0, yaw_rad), twist, ranges, fresh, counts, 1))
    return topics


class Clocks:
    """Wall clock and monotonic clock of a thread that pauses for `pause_s` between two readings."""

    def __init__(self):
        self.now_s, self.wall_ahead_s, self.pause_s = 50.0, 1000.0, 0.0

    def wall(self):
        wall_s = self.now_s + self.wall_ahead_s
        self.now_s, self.pause_s = self.now_s + self.pause_s, 0.0
        return wall_s

    def monotonic(self):
        return self.now_s


def stamps(*changes, **given):
    """Stamps of frames 0.02 s apart [s]; before each frame but the first, the clocks are set as `changes` say."""
    topics, clocks = Topics("odom"), Clocks()
    parameters = check({"port": "p"}, "node")
    out = Publishers(topics, OSError, parameters, MODEL, clocks.wall, clocks.monotonic, **given)
    for number, change in enumerate(({}, *changes)):
        vars(clocks).update(change)
        stamp_s = 50.0 + 0.02 * number
        out.telemetry(
            Telemetry(stamp_s, stamp_s, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), {}, (), Wheels(0, 0), number)
        )
    return [message.header.stamp.to_sec() for message in topics["odom"].sent]


def test_a_pause_between_the_readings_of_the_clocks_leaves_the_stamp():
    assert stamps({"pause_s": 2.0}) == pytest.approx([1050.0, 1050.02], abs=1e-6)


def test_stamps_increase_though_the_clock_goes_back_a_little():
    first, second, third = stamps({"wall_ahead_s": 999.5}, {})
    assert first < second < third < first + 1e-4


def test_the_difference_of_the_clocks_is_noted_when_it_changes():
    """A recording then gives the same stamps.  A step below the tolerance, or a pause, is no change."""
    noted = []
    made = stamps(
        {"wall_ahead_s": 1000.00005}, {"pause_s": 2.0}, {"wall_ahead_s": 1001.0}, note_clock=noted.append
    )
    assert noted == [1000.0, 1001.0]
    assert made == pytest.approx([1050.0, 1050.02, 1050.04, 1051.06], abs=1e-6)


@settings(max_examples=50)
@given(st.lists(st.floats(0, 0.9), min_size=1), st.sampled_from([1000.0, -50.0]))
def test_stamps_increase_whatever_the_jitter(earlier, wall_ahead_s):
    """Below a second; also in simulated time that stands at its start."""
    topics, clocks = Topics("odom"), Clocks()
    clocks.wall_ahead_s = wall_ahead_s
    out = Publishers(topics, OSError, check({"port": "p"}, "node"), MODEL, clocks.wall, clocks.monotonic)
    for each in earlier:
        out.telemetry(
            Telemetry(50 - each, 50 - each, Pose(0.0, 0.0, 0.0), Twist(0.0, 0.0), {}, (), Wheels(0, 0), 1)
        )
    made = [message.header.stamp for message in topics["odom"].sent]
    assert all(before < after for before, after in zip(made, made[1:]))


def test_stamps_follow_a_clock_that_is_set_back():
    assert stamps({"wall_ahead_s": 900.0}) == pytest.approx([1050.0, 950.02], abs=1e-6)


def test_wheels_turn_as_fast_as_the_robot_moves():
    """Straight ahead each by the speed over its radius."""
    (joints,) = published("joint_states", twist=Twist(0.2, 0.0))["joint_states"].sent
    assert joints.velocity == pytest.approx([0.2 / WHEEL_RADIUS_M] * 2, rel=2e-3)


def test_wheels_turn_by_their_counts():
    counts = Wheels(round(COUNTS_A_TURN), -round(COUNTS_A_TURN / 2))
    (joints,) = published("joint_states", counts=counts)["joint_states"].sent
    assert joints.position == pytest.approx([2 * math.pi, -math.pi], rel=2e-3)


@pytest.mark.parametrize("yaw_rad", [math.pi / 2, -1.0])
@pytest.mark.parametrize("topic", ["odom", "/tf"])
def test_orientation_is_the_yaw(topic, yaw_rad):
    (message,) = published(topic, yaw_rad=yaw_rad)[topic].sent
    turn = message.pose.pose.orientation if topic == "odom" else message.transforms[0].transform.rotation
    assert 2 * math.atan2(turn.z, turn.w) == pytest.approx(yaw_rad)


def test_new_range_is_published_though_nobody_hears_the_joints():
    topics = published("sonar/front", fresh=("front",))
    assert [message.range for message in topics["sonar/front"].sent] == [1.5]


def test_range_that_is_not_new_is_not_published_again():
    assert published("sonar/front", "sonar/left", fresh=("left",))["sonar/front"].sent == []


@pytest.mark.parametrize("volts, present", [(0.0, False), (0.99, False), (1.0, True), (12.0, True)])
def test_battery_is_present_when_motor_power_is_on(volts, present):
    assert messages.battery_state("base_link", STAMP, volts, MODEL.battery).present is present
