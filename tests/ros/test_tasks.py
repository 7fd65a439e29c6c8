"""Nodes on emulated boards: zones, the commands `pose` and `shutdown`, parts, locks, and three wheels."""

import math

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Transform,
    TransformStamped,
)
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, LaserScan
from std_msgs.msg import Bool, Header
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from mrl_driver.lock_order import VARIABLE
from mrl_driver.robot.covariance import SIDEWAYS_M2_S2
from ros1_bridge.node.tf_names import OMNI_JOINTS
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


def test_a_node_that_does_all_at_once_takes_its_locks_in_order(rig):
    """Commands, a pose, zones, a change of mode; a wrong order would end its reading thread and with it the node."""
    rig.env = {**rig.env, VARIABLE: "1"}
    node = rig.node(rig.board("--robot", "traxbot", "--pose", "0.3,0,0").port, "_zones:=sonars")
    odom, status = rig.topic("odom", Odometry), rig.topic("status", DiagnosticStatus)
    pose = rig.publisher("pose", PoseStamped)
    odom.wait()
    rig.drive_until(lambda: odom.messages[-1].pose.pose.position.x > 0.02, 0.1)
    goal = Pose(Point(0.2, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))

    def arrived():
        """Repeats the pose: the last `cmd_vel`, on its way yet, may come after it and end its drive."""
        pose.publish(PoseStamped(Header(frame_id=f"{rig.name}/odom"), goal))
        return odom.wait_for_more(10)[-1].pose.pose.position.x > 0.1

    wait_until(arrived)
    assert rospy.ServiceProxy(f"{rig.ns}/manual_mode", SetBool)(True).success
    assert status.wait() and node.exit_code is None
    assert not [line for line in node.output() if "is taken while" in line]


def test_linear_y_drives_it_to_the_left(rig):
    """The model is found by the board's id; pose, speed and wheels tell the slide, and the silence ends it."""
    odom, joints = rig.topic("odom", Odometry), rig.topic("joint_states", JointState)
    rig.node(rig.board("--robot", "omni").port)
    odom.wait()
    rig.drive_until(lambda: odom.messages[-1].pose.pose.position.y > 0.15, 0.0, 0.2)
    message = odom.messages[-1]
    assert abs(message.pose.pose.position.x) < 0.08
    assert max(each.twist.twist.linear.y for each in odom.messages) > 0.15
    assert message.twist.covariance[7] > 10 * SIDEWAYS_M2_S2
    assert joints.wait()[-1].name == list(OMNI_JOINTS)
    assert joints.messages[-1].position[2] < 0 < joints.messages[-1].position[0]
    wait_until(lambda: math.isclose(odom.messages[-1].twist.twist.linear.y, 0.0, abs_tol=1e-9))
