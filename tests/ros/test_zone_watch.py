"""What the zones of a node are told."""

import math
from types import SimpleNamespace

import pytest
from genpy import Time
from geometry_msgs.msg import Quaternion, Transform, Vector3
from sensor_msgs.msg import LaserScan

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.robot import models
from mrl_driver.robot.odometry import Twist
from mrl_driver.safety.protective_zones import STALE_S
from ros1_bridge.control.zone_feed import ZoneWatch, assumed_twist, mount_of
from ros1_bridge.node.robot_parameters import check

MODEL = models.load("traxbot")


def watch(model=MODEL, build_assumed=False, **given):
    given = check({"port": "/dev/x", "zones": "sonars", **given}, "/n")
    return ZoneWatch(given, model, build_assumed)


def frame(stamp_s, speed_m_s, front_m=None):
    fresh = () if front_m is None else ("front", "left", "right")
    ranges = {"front": front_m, "left": 3.0, "right": 3.0}
    return SimpleNamespace(
        stamp_s=stamp_s, arrival_s=stamp_s, twist=(speed_m_s, 0.0), ranges=ranges, fresh=fresh
    )


def test_braking_is_the_models_acceleration_unless_given():
    assert watch().zones.settings.braking_m_s2 == MODEL.limits.linear_acceleration_m_s2
    assert watch(zone_braking=0.7).zones.settings.braking_m_s2 == 0.7


def test_way_and_ranges_come_from_the_telemetry():
    made = watch()
    made.on_telemetry(frame(10.0, 0.0, 0.5), standing=True)
    assert made.zones.protective_clear and not made.zones.warning_clear
    for step in range(1, 21):
        made.on_telemetry(frame(10.0 + step / 50, 1.0), standing=True)
    assert made.zones.limit(0.1, 10.4) == 0


def test_a_board_without_sonars_or_whose_build_nobody_named_needs_a_laser():
    """Voltages of gas sensors would look like ranges, and the zones would be clear in front of a wall."""
    without = MODEL._replace(sonars={})
    with pytest.raises(ConfigError, match="this board has no sonars, expected scan or none"):
        watch(without)
    watch(without, zones="scan")
    with pytest.raises(ConfigError, match="set parameter build to sonar or environment"):
        watch(build_assumed=True)
    watch(build_assumed=True, zones="scan")


def test_a_laser_lies_flat_and_upright():
    assert mount_of(Transform(Vector3(0.1, 0.02, 0.3), Quaternion(0, 0, 1, 0))) == pytest.approx(
        (0.1, 0.02, 3.14159), abs=1e-5
    )
    with pytest.raises(ValueError, match="upside down"):
        mount_of(Transform(Vector3(), Quaternion(1, 0, 0, 0)))


MOUNT, CLOCK_S = Pose(0.1, 0.0, 0.0), 1700000000.0


def scan_of(stamp_s, range_m=math.inf, range_max=0.0):
    """A scan on which nothing is ahead."""
    scan = LaserScan(angle_min=-0.5, angle_increment=0.1, range_min=0.05, ranges=[range_m] * 11)
    scan.range_max = range_max
    scan.header.stamp = Time.from_sec(stamp_s)
    return scan


@pytest.mark.parametrize(
    "stamp_of",
    [lambda now: now - 10.0, lambda now: now + 10.0, lambda now: CLOCK_S + 2.0, lambda now: 0.0],
    ids=["old", "of the future", "repeated", "zero"],
)
def test_zones_stop_if_scans_arrive_that_are_not_of_now(stamp_of):
    """As if the laser were silent, however often they arrive."""
    made, stands_s = watch(zones="scan"), []
    for now in (0.1 * step for step in range(50)):
        stamp_s = CLOCK_S + now if now < 2.0 else stamp_of(CLOCK_S + now)
        made.on_scan(scan_of(stamp_s), MOUNT, CLOCK_S + now, now)
        if made.zones.limit(0.3, now) == 0:
            stands_s.append(now)
    assert 1.9 + STALE_S < stands_s[0] < 2.2 + STALE_S and len(stands_s) == 50 - round(10 * stands_s[0])


@pytest.mark.parametrize(
    ("range_m", "range_max", "inf_is_free", "allowed_m_s"),
    [
        (math.inf, 4.0, False, 0.1),
        (math.inf, 4.0, True, 0.3),
        (5.0, 4.0, False, 0.1),
        (5.0, 0.0, False, 0.3),
        (4.0, 4.0, False, 0.3),
    ],
)
def test_a_scan_is_free_as_far_as_its_laser_sees(range_m, range_max, inf_is_free, allowed_m_s):
    """And at +Inf only if the parameter says so; a driver may leave out `range_max`."""
    made = watch(zones="scan", zone_inf_is_free=inf_is_free)
    made.on_scan(scan_of(CLOCK_S, range_m, range_max), MOUNT, CLOCK_S, 0.0)
    assert made.zones.limit(0.3, 0.0) == allowed_m_s


@pytest.mark.parametrize(("command", "speeds"), [(Twist(0.2, 0.1), (0.2, 0.1)), (None, (0.0, 0.0))])
def test_the_command_counts_as_the_motion_where_nothing_measures_it(command, speeds):
    driver = SimpleNamespace(model=SimpleNamespace(has_odometry=False), command=command)
    assert assumed_twist(driver, SimpleNamespace(twist=Twist(math.nan, math.nan))) == speeds
