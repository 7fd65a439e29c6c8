"""ROS node `robot_node`: one robot on a serial port.

The driver's reading thread publishes telemetry.  A command goes to the port on the thread of its subscriber.  The
README of this package lists topics, services and parameters.
"""

import contextlib
import gc
import math
import os
import sys
import threading
import time
from typing import Any, Callable, Dict, List, Optional, Sequence, Set

import diagnostic_updater
import rosgraph
import rospy
from diagnostic_msgs.msg import KeyValue
from diagnostic_msgs.srv import SelfTest
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist, TwistStamped
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Header
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from mrl_driver.driver import Driver, Telemetry
from mrl_driver.driver.options import QUEUED_S, Options
from mrl_driver.driver.suspension import stopped_while_suspended
from mrl_driver.errors import ConfigError, FrameError, LinkLost, MrlError
from mrl_driver.files import create_unused
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.battery import EMPTY, LOW, OFF, voltage_text
from mrl_driver.robot.hold import CAPABILITY as HOLD
from mrl_driver.robot.models import Limits, OmniDrive, RobotModel
from mrl_driver.robot.radio import CAPABILITY as RADIO
from mrl_driver.robot.radio import WAITING
from mrl_driver.safety.operation_mode import MANUAL, manual_speed_m_s
from mrl_driver.safety.protective_zones import Zones
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import Awaited, Ready
from mrl_driver.session.handshake import Board
from ros1_bridge.control.commander import Commander, lowered
from ros1_bridge.control.pose_goal import PoseGoal
from ros1_bridge.control.velocity_sources import Source
from ros1_bridge.control.zone_feed import MountFinder, ZoneWatch
from ros1_bridge.node.master_watch import MasterWatch
from ros1_bridge.node.operator_cmd_vel import operator_now_s
from ros1_bridge.node.robot_parameters import GROUPS, Parameters, check, without_motors, zone_sensors
from ros1_bridge.node.run_node import run_node
from ros1_bridge.status.diagnostics import Diagnostics
from ros1_bridge.status.link_report import ERROR, OK, WARN, News
from ros1_bridge.status.robot_status import StatusTeller
from ros1_bridge.topics import messages
from ros1_bridge.topics.board_topics import BoardTopics
from ros1_bridge.topics.publishers import Publishers

from . import reconfigure, xbee
from .goal_cancel import GoalCancel
from .mode_switch import ModeSwitch
from .operators import Operators
from .planner_calls import limit_of
from .services import GAINS, Answer, Services
from .xbee import Radio

DIAGNOSTICS_S = 1.0
STATUS_S = 0.2
"""A change of the robot's state is published within this time."""
PLANNER_END_S = 1.0
"""On shutdown, the planner gets its own speed back within this time."""
PLANNER_LOOK_S = 2.0
"""A planner that does not answer is looked for again after this time."""
FREED_S = 2.0
"""A node of the same name, which the master ends when this one registers, closes the port within this time."""
ANSWER_S = 0.2
"""Time for the answer of the service shutdown to leave."""
CONNECT_S, CONNECT_LOOK_S = 2.0, 0.02
"""At the start, publishers of commands connect within this time; the node looks this often whether they have."""
WARN_EVERY_S, LOSS_EVERY_S = 1.0, 30.0
SWITCH_S = 0.0005
"""A frame waits at most this long for a thread that is busy with a service; Python's default is 5 ms."""
STANDSTILL = Twist()
SENSORS_ALONE = "no motors: its sensors are published, and neither odometry, tf nor cmd_vel is used"
LOG = {OK: rospy.loginfo, WARN: rospy.logwarn, ERROR: rospy.logerr}


def driver_options(parameters: Parameters) -> Options:
    """The driver's options.  The driver owns the command timeout, so that it also works while the node is stuck."""
    return Options(
        period_ms=round(1000 / parameters.rate),
        command_timeout_s=parameters.cmd_vel_timeout,
        queued_s=QUEUED_S,
        ignore_battery=parameters.ignore_battery,
        build=parameters.build,
        robot_id=parameters.robot_id,
        port_timeout_s=max(parameters.port_timeout, FREED_S),
        reconnect=parameters.reconnect,
        fast=parameters.fast,
        imu_period_ms=round(1000 / parameters.imu_rate) if parameters.imu else 0,
        record=create_unused(os.path.expanduser(parameters.record)) if parameters.record else None,
    )


class RobotNode:
    """Connects a driver with the topics and services of its robot."""

    def __init__(self, parameters: Parameters) -> None:
        """Checks the robot model; `run` opens the port.

        Raises:
            ConfigError: the robot model is unknown or wrong.
        """
        self._parameters = parameters
        self._driver = Driver(parameters.port, parameters.robot, parameters.baud, driver_options(parameters))
        self._battery_state = ""
        self._sideways = False
        self._seeks = False
        self._news = News()
        self._held = False
        self._lacking = 0
        """Lines that are known to be missing in the recording."""
        self._commanded_s = -math.inf
        self._planner_ends = threading.Event()

    def run(self) -> None:
        """Serve until the node is shut down.

        Raises:
            MrlError: the robot cannot be reached, is another model, or its link was lost.
        """
        rospy.on_shutdown(self._driver.close)
        if self._parameters.port_timeout:
            self._driver.on_event(self._on_wait)
        try:
            board = self._driver.connect()
            assert self._driver.model is not None
            if not self._driver.model.drives:
                self._parameters = without_motors(self._parameters)
            self._wire(board, self._driver.model)
            with stopped_while_suspended(self._driver):
                self._serve(board)
        except LinkLost:
            if self._driver.error is not None or not rospy.is_shutdown():
                raise
        finally:
            self._driver.close()
            self._tell_loss()

    def _wire(self, board: Board, model: RobotModel) -> None:
        parameters, driver = self._parameters, self._driver
        self._commander = Commander(driver)
        self._commander.sources.pause_s = parameters.cmd_vel_pause
        limits = self._lower_limits(model)
        self._pose_goal = PoseGoal(
            self._commander, parameters.odom_frame, parameters.base_frame, model.sonars
        )
        clock = time.time if rospy.rostime.is_wallclock() else rospy.get_time
        self._publishers = Publishers(
            rospy.Publisher,
            rospy.exceptions.TransportException,
            parameters,
            model,
            clock,
            note_clock=driver.recorder.note_clock,
        )
        self._topics = BoardTopics(driver, self._publishers, rospy.Publisher, parameters, rospy.Time.now)
        self._watch_zones(model, driver.has_sonars)
        self._status = StatusTeller(
            self._commander, self._publishers.status, rospy.get_name(), self._hardware_id(board)
        )
        if parameters.has("commands"):
            self._commander.cancel_goals = GoalCancel(rospy).cancel
        self._offer_services()
        self._status.tell()
        if parameters.has("commands"):
            self._take_commands()
        self._listen(board)
        if self._zones is not None and parameters.planner != "none":
            self._follow_zones(self._zones.zones)
        if parameters.has("commands"):
            offer = threading.Thread(
                target=self._offer_reconfigure, name="reconfigure", args=(model, limits), daemon=True
            )
            offer.start()  # it takes a second, and `cmd_vel` and `status` should not wait
        gc.collect()
        gc.freeze()  # all present objects stay, so that garbage collections need not scan them again
        power = f"battery {voltage_text(board.battery_v)}" if model.drives else SENSORS_ALONE
        rospy.loginfo(
            f"{model.name} (robot id {board.robot_id}, firmware {board.version}) on {parameters.port} at "
            f"{driver.link.baud} baud, {power}"
        )
        if driver.recorder.file is not None:
            rospy.loginfo(f"recording to {os.path.abspath(driver.recorder.file.path)}")
        if driver.build_assumed:
            rospy.logwarn(
                "this board of 2013 is taken to have sonars: set ~build to sonar, or to environment if it has gas "
                "and light sensors"
            )
        if driver.build_warning:
            rospy.logwarn(driver.build_warning)

    def _lower_limits(self, model: RobotModel) -> Limits:
        """Lower the limits to the parameters, and take the mode; a board without motors has no limits."""
        parameters = self._parameters
        limits = lowered(
            model.limits,
            parameters.max_linear_speed,
            parameters.max_angular_speed,
            parameters.max_linear_acceleration,
            parameters.max_angular_acceleration,
        )
        if model.drives:
            commander = self._commander
            commander.limits = limits
            commander.manual_m_s = parameters.manual_speed or manual_speed_m_s(model.limits)
            commander.set_manual(parameters.operation_mode == MANUAL)
        return limits

    def _listen(self, board: Board) -> None:
        """Let the driver call this node, first the publishers."""
        driver = self._driver
        self._topics.listen(driver)
        if self._zones is not None:
            driver.on_telemetry(self._on_zone_readings)
        driver.on(Board, self._on_battery)
        driver.on_event(self._on_event)
        if self._parameters.has("sensors") and RADIO in board.capabilities:
            self._offer_radio()

    def _watch_zones(self, model: RobotModel, has_sonars: bool) -> None:
        self._zones: Optional[ZoneWatch] = None
        if self._parameters.zones != "none":
            self._zones = ZoneWatch(self._parameters, model, has_sonars, self._driver.build_assumed)
            self._commander.watch(self._zones.zones)
        self._sideways = isinstance(model.drive, OmniDrive)

    def _take_commands(self) -> None:
        """Before `_listen`: with the first odometry programs may begin to drive."""
        topic = rospy.resolve_name("cmd_vel")
        there = _publishers((topic, f"{topic}/stamped"))
        self._commander.sources.expect(there)
        self._operators = Operators(self._parameters.max_command_delay, operator_now_s)
        self._echo = rospy.Publisher(f"{topic}/echo", Header, queue_size=10, tcp_nodelay=True)
        rospy.Subscriber(f"{topic}/ping", Header, self._on_ping, queue_size=10, tcp_nodelay=True)
        self._commands = [
            rospy.Subscriber(topic, Twist, self._on_cmd_vel, queue_size=1, tcp_nodelay=True),
            rospy.Subscriber(
                f"{topic}/stamped", TwistStamped, self._on_stamped, queue_size=1, tcp_nodelay=True
            ),
        ]
        if there:
            self._await_sources()
        rospy.Subscriber("pose", PoseStamped, self._on_pose, queue_size=1)
        if self._zones is not None and zone_sensors(self._parameters)[1]:
            self._finder = MountFinder(self._parameters.base_frame)
            rospy.Subscriber("scan", LaserScan, self._on_scan, queue_size=1, tcp_nodelay=True)

    def _await_sources(self) -> None:
        """Let the nodes that were there before this one connect, and be silent for their pause if they are."""
        until_s = time.monotonic() + CONNECT_S
        while not self._sources_connected() and time.monotonic() < until_s:
            time.sleep(CONNECT_LOOK_S)
        time.sleep(self._parameters.cmd_vel_pause)

    def _sources_connected(self) -> bool:
        """Take note of the connected sources; whether all are that were there before this node."""
        nodes = {link.callerid_pub for each in self._commands for link in each.impl.connections}
        return self._commander.sources.connected(nodes, time.monotonic())

    def _offer_radio(self) -> None:
        self._radio = Radio(self._driver)
        rospy.Subscriber(xbee.SEND, KeyValue, self._on_radio, queue_size=WAITING, tcp_nodelay=True)
        rospy.Service(xbee.DISCOVER, SelfTest, self._radio.discover)

    def _offer_services(self) -> None:
        parameters = self._parameters
        services = self._services = Services(self._driver, self._commander, _localisers)
        triggers: Dict[str, Callable[[], Answer]] = {"shutdown": self._end_node}
        if parameters.has("odometry"):
            triggers["reset_odometry"] = services.reset_odometry
            rospy.Subscriber("set_pose", PoseWithCovarianceStamped, self._on_set_pose, queue_size=1)
        if parameters.has("commands"):
            triggers.update(stop=services.stop, release_stop=services.release_stop)
            if HOLD in self._driver.board.capabilities:
                triggers["release_hold"] = services.release_hold
        if parameters.has("commands") and parameters.allow_calibration:
            triggers["calibrate"] = services.calibrate

        def told(answer: Answer) -> Answer:
            self._status.tell()
            return answer

        for name, action in triggers.items():
            rospy.Service(name, Trigger, lambda _, act=action: TriggerResponse(*told(act())))
        if parameters.has("commands"):
            switches = {
                "enable_motors": services.enable_motors,
                "manual_mode": ModeSwitch(self._commander, rospy).set,
            }
            for name, switch in switches.items():
                rospy.Service(
                    name, SetBool, lambda request, act=switch: SetBoolResponse(*told(act(request.data)))
                )

    def _end_node(self) -> Answer:
        """Stop now; the node closes the port and ends after the answer has left."""
        done, text = self._services.stop()
        threading.Timer(ANSWER_S, rospy.signal_shutdown, ("the service shutdown was called",)).start()
        return done, "stopped; the node closes the port and ends" if done else f"{text}; the node ends"

    def _offer_reconfigure(self, model: RobotModel, limits: Limits) -> None:
        from dynamic_reconfigure.server import Server  # late: the import takes most of the second

        try:
            for group in GROUPS:  # values of an earlier run must not override this run's parameters
                if rospy.has_param(f"~{group}"):
                    rospy.delete_param(f"~{group}")
            self._servers = [Server(reconfigure.limits_description(model, limits), self._on_limits, "limits")]
            if self._driver.has_sonars and self._parameters.has("sonars"):
                sonars = reconfigure.sonars_description(self._publishers.clear_range_m)
                self._servers.append(Server(sonars, self._on_sonars, "sonars"))
            if self._parameters.allow_gains:
                self._gains = self._services.gains()
                self._servers.append(
                    Server(reconfigure.gains_description(self._gains), self._on_gains, "gains")
                )
        except MrlError as error:
            if not rospy.is_shutdown():
                rospy.logerr(f"gains are not offered, because those of the board cannot be read: {error}")
        except (rospy.ROSException, OSError):  # the shutdown has closed a service, or the master, meanwhile
            if not rospy.is_shutdown():
                raise

    def _serve(self, board: Board) -> None:
        updater = None
        if self._parameters.has("status"):
            updater = diagnostic_updater.Updater()
            updater.setHardwareID(self._hardware_id(board))
            Diagnostics(self._driver, self._commander, self._parameters).add_to(updater)
        master, due_s = MasterWatch(rosgraph.get_master_uri()), time.monotonic()
        while not self._driver.wait(STATUS_S):
            with contextlib.suppress(MrlError):
                self._commander.watch_link()
            if self._parameters.has("commands"):
                self._sources_connected()
            self._status.tell()
            self._tell_zone()
            if time.monotonic() < due_s:
                continue
            due_s = time.monotonic() + DIAGNOSTICS_S
            self._tell_loss()
            words = master.look()
            if words:
                rospy.logerr(words)
            if updater is not None and updater.publisher.get_num_connections():
                updater.force_update()  # update() does nothing after the clock is set back, and before /clock

    def _tell_loss(self) -> None:
        """Log what the recording lacks, each time that it lacks more."""
        recorder = self._driver.recorder.file
        if recorder is not None and recorder.lost > self._lacking:
            self._lacking = recorder.lost
            rospy.logerr_throttle(LOSS_EVERY_S, f"the recording is not complete: {recorder.loss}")

    def _hardware_id(self, board: Board) -> str:
        return f"{self._parameters.port} robot {board.robot_id}"

    def _follow_zones(self, zones: Zones) -> None:
        """Start the thread for the planner; the shutdown waits until the planner has its own speed back."""
        thread = threading.Thread(target=self._tell_planner, name="planner", args=(zones,), daemon=True)
        thread.start()

        def end() -> None:
            self._planner_ends.set()
            thread.join(PLANNER_END_S)

        rospy.on_shutdown(end)  # after that of `run`, which stops the robot; services still answer

    def _tell_planner(self, zones: Zones) -> None:
        """Let the planner know how fast the zones allow it to drive ahead; on a thread of its own."""
        absent = (KeyError, OSError, rospy.ROSException, rospy.ServiceException)
        limit, due_s = limit_of(self._parameters.planner, rospy), -math.inf
        while not self._planner_ends.wait(STATUS_S):
            now = time.monotonic()
            if now < due_s:
                continue
            allowed_m_s = zones.allowed_ahead_m_s(now)
            if allowed_m_s >= self._commander.limits.linear_m_s:
                allowed_m_s = math.inf
            try:
                line = limit.step(allowed_m_s, now)
                if line:
                    rospy.loginfo(line)
            except ConfigError as error:
                rospy.logwarn_once(f"{self._parameters.planner} does not follow the zones: {error}")
                due_s = now + PLANNER_LOOK_S
            except absent:
                due_s = now + PLANNER_LOOK_S
        with contextlib.suppress(*absent):
            limit.give_back()

    # -- callbacks of the driver, on its reading thread

    def _on_zone_readings(self, telemetry: Telemetry) -> None:
        """After the publishers: let the zones see the frame, and limit the command in force again."""
        assert self._zones is not None
        self._zones.on_telemetry(telemetry, self._driver.command is None)
        with contextlib.suppress(MrlError):  # the driver stores the error, and the main thread reports it
            self._driver.limit_again()

    def _on_goal_step(self, telemetry: Telemetry) -> None:
        with contextlib.suppress(MrlError):
            ended = self._pose_goal.on_telemetry(telemetry)
            if ended:
                rospy.loginfo(ended)

    def _tell_zone(self) -> None:
        """Log once each time that a zone stops the robot."""
        held, before = self._commander.stopped_by == StopReason.PROTECTIVE_ZONE, self._held
        self._held = held
        if held and not before:
            rospy.logwarn(
                "the protective zone holds the robot: something is close, or a sensor is silent; it may turn or leave"
            )

    def _on_wait(self, event: Any) -> None:
        if isinstance(event, Awaited):
            rospy.logwarn(str(event))

    def _on_event(self, event: Any) -> None:
        told = self._news.of(event)
        if told is not None and not rospy.is_shutdown():
            LOG[told.level](told.message)
        restarted = (
            isinstance(event, Ready) and event.restarted and event.checked
        )  # unchecked: it is only assumed
        if restarted or isinstance(event, Mismatch):
            with contextlib.suppress(MrlError):
                self._commander.end_goals()
        self._status.tell()

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

    # -- callbacks of ROS

    def _on_cmd_vel(self, message: Twist, source: Optional[Source] = None) -> None:
        source = source or Source(message._connection_header.get("callerid", ""))
        linear, angular, commander = message.linear, message.angular, self._commander
        before_s, self._commanded_s = self._commanded_s, time.monotonic()
        if self._commanded_s - before_s > 0.5 * self._parameters.cmd_vel_timeout:
            self._status.tell()  # a stop that this command ends is published too, however short it was
        forward_m_s = linear.x
        if linear.z or angular.x or angular.y or (linear.y and not self._sideways):
            forward_m_s += self._ignore_axes(message)
        try:
            if self._sideways:
                taken = commander.drive(forward_m_s, angular.z, linear.y, source=source)
            else:
                taken = commander.drive(forward_m_s, angular.z, source=source)
        except FrameError:  # the driver has stopped the robot
            words = messages.field_not_finite(message)
            rospy.logwarn_throttle(WARN_EVERY_S, f"{words}; the robot was stopped")
        except MrlError:
            return
        else:
            if not taken:
                rospy.logwarn_throttle(WARN_EVERY_S, f"cmd_vel refused: {commander.refusal()}")

    def _on_stamped(self, message: TwistStamped) -> None:
        """Follow an operator's command and echo its header, or stop if it arrives too late.  No stop is too late."""
        header, commander, refusal = message.header, self._commander, ""
        if message.twist != STANDSTILL:
            refusal = self._operators.refusal(header.frame_id, header.stamp.to_sec())
        if not refusal:
            node = message._connection_header.get("callerid", "")
            self._on_cmd_vel(message.twist, Source(node, header.frame_id))
            self._echo.publish(header)
            return
        commander.late_commands = self._operators.refused
        rospy.logwarn_throttle(WARN_EVERY_S, refusal)
        if commander.seeking:
            self._pose_goal.cancel()
        if commander.driving:
            with contextlib.suppress(MrlError):
                commander.stop(StopReason.COMMAND_TOO_LATE)

    def _on_ping(self, header: Header) -> None:
        self._operators.late_s(header.frame_id, header.stamp.to_sec())
        self._echo.publish(header)

    def _ignore_axes(self, message: Twist) -> float:
        """Warn of fields that the drive cannot follow.

        Return 0, or NaN if one of them is not finite, which makes the command not finite for the driver.
        """
        if messages.field_not_finite(message):
            return math.nan
        unused = messages.unused_axes(message, self._sideways)
        followed = "linear.x, linear.y and angular.z" if self._sideways else "linear.x and angular.z"
        rospy.logwarn_throttle(
            WARN_EVERY_S, f"cmd_vel {', '.join(unused)} ignored: the robot follows {followed} alone"
        )
        return 0.0

    def _on_pose(self, message: PoseStamped) -> None:
        try:
            self._pose_goal.start(message, self._driver.pose)
            if not self._seeks:
                self._seeks = True
                self._driver.on_telemetry(self._on_goal_step)
                if not self._driver.has_sonars:
                    rospy.logwarn(
                        "this board has no sonars: the robot drives to poses without seeing obstacles"
                    )
        except ValueError as error:
            rospy.logwarn(f"pose refused: {error}")

    def _on_set_pose(self, message: PoseWithCovarianceStamped) -> None:
        done, text = self._services.set_pose(message, self._parameters.odom_frame)
        (rospy.loginfo if done else rospy.logwarn)(text if done else f"set_pose refused: {text}")

    def _on_scan(self, message: LaserScan) -> None:
        mount = self._finder.mount(message.header.frame_id)
        assert self._zones is not None
        if mount is None:
            trouble = self._finder.trouble
        else:
            trouble = self._zones.on_scan(message, mount, rospy.get_time(), time.monotonic())
        if trouble:
            rospy.logwarn_throttle(WARN_EVERY_S, f"scan not used: {trouble}")

    def _on_radio(self, message: KeyValue) -> None:
        refusal = self._radio.send(message)
        if refusal:
            rospy.logwarn_throttle(WARN_EVERY_S, refusal)

    def _on_limits(self, config: Any, _level: int) -> Any:
        self._commander.limits = reconfigure.limits_of(config, self._commander.limits)
        return config

    def _on_sonars(self, config: Any, level: int) -> Any:
        if math.isnan(config["clear_range"]):  # dynamic_reconfigure lets it through
            config["clear_range"] = self._publishers.clear_range_m
        self._publishers.clear_range_m = config["clear_range"]
        if level != -1:  # -1 is the call at the start
            rospy.set_param("~clear_range", config["clear_range"])  # for a respawn of the node
        return config

    def _on_gains(self, config: Any, level: int) -> Any:
        if level != -1:  # -1 is the call at the start: the board keeps its gains
            done, text = self._services.set_gains(config["kp"], config["ki"], config["kd"])
            (rospy.loginfo if done else rospy.logerr)(text)
            if done:
                self._gains = {name: config[name] for name in GAINS}
            config.update(self._gains)
        return config


def _publishers(topics: Sequence[str], subscribers: bool = False) -> Set[str]:
    """Names of the nodes that publish, or subscribe to, one of these topics, by the master."""
    connected = rosgraph.Master(rospy.get_name()).getSystemState()[int(subscribers)]
    return {node for topic, nodes in connected if topic in topics for node in nodes}


def _localisers() -> Set[str]:
    """Nodes such as amcl and hector_mapping: they take the robot's pose in the map from `initialpose`."""
    try:
        return _publishers((rospy.resolve_name("initialpose"),), subscribers=True)
    except (OSError, rosgraph.MasterException):  # without a master
        return set()


def main(argv: Optional[List[str]] = None) -> int:
    """Run the node; returns the exit code, which is that of the error if there was one."""
    sys.setswitchinterval(SWITCH_S)
    return run_node("robot_node", lambda: RobotNode(_parameters()).run(), argv)


def _parameters() -> Parameters:
    name = rospy.get_name()
    given = rospy.get_param(name, {})
    return check(given if isinstance(given, dict) else {}, name)
