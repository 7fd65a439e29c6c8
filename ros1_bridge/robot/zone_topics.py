"""The protective zones of one robot: their readings, from telemetry and `scan`, and the planner that follows them."""

import contextlib
import math
import threading
import time
from typing import Any, Dict, Mapping, Optional, Tuple

import rospy
from sensor_msgs.msg import LaserScan

from mrl_driver.clocks import wait_until
from mrl_driver.driver import Driver, Telemetry
from mrl_driver.errors import ConfigError, MrlError
from mrl_driver.protocol.stop_reason import StopReason
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.robot_state import assumes_sonars
from ros1_bridge.control.commander import Commander
from ros1_bridge.control.planner_limit import PlannerLimit
from ros1_bridge.control.zone_feed import MountFinder, ZoneWatch, assumed_twist
from ros1_bridge.node.robot_parameters import Parameters

STEP_S = 0.2  # The planner's speed is looked at this often
PLANNER_END_S = 1.0  # On shutdown, the planner gets its own speed back within this time
PLANNER_LOOK_S = 2.0  # A planner that does not answer is looked for again after this time
WARN_EVERY_S = 1.0
MEMORY = "zone_limit"
"""Parameter in the planner's namespace: the speed set and the planner's own, while a zone is entered."""
ABSENT = (KeyError, OSError, rospy.ROSException, rospy.ServiceException)
"""What a call of a planner that is not there raises."""


class ZoneTopics:
    """Watches a robot's zones from its construction on, with errors of `ZoneWatch`; `listen` gives them readings."""

    def __init__(
        self, driver: Driver, commander: Commander, parameters: Parameters, model: RobotModel
    ) -> None:
        self._driver, self._commander, self._parameters = driver, commander, parameters
        self._watch = ZoneWatch(parameters, model, assumes_sonars(model, driver.board))
        commander.watch(self._watch.zones)
        self._held = False
        self._finder = MountFinder(parameters.base_frame)
        self._ends = threading.Event()

    def listen(self) -> None:
        """Take readings; of telemetry after the publishers, if they listen already."""
        if self._parameters.zones_by_laser:
            rospy.Subscriber("scan", LaserScan, self._on_scan, queue_size=1, tcp_nodelay=True)
        self._driver.on_telemetry(self._on_telemetry)

    def _on_telemetry(self, telemetry: Telemetry) -> None:
        """Let the zones see the frame, and limit the command in force again."""
        twist = assumed_twist(self._driver, telemetry)
        self._watch.on_telemetry(telemetry._replace(twist=twist), self._driver.command is None)
        with contextlib.suppress(MrlError):  # the driver stores the error, and the main thread reports it
            self._driver.limit_again()

    def _on_scan(self, message: LaserScan) -> None:
        mount = self._finder.mount(message.header.frame_id)
        if mount is None:
            trouble = self._finder.trouble
        else:
            trouble = self._watch.on_scan(message, mount, rospy.get_time(), time.monotonic())
        if trouble:
            rospy.logwarn_throttle(WARN_EVERY_S, f"scan not used: {trouble}")

    def tell_held(self) -> None:
        """Log once each time that a zone stops the robot."""
        held, before = self._commander.stopped_by == StopReason.PROTECTIVE_ZONE, self._held
        self._held = held
        if held and not before:
            rospy.logwarn(
                "the protective zone holds the robot: something is close, or a sensor is silent; it may turn or leave"
            )

    def lead_planner(self) -> None:
        """Start the thread for the planner; the shutdown waits until the planner has its own speed back."""
        thread = threading.Thread(target=self._lead, name="planner", daemon=True)
        thread.start()

        def end() -> None:
            self._ends.set()
            thread.join(PLANNER_END_S)

        rospy.on_shutdown(end)  # after the driver's, which stops the robot; services still answer

    def _lead(self) -> None:
        """Let the planner know how fast the zones allow it to drive ahead."""
        zones, planner = self._watch.zones, self._parameters.planner
        limit, due_s = limit_of(planner), -math.inf
        while not wait_until(self._ends.is_set, STEP_S):
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
            except (ConfigError, *ABSENT) as error:
                due_s = now + PLANNER_LOOK_S
                if isinstance(error, ConfigError):
                    rospy.logwarn_once(f"{planner} does not follow the zones: {error}")
        with contextlib.suppress(*ABSENT):
            limit.give_back()


def limit_of(planner: str) -> PlannerLimit:
    """The highest speed of a planner, such as `move_base/TrajectoryPlannerROS`.

    It is the name of its dynamic_reconfigure server, which keeps its values on the parameter server.
    """
    from dynamic_reconfigure.encoding import decode_config, encode_config
    from dynamic_reconfigure.srv import Reconfigure

    service, memory = rospy.ServiceProxy(f"{planner}/set_parameters", Reconfigure), f"{planner}/{MEMORY}"

    def configure(values: Dict[str, float]) -> Mapping[str, Any]:
        if not values:  # a call without values would make the planner begin again
            return dict(rospy.get_param(planner))
        return dict(decode_config(service(encode_config(values)).config))

    def store(pair: Optional[Tuple[float, float]]) -> None:
        if pair is not None:
            rospy.set_param(memory, list(pair))
        elif rospy.has_param(memory):
            rospy.delete_param(memory)

    return PlannerLimit(configure, store, rospy.get_param(memory, None))
