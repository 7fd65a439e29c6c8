"""ROS node `robot_node`: one robot on a serial port.

Publishes `odom`, `sonar/*`, `battery`, /tf, /tf_static and /diagnostics; subscribes `cmd_vel`.  The driver's
reading thread publishes, and a command goes to the port from the subscriber's own thread.
"""

import time
from typing import List, Optional

import diagnostic_updater
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import BatteryState, Range
from tf2_msgs.msg import TFMessage

from mrl_driver.battery import EMPTY, LOW, OFF
from mrl_driver.driver import Driver, Options, Telemetry
from mrl_driver.errors import LinkLost, MrlError
from mrl_driver.handshake import Board
from mrl_driver.robots import RobotModel

from . import link_report, messages
from .direct import direct_publisher
from .parameters import Parameters, check
from .stamps import Stamps

DIAGNOSTICS_S = 1.0
WARN_EVERY_S = 1.0


class Publishers:
    """One prepared message and one publisher for each topic; `/tf` is one of them."""

    def __init__(self, parameters: Parameters, model: RobotModel) -> None:
        odom, base = parameters.odom_frame, parameters.base_frame
        self._model = model
        self._stamps = Stamps()
        self._stamp = rospy.Time()
        self._odometry = messages.new_odometry(odom, base)
        self._odometry_out = direct_publisher(rospy.Publisher, "odom", Odometry)
        self._transform = messages.new_transform(odom, base)
        self._transform_out = None
        if parameters.publish_tf:
            self._transform_out = direct_publisher(rospy.Publisher, "/tf", TFMessage)
        self._ranges = {name: messages.new_range(base, name) for name in model.sonars}
        self._ranges_out = {
            name: direct_publisher(rospy.Publisher, f"sonar/{name}", Range) for name in model.sonars
        }
        self._battery = messages.new_battery(base, model.battery)
        self._battery_out = direct_publisher(rospy.Publisher, "battery", BatteryState, latch=True)
        self._mounts_out = direct_publisher(rospy.Publisher, "/tf_static", TFMessage, latch=True)
        self._mounts_out.publish(messages.new_mounts(base, model.sonars, rospy.Time.now()))

    def telemetry(self, telemetry: Telemetry) -> None:
        """Publish pose and twist, and the sonars that have a new reading."""
        stamp = self._stamp
        stamp_ns = self._stamps.next(telemetry.stamp_s, time.monotonic_ns(), time.time_ns())
        stamp.secs, stamp.nsecs = divmod(stamp_ns, 1_000_000_000)
        messages.fill_odometry(self._odometry, stamp, telemetry.pose, telemetry.twist)
        self._odometry_out.publish(self._odometry)
        if self._transform_out is not None:
            messages.fill_transform(self._transform, stamp, telemetry.pose)
            self._transform_out.publish(self._transform)
        for name in telemetry.fresh:
            messages.fill_range(self._ranges[name], stamp, telemetry.ranges[name])
            self._ranges_out[name].publish(self._ranges[name])

    def battery(self, board: Board) -> None:
        """Publish the battery's voltage."""
        messages.fill_battery(self._battery, rospy.Time.now(), board.battery_v, self._model.battery)
        self._battery_out.publish(self._battery)


class RobotNode:
    """Connects a driver with its topics."""

    def __init__(self, parameters: Parameters) -> None:
        """Checks the robot model; the port is opened by `run`.

        Raises:
            ConfigError: the robot model is unknown or wrong.
        """
        self._parameters = parameters
        options = Options(command_timeout_s=parameters.cmd_vel_timeout)
        self._driver = Driver(parameters.port, parameters.robot, parameters.baud, options)
        self._battery_state = ""

    def run(self) -> None:
        """Serve until the node is shut down.

        Raises:
            MrlError: the robot cannot be reached, is not the one, or went away.
        """
        rospy.on_shutdown(self._driver.close)
        if rospy.is_shutdown():
            return
        try:
            board = self._driver.connect()
            self._wire(board)
            self._serve(board)
        except LinkLost:
            if self._driver.error is not None or not rospy.is_shutdown():
                raise
        finally:
            self._driver.close()

    def _wire(self, board: Board) -> None:
        model = self._driver.model
        assert model is not None
        publishers = Publishers(self._parameters, model)
        self._driver.on_telemetry(publishers.telemetry)
        self._driver.on_battery(publishers.battery)
        self._driver.on_battery(self._on_battery)
        publishers.battery(board)
        rospy.Subscriber("cmd_vel", Twist, self._on_cmd_vel, queue_size=1, tcp_nodelay=True)
        rospy.loginfo(
            f"{model.name} (robot id {board.robot_id}, firmware {board.version}) on {self._parameters.port}, "
            f"battery {board.battery_v:.1f} V"
        )

    def _serve(self, board: Board) -> None:
        updater = diagnostic_updater.Updater()
        updater.setHardwareID(f"{self._parameters.port} robot {board.robot_id}")
        updater.add("Link", self._diagnose)
        while not self._driver.wait(DIAGNOSTICS_S):
            updater.update()

    def _diagnose(
        self, status: diagnostic_updater.DiagnosticStatusWrapper
    ) -> diagnostic_updater.DiagnosticStatusWrapper:
        driver, parameters = self._driver, self._parameters
        health = link_report.health(driver.ready, driver.age_s, driver.battery_state, driver.battery_v)
        status.summary(health.level, health.message)
        values = link_report.values(
            parameters.port, parameters.baud, driver.board, driver.statistics, driver.age_s
        )
        for key, value in values.items():
            status.add(key, value)
        return status

    def _on_cmd_vel(self, message: Twist) -> None:
        try:
            self._command(message)
        except MrlError:
            return  # the driver keeps the error, and the main thread reports it

    def _command(self, message: Twist) -> None:
        try:
            linear_m_s, angular_rad_s = messages.read_twist(message)
        except ValueError as error:
            self._driver.stop()
            rospy.logwarn_throttle(WARN_EVERY_S, f"{error}; the robot was stopped")
            return
        unused = messages.unused_axes(message)
        if unused:
            rospy.logwarn_throttle(
                WARN_EVERY_S,
                f"cmd_vel {', '.join(unused)} ignored: the robot follows linear.x and angular.z alone",
            )
        if not self._driver.drive(linear_m_s, angular_rad_s):
            rospy.logwarn_throttle(WARN_EVERY_S, f"cmd_vel refused: {self._why_not()}")

    def _why_not(self) -> str:
        if self._driver.ready:
            return f"the battery is {self._driver.battery_state} at {self._driver.battery_v:.1f} V, charge it"
        return "the board is silent or just restarting; send the command again when telemetry is back"

    def _on_battery(self, board: Board) -> None:
        state, before = self._driver.battery_state, self._battery_state
        if state == before:
            return
        self._battery_state = state
        if state == LOW:
            rospy.logwarn(f"battery is low at {board.battery_v:.1f} V: charge it soon")
        elif state == EMPTY:
            rospy.logerr(f"battery is empty at {board.battery_v:.1f} V: the robot stops; charge it")
        elif state == OFF:
            rospy.logerr(f"battery reads {board.battery_v:.1f} V: motor power is off; switch it on")


def main(argv: Optional[List[str]] = None) -> int:
    """Run the node; returns the exit code, that of the error if there was one."""
    try:
        rospy.init_node("robot_node", argv=argv)
        RobotNode(_parameters()).run()
    except rospy.ROSInterruptException:
        return 0
    except MrlError as error:
        if rospy.is_shutdown():
            return 0
        rospy.logfatal(str(error))
        return error.exit_code
    return 0


def _parameters() -> Parameters:
    name = rospy.get_name()
    given = rospy.get_param(name, {})
    return check(given if isinstance(given, dict) else {}, name)
