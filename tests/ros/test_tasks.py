"""Zones, the commands `pose` and `shutdown`, and nodes of some parts, on an emulated board."""

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import (
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
)
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, Header
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

from tests.waiting import wait_until

from .rig import START_S, values_of
from .tables import Offered

WALL_M, PROTECTIVE_M, BODY_M = 0.62, 0.3, 0.225


@pytest.fixture
def robot(rig, tmp_path):
    """A node with zones, half a metre before a wall."""
    world = tmp_path / "wall.yaml"
    world.write_text(f"walls: [[{WALL_M}, -2, {WALL_M}, 2]]\n")
    board = rig.board("--robot", "traxbot", "--world", str(world))
    rig.odom, rig.status = rig.topic("odom", Odometry), rig.topic("status", DiagnosticStatus)
    rig.process = rig.node(board.port, "_zones:=sonars", f"_zone_protective:={PROTECTIVE_M}")
    rig.pose = rig.publisher("pose", PoseStamped)
    rig.odom.wait()
    return rig


def says(robot, since=-1, **wanted):
    """Whether a status says so: the newest, or one since that number."""

    def so(message):
        return (
            wanted.items()
            <= {key.replace(" ", "_"): each for key, each in values_of(message).items()}.items()
        )

    return lambda: any(so(message) for message in robot.status.messages[since:])


def turns_away(robot):
    """Whether a robot that is sent to where it stands, turned to the left, ends there; a busy machine may stop it."""
    here = robot.odom.wait_for_more(2)[-1].pose.pose.position
    turned = PoseStamped(Header(frame_id=f"{robot.name}/odom"), Pose(here, Quaternion(0, 0, 1, 1)))
    before = len(robot.status.messages)

    def has_begun():
        robot.pose.publish(turned)
        robot.odom.wait_for_more(2)
        return says(robot, before, mode="pose")()

    wait_until(has_begun)
    wait_until(says(robot, mode="drive", moving="false"))
    return robot.odom.messages[-1].pose.pose.orientation.z == pytest.approx(0.7, abs=0.1)


def test_a_robot_before_a_wall_stops_turns_away_by_pose_and_ends_by_shutdown(robot):
    field = robot.topic("protective_field_clear", Bool)
    wait_until(says(robot, protective_zone_clear="true"))
    wait_until(lambda: field.messages and field.messages[-1].data)
    held = says(
        robot, stopped_by="protective_zone", protective_zone_clear="false", safety_stop="true", ready="true"
    )
    robot.drive_until(held, 0.3)
    wait_until(lambda: not field.messages[-1].data)
    room_m = WALL_M - BODY_M / 2 - robot.odom.messages[-1].pose.pose.position.x
    assert PROTECTIVE_M - 0.03 < room_m < PROTECTIVE_M + 0.1
    assert sum("protective zone" in line for line in robot.process.output()) == 1, "it is logged once"
    wait_until(lambda: turns_away(robot))
    assert rospy.ServiceProxy(f"{robot.ns}/shutdown", Trigger)().success
    assert robot.process.wait(START_S) and robot.process.exit_code == 0


def test_a_node_does_the_parts_that_are_named(rig):
    rig.node(rig.board().port, "_parts:=[odometry, sensors]")
    rig.topic("odom", Odometry).wait(20)
    offered = Offered(rig)
    assert offered.topics(0).keys() == {"odom", "/tf", "joint_states"}
    assert offered.topics(1).keys() == {"set_pose"}
    assert offered.services().keys() == {"reset_odometry", "shutdown"}


def test_a_laser_watches_the_zones_once_tf_tells_where_it_sits(rig):
    rig.status = rig.topic("status", DiagnosticStatus)
    node = rig.node(rig.board().port, "_zones:=scan", "_publish_mounts:=false")
    out = rig.publisher("scan", LaserScan)
    scan = LaserScan(angle_min=-1.0, angle_max=1.0, angle_increment=0.1, range_min=0.02, range_max=4.0)
    scan.header.frame_id = f"{rig.name}/laser"

    def seen(range_m, late_s=0.0, **wanted):
        def so():
            scan.header.stamp, scan.ranges = rospy.Time.now() - rospy.Duration(late_s), [range_m] * 21
            out.publish(scan)
            return says(rig, **wanted)()

        return wait_until(so)

    rig.status.wait()
    assert seen(3.0, protective_zone_clear="false"), "nobody knows yet where the laser looks"
    mount = TransformStamped(Header(frame_id=f"{rig.name}/base_link"), f"{rig.name}/laser", Transform())
    mount.transform.translation.x, mount.transform.rotation.w = 0.085, 1.0
    static = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
    static.publish(TFMessage([mount]))
    assert seen(3.0, protective_zone_clear="true", outer_warning_zone_clear="true")
    assert seen(1.0, warning_zone_clear="true", outer_warning_zone_clear="false")
    assert seen(0.5, protective_zone_clear="true", warning_zone_clear="false")
    assert seen(0.15, protective_zone_clear="false")
    assert seen(3.0, protective_zone_clear="true")
    assert seen(3.0, late_s=10.0, protective_zone_clear="false")
    wait_until(
        lambda: any("10.00" in line and "s old by this node's clock" in line for line in node.output())
    )
    static.unregister()
