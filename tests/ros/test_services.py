"""The node on an emulated board: services, status, wheels, limits, zones, commands and locks."""

import math
import time

import pytest
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import (
    Point,
    Pose,
    PoseStamped,
    PoseWithCovarianceStamped,
    Quaternion,
    Transform,
    TransformStamped,
    Twist,
)
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu, JointState, LaserScan, Temperature
from std_msgs.msg import Bool, Header, String
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from mrl_driver.lock_order import VARIABLE
from mrl_driver.robot.covariance import SIDEWAYS_M2_S2
from ros1_bridge.node.robot_parameters import PAUSE_S
from ros1_bridge.node.tf_names import OMNI_JOINTS
from ros1_bridge.topics.message_covariance import diagonal
from tests.waiting import wait_until

from .rig import START_S, values_of
from .tables import Offered

MOVE, STOP, CALIBRATE, GAINS = 11, 13, 1, 2
FRAME_HZ = 50


@pytest.fixture(scope="module")
def robot(module_rig):
    """A node with every opt-in; its rig, the tap on its wire, its topics."""
    rig, module_rig.begun_s = module_rig, time.time()
    rig.wire = rig.tap(rig.board("--robot", "traxbot", "--imu").port)
    rig.odom = rig.topic("odom", Odometry)
    rig.status = rig.topic("status", DiagnosticStatus)
    rig.temperature = rig.topic("board_temperature", Temperature)
    rig.diagnostics = rig.topic("/diagnostics", DiagnosticArray)
    rig.moving = rig.topic("moving", Bool)
    rig.imu = rig.topic("imu/data", Imu)
    rig.process = rig.node(rig.wire.port, "_allow_calibration:=true", "_allow_gains:=true")
    rig.cmd_vel = rig.publisher("cmd_vel", Twist)
    rig.set_pose = rig.publisher("set_pose", PoseWithCovarianceStamped)
    rig.odom.wait()
    rospy.wait_for_service(f"{rig.ns}/robot_node/gains/set_parameters", START_S)
    return rig


def call(robot, name, *args):
    kind = SetBool if args else Trigger
    return rospy.ServiceProxy(f"{robot.ns}/{name}", kind)(*args)


def refusals(robot, words):
    """How often the node has said that it refuses commands for this."""
    return sum(f"cmd_vel refused: {words}" in line for line in robot.process.output())


def speeds_since(robot, since):
    """What speeds the board was told [mm/s]."""
    parts = [part for at, data in robot.wire.sent if at >= since for part in data.split(b"@")]
    return [int(part.split(b",")[1]) for part in parts if part.startswith(b"11,")]


def drive_in_vain(robot, words):
    """Command until the node refuses; it must send no motion to the board meanwhile."""
    robot.odom.wait_for_more(2)  # the tap has passed on what the board was sent before
    since, before = time.monotonic(), refusals(robot, words)
    robot.drive_until(lambda: refusals(robot, words) > before)
    assert robot.wire.first(MOVE, since) == float("inf")


def pause(robot):
    """Send nothing for longer than the node asks for after a stop; by odometry."""
    robot.odom.wait_for_more(round(1.2 * PAUSE_S * FRAME_HZ))


def stands(robot):
    def still():
        return all(abs(each.twist.twist.linear.x) < 1e-3 for each in robot.odom.wait_for_more(5))

    robot.cmd_vel.publish(Twist())
    wait_until(still)


def says(robot, **wanted):
    """The newest status says so."""
    values = values_of(robot.status.wait()[-1])
    return all(values[key.replace("_", " ")] == value for key, value in wanted.items())


def status_is(robot, **wanted):
    return wait_until(lambda: says(robot, **wanted))


def test_status_and_a_topic_tell_that_the_robot_moves(robot):
    robot.drive_until(lambda: says(robot, mode="drive", moving="true", stopped_by="none"))
    wait_until(lambda: robot.moving.messages[-1].data)
    stands(robot)
    wait_until(lambda: not robot.moving.messages[-1].data)


def test_a_late_subscriber_gets_the_status_with_a_stamp_and_its_values(robot):
    array, mode = robot.topic("status_array", DiagnosticArray).wait()[-1], robot.topic("mode", String).wait()
    assert values_of(array.status[0]).keys() == values_of(robot.status.messages[-1]).keys()
    assert robot.begun_s < array.header.stamp.to_sec() < time.time()
    assert mode[-1].data == values_of(array.status[0])["mode"]


def test_emergency_stop_holds_until_released(robot):
    robot.drive_until(lambda: says(robot, moving="true"))
    since = time.monotonic()
    assert call(robot, "stop").success
    robot.wire.wait_for(STOP, since)
    assert status_is(robot, mode="emergency_stop", ready="false", stopped_by="emergency_stop")
    drive_in_vain(robot, "the emergency stop is latched")
    assert call(robot, "release_stop").success
    pause(robot)
    since = time.monotonic()
    robot.drive_until(lambda: robot.wire.first(MOVE, since) < float("inf"))
    stands(robot)


def test_disabled_motors_do_not_follow(robot):
    assert call(robot, "enable_motors", False).success
    drive_in_vain(robot, "the motors are disabled")
    assert call(robot, "enable_motors", True).success
    pause(robot)


def test_manual_mode_drives_slowly_and_takes_no_pose(robot):
    pose, told = robot.publisher("pose", PoseStamped), robot.topic("manual_mode", Bool)
    answer = call(robot, "manual_mode", True)
    assert answer.success and "at most 0.15 m/s" in answer.message
    wait_until(lambda: told.wait()[-1].data)
    assert status_is(robot, operation_mode="manual")
    assert rospy.get_param(f"{robot.ns}/robot_node/operation_mode") == "manual"
    since = time.monotonic()
    robot.drive_until(lambda: speeds_since(robot, since).count(150) >= 2, 0.3)
    assert max(speeds_since(robot, since)) == 150
    goal = PoseStamped()
    goal.pose.orientation.w = 1.0
    pose.publish(goal)
    words = "pose refused: the robot is in manual mode"
    wait_until(lambda: any(words in line for line in robot.process.output()))
    assert call(robot, "manual_mode", False).success and status_is(robot, operation_mode="automatic")
    wait_until(lambda: not told.messages[-1].data)
    stands(robot)


def test_reset_sets_the_pose_to_the_origin(robot):
    robot.drive_until(lambda: robot.odom.messages[-1].pose.pose.position.x > 0.02)
    stands(robot)
    assert call(robot, "reset_odometry").success
    wait_until(lambda: abs(robot.odom.messages[-1].pose.pose.position.x) < 1e-6)


def test_reset_is_refused_while_a_node_localises_the_robot(robot):
    localiser = rospy.Subscriber(f"{robot.ns}/initialpose", PoseWithCovarianceStamped, lambda pose: None)
    answer = call(robot, "reset_odometry")
    localiser.unregister()
    assert not answer.success and answer.message.startswith(rospy.get_name())


def test_pose_and_covariance_are_those_that_were_set(robot):
    stands(robot)
    wanted = PoseWithCovarianceStamped()
    wanted.header.frame_id = f"{robot.name}/odom"
    wanted.pose.pose.position.y, wanted.pose.pose.orientation.w = 2.5, 1.0
    wanted.pose.covariance = diagonal((0.04, 0.09, 1.0, 1.0, 1.0, 0.01))
    robot.set_pose.publish(wanted)
    wait_until(lambda: robot.odom.messages[-1].pose.pose.position.y == 2.5)
    assert robot.odom.wait_for_more(2)[-1].pose.covariance[0::35] == (0.04, 0.01)


def test_readings_of_the_imu_have_the_heading_of_the_odometry(robot):
    stands(robot)
    reading, odometry = robot.imu.wait_for_more(3)[-1], robot.odom.messages[-1]
    assert reading.header.frame_id == f"{robot.name}/imu_link"
    assert reading.orientation.z == pytest.approx(odometry.pose.pose.orientation.z, abs=0.01)


def test_limits_change_while_the_node_runs(robot):
    client = Client(f"{robot.ns}/robot_node/limits", timeout=START_S)
    client.update_configuration({"max_linear_speed": 0.05})
    since = time.monotonic()
    robot.drive_until(lambda: speeds_since(robot, since).count(50) >= 2)
    assert max(speeds_since(robot, since)) == 50
    assert client.update_configuration({"max_linear_speed": 5.0})["max_linear_speed"] == 0.3
    client.close()
    stands(robot)


def test_gains_go_to_the_board(robot):
    client = Client(f"{robot.ns}/robot_node/gains", timeout=START_S)
    since = time.monotonic()
    client.update_configuration({"kp": 650})
    robot.wire.wait_for(GAINS, since)
    client.close()


def test_calibration_is_passed_on(robot):
    stands(robot)
    since = time.monotonic()
    answer = call(robot, "calibrate")
    assert answer.success, answer.message
    robot.wire.wait_for(CALIBRATE, since)


def test_diagnostics_cover_all_parts_with_the_keys_of_rep_138(robot):
    for part in ("Link", "Motion", "Battery", "Board", "IMU"):
        wait_until(lambda: robot.diagnosed(robot.diagnostics, part))  # noqa: B023
    link = robot.diagnosed(robot.diagnostics, "Link")
    keys = "Serial Port, Serial Baud, Firmware Version, Protocol Version, Device ID, Computed Latency"
    assert all(link[key] for key in keys.split(", ")) and link["Serial Port"] == robot.wire.port
    assert 0.0 < robot.temperature.wait()[-1].temperature < 80.0


def test_opt_ins_are_off_by_default(rig):
    rig.node(rig.board().port)
    rospy.wait_for_service(f"{rig.ns}/robot_node/limits/set_parameters", START_S)
    offered = Offered(rig).services()
    assert "reset_odometry" in offered and not any("calibrate" in name or "gains" in name for name in offered)


def test_a_node_that_starts_beside_a_localiser_asks_for_the_pose(rig):
    localiser = rospy.Subscriber(f"{rig.ns}/initialpose", PoseWithCovarianceStamped, lambda pose: None)
    node = rig.node(rig.board().port)
    wait_until(lambda: any("odometry begins at 0, 0, 0" in line for line in node.output()))
    localiser.unregister()


def test_a_node_begins_in_the_mode_of_its_parameter(rig):
    """Which the service sets, so that a node that respawns keeps the mode."""
    status = rig.topic("status", DiagnosticStatus)
    rig.node(rig.board().port, "_operation_mode:=manual")
    assert values_of(status.wait()[0])["operation mode"] == "manual"


WALL_M, PROTECTIVE_M, BODY_M = 0.62, 0.3, 0.225


@pytest.fixture
def before_a_wall(rig, tmp_path):
    """A node with zones, half a metre before a wall."""
    world = tmp_path / "wall.yaml"
    world.write_text(f"walls: [[{WALL_M}, -2, {WALL_M}, 2]]\n")
    board = rig.board("--robot", "traxbot", "--world", str(world))
    rig.odom, rig.status = rig.topic("odom", Odometry), rig.topic("status", DiagnosticStatus)
    rig.process = rig.node(board.port, "_zones:=sonars", f"_zone_protective:={PROTECTIVE_M}")
    rig.pose = rig.publisher("pose", PoseStamped)
    rig.odom.wait()
    return rig


def says_status(before_a_wall, since=-1, **wanted):
    """Whether a status says so: the newest, or one since that number."""

    def so(message):
        return (
            wanted.items()
            <= {key.replace(" ", "_"): each for key, each in values_of(message).items()}.items()
        )

    return lambda: any(so(message) for message in before_a_wall.status.messages[since:])


def turns_away(before_a_wall):
    """Whether a robot that is sent to where it stands, turned to the left, ends there; a busy machine may stop it."""
    here = before_a_wall.odom.wait_for_more(2)[-1].pose.pose.position
    turned = PoseStamped(Header(frame_id=f"{before_a_wall.name}/odom"), Pose(here, Quaternion(0, 0, 1, 1)))
    before = len(before_a_wall.status.messages)

    def has_begun():
        before_a_wall.pose.publish(turned)
        before_a_wall.odom.wait_for_more(2)
        return says_status(before_a_wall, before, mode="pose")()

    wait_until(has_begun)
    wait_until(says_status(before_a_wall, mode="drive", moving="false"))
    return before_a_wall.odom.messages[-1].pose.pose.orientation.z == pytest.approx(0.7, abs=0.1)


def test_a_robot_before_a_wall_stops_turns_away_by_pose_and_ends_by_shutdown(before_a_wall):
    field = before_a_wall.topic("protective_field_clear", Bool)
    markers = before_a_wall.topic("markers", MarkerArray)
    wait_until(says_status(before_a_wall, protective_zone_clear="true"))
    wait_until(lambda: field.messages and field.messages[-1].data)
    held = says_status(
        before_a_wall,
        stopped_by="protective_zone",
        protective_zone_clear="false",
        safety_stop="true",
        ready="true",
    )
    before_a_wall.drive_until(held, 0.3)
    wait_until(lambda: not field.messages[-1].data)
    state, *zones = markers.wait_for_more(2)[-1].markers
    assert (state.text, len(zones)) == ("stopped by protective zone", 3)
    assert [zone.ns for zone in zones if zone.color.a == 1.0] == [
        "warning zone",
        "outer warning zone",
        "protective zone",
    ]
    room_m = WALL_M - BODY_M / 2 - before_a_wall.odom.messages[-1].pose.pose.position.x
    assert PROTECTIVE_M - 0.03 < room_m < PROTECTIVE_M + 0.1
    assert sum("protective zone" in line for line in before_a_wall.process.output()) == 1, "it is logged once"
    wait_until(lambda: turns_away(before_a_wall))
    assert rospy.ServiceProxy(f"{before_a_wall.ns}/shutdown", Trigger)().success
    assert before_a_wall.process.wait(START_S) and before_a_wall.process.exit_code == 0


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
            return says_status(rig, **wanted)()

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
