"""One node on an emulated board, over real ROS: what its services and topics do on the wire.

`test_node_in_steps` states the rest of the node in simulated time.
"""

import time

import pytest
import roslib.packages
import rospy
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ros1_bridge.node.robot_parameters import PAUSE_S
from ros1_bridge.topics.message_covariance import diagonal
from tests.waiting import wait_until

from .rig import ROOT, START_S, values_of

MOVE, STOP, GAINS = 11, 13, 2
FRAME_HZ = 50


@pytest.fixture(scope="module")
def robot(module_rig):
    """A node whose gains may be set; its rig, the tap on its wire, its topics."""
    rig, module_rig.begun_s = module_rig, time.time()
    rig.wire = rig.tap(rig.board("--robot", "traxbot", "--imu").port)
    rig.odom = rig.topic("odom", Odometry)
    rig.status = rig.topic("status", DiagnosticStatus)
    rig.imu = rig.topic("imu/data", Imu)
    rig.process = rig.node(rig.wire.port, "_allow_gains:=true")
    rig.cmd_vel = rig.publisher("cmd_vel", Twist)
    rig.set_pose = rig.publisher("set_pose", PoseWithCovarianceStamped)
    rig.odom.wait()
    rospy.wait_for_service(f"{rig.ns}/robot_node/gains/set_parameters", START_S)
    return rig


def call(robot, name):
    return rospy.ServiceProxy(f"{robot.ns}/{name}", Trigger)()


def refusals(robot, words):
    """How often the node has said that it refuses commands for this."""
    return sum(f"cmd_vel refused: {words}" in line for line in robot.process.output())


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


def test_a_late_subscriber_gets_the_status_with_a_stamp_and_its_values(robot):
    array, mode = robot.topic("robot_status", DiagnosticArray).wait()[-1], robot.topic("mode", String).wait()
    assert values_of(array.status[0]).keys() == values_of(robot.status.messages[-1]).keys()
    assert robot.begun_s < array.header.stamp.to_sec() < time.time()
    assert mode[-1].data == values_of(array.status[0])["mode"]


def test_diagnostic_aggregator_has_a_group_for_each_report(robot):
    analyzers = yaml.safe_load((ROOT / "ros1_bridge" / "status" / "analyzers.yaml").read_text())
    rospy.set_param(f"{robot.ns}/aggregator", analyzers)
    (program,) = roslib.packages.find_node("diagnostic_aggregator", "aggregator_node")
    robot.start("aggregator", program, "__name:=aggregator", f"__ns:={robot.ns}")
    topic = robot.topic("/diagnostics_agg", DiagnosticArray)

    def grouped():
        names = [each.name for message in topic.messages for each in message.status]
        return {name.split("/")[2] for name in names if f"{robot.name} robot_node: " in name}

    wait_until(
        lambda: {"Link", "Motion", "Battery", "Board", "IMU"} <= grouped(), what="a group for each report"
    )
    assert "Other" not in grouped()


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


def test_gains_go_to_the_board(robot):
    client = Client(f"{robot.ns}/robot_node/gains", timeout=START_S)
    since = time.monotonic()
    client.update_configuration({"kp": 650})
    robot.wire.wait_for(GAINS, since)
    client.close()
