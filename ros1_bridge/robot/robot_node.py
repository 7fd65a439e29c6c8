"""ROS node `robot_node`: one robot on a serial port.

The driver's reading thread publishes telemetry.  A command goes to the port on the thread of its subscriber.  The
README of this package lists topics, services and parameters.
"""

import contextlib
import ctypes
import gc
import math
import os
import sys
import time
from typing import Any, Callable, Dict, Optional, Set, Tuple

import diagnostic_updater
import rosgraph
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

from mrl_driver.clocks import later
from mrl_driver.driver import Driver
from mrl_driver.driver.options import QUEUED_S, Options
from mrl_driver.driver.suspension import stopped_while_suspended
from mrl_driver.errors import LinkLost, MrlError
from mrl_driver.files import create_unused
from mrl_driver.robot.battery import EMPTY, LOW, OFF, voltage_text
from mrl_driver.robot.hold import CAPABILITY as HOLD
from mrl_driver.robot.inputs import Inputs
from mrl_driver.robot.models import Limits, RobotModel
from mrl_driver.robot.radio import CAPABILITY as RADIO
from mrl_driver.robot.robot_state import assumes_sonars
from mrl_driver.safety.speed_limiter import MANUAL, manual_speed_m_s
from mrl_driver.safety.wheel_monitor import Mismatch
from mrl_driver.session.events import Awaited, Ready
from mrl_driver.session.handshake import Board
from ros1_bridge.control.commander import Commander, lowered
from ros1_bridge.node.master_watch import MasterWatch
from ros1_bridge.node.robot_parameters import ROWS, Parameters, check, without_motors
from ros1_bridge.node.run_node import node
from ros1_bridge.status.diagnostics import add_tasks
from ros1_bridge.status.link_report import ERROR, OK, WARN, News
from ros1_bridge.status.markers import Markers
from ros1_bridge.status.robot_status import StatusTeller
from ros1_bridge.topics.board_topics import BoardTopics
from ros1_bridge.topics.publishers import JUMP_S, Publishers
from ros1_bridge.topics.typed_messages import REBUILD, is_other_version

from .command_topics import CommandTopics, Connected, nodes_on
from .goal_cancel import GoalCancel
from .mode_switch import ModeSwitch, keep_stops
from .reconfigure import Reconfigure
from .services import Answer, Services
from .servo_topics import subscribe_servos
from .xbee import Radio
from .zone_topics import ZoneTopics

DIAGNOSTICS_S = 1.0
OFFERED_S = 2.0  # `dynamic_reconfigure` comes after this time: it takes a seventh of the start's computing
SETTLED_S = 5.0  # After this time what stays in memory is there, and other nodes of a launch have started
MASTER_S = 5.0  # The node looks this often whether the master is there: each look is a connection
STATUS_S = 0.2  # A change of the robot's state is published within this time
FREED_S = 2.0
"""A node of the same name, which the master ends when this one registers, closes the port within this time."""
ANSWER_S = 0.2  # Time for the answer of the service shutdown to leave
LOSS_EVERY_S = 30.0
HUGE_BITS, MADV_COLLAPSE = 21, 25  # size of a huge page, 2 MiB, as a power of two; advice of madvise(2)
SWITCH_S = 0.0005
"""A frame waits at most this long for a thread that is busy with a service; Python's default is 5 ms."""
SENSORS_ALONE = "no motors: its sensors are published, and neither odometry, tf nor cmd_vel is used"
NO_ODOMETRY = (
    "the motors have no encoders: there is no odometry (no odom, tf and joint_states of wheels), poses are refused, "
    "and no wheel is watched"
)
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
        virtual=parameters.virtual,
        port_timeout_s=max(parameters.port_timeout, FREED_S),
        reconnect=parameters.reconnect,
        fast=parameters.fast,
        imu_period_ms=round(1000 / parameters.imu_rate) if parameters.imu else 0,
        record=create_unused(os.path.expanduser(parameters.record)) if parameters.record else None,
    )


class RobotNode:
    """Connects a driver with the topics and services of its robot."""

    def __init__(self, parameters: Parameters) -> None:
        """Raises ConfigError if the robot model is unknown or wrong; `run` opens the port."""
        self._parameters = parameters
        self._driver = Driver(parameters.port, parameters.robot, parameters.baud, driver_options(parameters))
        self._battery_state, self._ahead_s = "", -math.inf
        self._news = News()
        self._lacking = 0  # Lines that are known to be missing in the recording
        self._zones: Optional[ZoneTopics] = None
        self._markers: Optional[Markers] = None
        self._commands: Optional[CommandTopics] = None
        self._goals: Optional[GoalCancel] = None

    def run(self) -> None:
        """Serve until the shutdown; MrlError if the robot cannot be reached, is another model, or its link was lost."""
        rospy.on_shutdown(self._driver.close)
        if self._parameters.port_timeout:
            self._driver.on_event(self._on_wait)
        try:
            board = self._driver.connect()
            assert self._driver.model is not None
            if not self._driver.model.drives:
                self._parameters = without_motors(self._parameters)
            self._wire(board, self._driver.model)
            self._greet(board, self._driver.model)
            with stopped_while_suspended(self._driver):
                self._serve(board)
        except LinkLost:
            if self._driver.error is not None or not rospy.is_shutdown():
                raise
        finally:
            self._driver.close()
            self._tell_loss()

    def _wire(self, board: Board, model: RobotModel) -> None:
        """Connect the parts; telemetry comes last, because programs may begin to drive with the first odometry."""
        parameters, driver = self._parameters, self._driver
        self._commander = commander = Commander(driver)
        commander.sources.pause_s = parameters.cmd_vel_pause
        limits = self._lower_limits(model)
        publishers = Publishers(
            rospy.Publisher,
            rospy.exceptions.TransportException,
            parameters,
            model,
            time.time if rospy.rostime.is_wallclock() else rospy.get_time,
            note_clock=self._note_clock,
        )
        topics = BoardTopics(driver, publishers, rospy.Publisher, parameters, rospy.Time.now)
        if parameters.zones != "none":
            self._zones = ZoneTopics(driver, commander, parameters, model)
        if parameters.has("status") and model.drives:
            self._markers = Markers(driver, commander, parameters.base_frame, rospy.Publisher)
        robot = self._hardware_id(board), board.virtual
        self._status = StatusTeller(commander, publishers.status, rospy.get_name(), *robot)
        if parameters.has("commands"):
            self._goals = GoalCancel(rospy)
            commander.cancel_goals = self._goals.cancel
            if parameters.emergency_stop:
                with contextlib.suppress(MrlError):  # it is latched, although the robot cannot be reached
                    commander.latch()
            if not parameters.motors_enabled:
                with contextlib.suppress(MrlError):
                    commander.enable(False)
        services = self._offer_services()
        self._status.tell()
        published, subscribed = self._connected_before()
        self._localisers = sorted(nodes_on(subscribed, rospy.resolve_name("initialpose")))
        self._filters = sorted(nodes_on(published, rospy.resolve_name("odometry/filtered")))
        if parameters.has("commands"):
            self._commands = CommandTopics(driver, commander, parameters, model, self._status.tell)
            self._commands.subscribe(published)
            subscribe_servos(driver)
        topics.listen(driver)
        self._listen(board)
        if parameters.has("commands"):
            offer = Reconfigure(driver, commander, services, publishers, parameters).offer
            later(OFFERED_S, offer, limits)

    def _connected_before(self) -> Tuple[Connected, Connected]:
        """The publishers and the subscribers before this node; without a master, a node without commands needs none."""
        try:
            return _connected()
        except MrlError:
            if self._parameters.has("commands"):
                raise
            return (), ()

    def _lower_limits(self, model: RobotModel) -> Limits:
        """Lower the limits to the parameters, and take the mode; a board without motors has no limits."""
        parameters, commander = self._parameters, self._commander
        limits = lowered(
            model.limits,
            parameters.max_linear_speed,
            parameters.max_angular_speed,
            parameters.max_linear_acceleration,
            parameters.max_angular_acceleration,
        )
        if model.drives:
            commander.limits = limits
            commander.manual_m_s = parameters.manual_speed or manual_speed_m_s(model.limits)
            commander.set_manual(parameters.operation_mode == MANUAL)
        return limits

    def _offer_services(self) -> Services:
        parameters = self._parameters
        services = self._services = Services(self._driver, self._commander, _localisers)
        triggers: Dict[str, Callable[[], Answer]] = {"shutdown": self._end_node}
        switches: Dict[str, Callable[[bool], Answer]] = {}
        if parameters.has("odometry") and self._driver.model is not None and self._driver.model.has_odometry:
            triggers["reset_odometry"] = services.reset_odometry
            rospy.Subscriber("set_pose", PoseWithCovarianceStamped, self._on_set_pose, queue_size=1)
        if parameters.has("commands"):
            triggers.update(stop=self._kept(services.stop), release_stop=self._kept(services.release_stop))
            if HOLD in self._driver.board.capabilities:
                triggers["release_hold"] = services.release_hold
            if parameters.allow_calibration:
                triggers["calibrate"] = services.calibrate
            switches["enable_motors"] = self._kept(services.enable_motors)
            switches["manual_mode"] = ModeSwitch(self._commander, rospy).set

        def told(answer: Answer) -> Answer:
            self._status.tell()
            return answer

        for name, act in triggers.items():
            rospy.Service(name, Trigger, lambda _, act=act: TriggerResponse(*told(act())))
        for name, switch in switches.items():
            rospy.Service(name, SetBool, lambda on, act=switch: SetBoolResponse(*told(act(on.data))))
        return services

    def _kept(self, act: Callable[..., Answer]) -> Callable[..., Answer]:
        """Return `act`, after which a respawn knows the stops; its answer does not wait for the master."""

        def call(*on: bool) -> Answer:
            answer = act(*on)
            later(0.0, keep_stops, self._commander, rospy)
            return answer

        return call

    def _end_node(self) -> Answer:
        """Stop now; the node closes the port and ends after the answer has left."""
        done, text = self._services.stop()
        later(ANSWER_S, rospy.signal_shutdown, "the service shutdown was called")
        return done, "stopped; the node closes the port and ends" if done else f"{text}; the node ends"

    def _on_set_pose(self, message: PoseWithCovarianceStamped) -> None:
        done, text = self._services.set_pose(message, self._parameters.odom_frame)
        (rospy.loginfo if done else rospy.logwarn)(text if done else f"set_pose refused: {text}")

    def _listen(self, board: Board) -> None:
        """Let the driver call this node, after the publishers."""
        driver = self._driver
        if self._zones is not None:
            self._zones.listen()
        driver.on(Board, self._on_battery)
        driver.on_event(self._on_event)
        if self._parameters.has("sensors") and RADIO in board.capabilities:
            Radio(driver).offer()
        if self._zones is not None and self._parameters.planner != "none":
            self._zones.lead_planner()

    def _greet(self, board: Board, model: RobotModel) -> None:
        driver = self._driver
        power = f"battery {voltage_text(board.battery_v)}" if model.drives else SENSORS_ALONE
        kind = "virtual " if board.virtual else ""
        rospy.loginfo(
            f"{kind}{model.name} (robot id {board.robot_id}, firmware {board.version}) on {self._parameters.port} at "
            f"{driver.link.baud} baud, {power}"
        )
        if driver.recorder.file is not None:
            rospy.loginfo(f"recording to {os.path.abspath(driver.recorder.file.path)}")
        if assumes_sonars(model, board):
            rospy.logwarn(
                "this board of 2013 is taken to have sonars: set ~build to sonar, or to environment if it has gas "
                "and light sensors"
            )
        if is_other_version():
            rospy.logwarn(REBUILD)
        warnings = [driver.build_warning]
        if self._parameters.zones_by_sonar:
            with contextlib.suppress(MrlError):  # a board that does not answer now does not end the node
                warnings.append(driver.parameters.curve_warning(model))
        for warning in filter(None, warnings):
            rospy.logwarn(warning)
        if model.drives and not model.has_odometry:
            rospy.logwarn(NO_ODOMETRY)
        if self._filters and self._parameters.publish_tf and self._parameters.has("odometry"):
            rospy.logwarn(
                f"{', '.join(self._filters)} publishes odometry/filtered: if it also publishes "
                f"{self._parameters.odom_frame} to {self._parameters.base_frame} on /tf, the robot jumps between both "
                "poses; start this node with publish_tf:=false"
            )
        if self._localisers and self._parameters.has("odometry"):
            rospy.logwarn(
                f"{', '.join(self._localisers)} was here before this node, whose odometry begins at 0, 0, 0: unless "
                "the robot stands at its start, publish its pose in the map on initialpose (rviz: 2D Pose Estimate)"
            )

    def _hardware_id(self, board: Board) -> str:
        return f"{self._parameters.port} {'virtual ' if board.virtual else ''}robot {board.robot_id}"

    def _serve(self, board: Board) -> None:
        updater = None
        if self._parameters.has("status"):
            updater = diagnostic_updater.Updater()
            updater.setHardwareID(self._hardware_id(board))
            add_tasks(updater, self._driver, self._commander, self._parameters)
        unknown = self._commands
        master, look_s, due_s = MasterWatch(rosgraph.get_master_uri()), -math.inf, -math.inf
        settled_s = time.monotonic() + SETTLED_S
        while not self._driver.wait(STATUS_S):
            with contextlib.suppress(MrlError):
                self._commander.watch_link()
            if unknown is not None and unknown.note_sources():
                unknown = None  # all are connected that were there before this node
            self._status.tell()
            if self._markers is not None:
                self._markers.publish()
            if self._zones is not None:
                self._zones.tell_held()
            now_s = time.monotonic()
            if now_s >= settled_s:
                settled_s = math.inf
                _settle_memory()
            if now_s >= look_s:
                look_s, words = now_s + MASTER_S, master.look()
                if words:
                    rospy.logerr(words)
            if now_s < due_s:
                continue
            due_s = now_s + DIAGNOSTICS_S
            self._tell_loss()
            if updater is not None and updater.publisher.get_num_connections():
                updater.force_update()  # update() does nothing after the clock is set back, and before /clock

    def _tell_loss(self) -> None:
        """Log what the recording lacks, each time that it lacks more."""
        recorder = self._driver.recorder.file
        if recorder is not None and recorder.lost > self._lacking:
            self._lacking = recorder.lost
            rospy.logerr_throttle(LOSS_EVERY_S, f"the recording is not complete: {recorder.loss}")

    # -- callbacks of the driver, on its reading thread

    def _on_wait(self, event: Any) -> None:
        if isinstance(event, Awaited):
            rospy.logwarn(str(event))

    def _on_event(self, event: Any) -> None:
        told = self._news.of(event)
        if told is not None and not rospy.is_shutdown():
            LOG[told.level](told.message)
        restarted = isinstance(event, Ready) and event.restarted and event.checked  # else only assumed
        pressed = isinstance(event, Inputs) and event.latched
        if restarted or pressed or isinstance(event, Mismatch):
            with contextlib.suppress(MrlError):
                self._commander.end_goals()
        self._status.tell()

    def _note_clock(self, ahead_s: float) -> None:
        self._driver.recorder.note_clock(ahead_s)
        back_s, self._ahead_s = self._ahead_s - ahead_s, ahead_s
        if back_s > JUMP_S and self._goals is not None:
            self._goals.set_back(back_s)
            rospy.logwarn(
                f"the clock was set back by {back_s:.0f} s: restart planners such as move_base, or they refuse goals "
                "until it has caught up"
            )

    def _on_battery(self, board: Board) -> None:
        state, before = self._driver.battery_state, self._battery_state
        if state == before:
            return
        self._battery_state = state
        if state in (EMPTY, OFF) and not self._parameters.ignore_battery:
            self._commander.end_goals(stop=False)
        if state == LOW:
            rospy.logwarn(f"battery is low at {board.battery_v:.1f} V: charge it soon")
        elif state == EMPTY:
            rospy.logerr(f"battery is empty at {board.battery_v:.1f} V: the robot stops; charge it")
        elif state == OFF:
            rospy.logerr(f"battery reads {board.battery_v:.1f} V: motor power is off; switch it on")


def _settle_memory() -> None:
    """All present objects stay: garbage collections need not scan them again, and they lie in huge pages.

    The node wakes 50 times a second with cold caches, and then needs fewer entries of the page tables.  Kernels before
    Linux 6.1 refuse, and leave the memory as it is.
    """
    gc.collect()
    gc.unfreeze()  # `get_objects` leaves out those of the imports
    blocks, madvise = {id(each) >> HUGE_BITS for each in gc.get_objects()}, ctypes.CDLL(None).madvise
    for block in blocks:
        madvise(ctypes.c_void_p(block << HUGE_BITS), ctypes.c_size_t(1 << HUGE_BITS), MADV_COLLAPSE)
    gc.freeze()


def _connected() -> Tuple[Connected, Connected]:
    """The publishers and the subscribers of all topics; the answer of a large system takes the master 30 ms.

    MrlError if the master does not answer.
    """
    try:
        publishers, subscribers, _services = rosgraph.Master(rospy.get_name()).getSystemState()
    except (OSError, rosgraph.MasterException) as error:
        raise MrlError(
            f"the ROS master does not answer, so it is not known which nodes drive ({error}); start it, then this node"
        ) from None
    return publishers, subscribers


def _localisers() -> Set[str]:
    """Nodes such as amcl and hector_mapping: they take the robot's pose in the map from `initialpose`."""
    try:
        return nodes_on(_connected()[1], rospy.resolve_name("initialpose"))
    except MrlError:  # without a master
        return set()


def _run(parameters: Parameters) -> None:
    sys.setswitchinterval(SWITCH_S)
    RobotNode(parameters).run()


main = node("robot_node", check, _run, ROWS)
