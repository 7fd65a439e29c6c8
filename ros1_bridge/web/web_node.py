"""ROS node `web_node`: a page that shows and drives a robot, for phones and desks.

The page drives as an operator does: its commands carry the time of the input, and robot_node refuses late ones.  While
nobody drives, the node publishes nothing on `cmd_vel`.
"""

import contextlib
import sys
import threading
import time
from pathlib import Path
from typing import Any, Callable, Dict, Set, Tuple

import rosgraph
import rospy
from sensor_msgs.msg import Imu
from std_srvs.srv import Trigger

from mrl_driver.apps.web.listening import lines_for, settings_for
from mrl_driver.apps.web.robot import NO_MOTORS, PhoneReading
from mrl_driver.clocks import clock_s
from mrl_driver.errors import ConfigError
from ros1_bridge.node.cmd_vel import DELAY_ROW, OperatorCmdVel, twist_of
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.robot_parameters import ROWS as ROBOT_ROWS
from ros1_bridge.node.run_node import node
from ros1_bridge.topics.topic_robot import TopicRobot

from . import phone_imu
from .bag_recording import BagRecording, Unsubscribe
from .emergency_stop import RELEASE, STOP, EmergencyStop
from .topic_page_robot import TopicPageRobot

ROBOT = "robot_node"  # name of the robot's node, in the namespace of this one
STOPS_S = 0.2  # the robot's node must stop the robot this long after the last command of the page [s]
MAX_DELAY_S = 0.25
"""Default of `~max_delay`: the page's part of it is at most 0.15 s, or the server drops the command [s]."""
LOOK_S = 2.0  # time between two looks at the parameter that says so, and at the services of the stop [s]
NOT_RECORDED = ("/rosout", "/rosout_agg")
USUAL = "~/.local/share/mrl-driver/recordings"  # where `mrl web` has its recordings, too
_LISTEN = "Address of the page, HOST or HOST:PORT; beyond this computer with TLS and tokens"
_DELAY = "Stop above this delay from the page's input to the echo of its command; 0 turns it off"
_RECORD = "Topics to record besides those of robot_node and this node, separated by blanks"
PARAMETERS = (
    Row("listen", str, "127.0.0.1:8642", "", _LISTEN),
    Row("robot", str, "auto", "", "Robot model, path of a .yaml file, or auto: by the board's id"),
    DELAY_ROW._replace(default=MAX_DELAY_S, text=_DELAY),
    Row("recordings", str, "", "", f"Folder of the bags that the page records; empty: {USUAL}"),
    Row("record", str, "scan", "", _RECORD),
)
"""The node's private parameters."""


class PageCommands:
    """The commands of the page, as those of an operator."""

    def __init__(self, max_delay_s: float) -> None:
        self._out = OperatorCmdVel(max_delay_s)
        self._age_s = 0.0

    @property
    def link_s(self) -> float:
        """Time from a command of this node to its echo [s]; NaN if no robot echoes."""
        return self._out.delay_s - self._age_s

    def drive(self, linear_m_s: float, angular_rad_s: float, lateral_m_s: float, age_s: float) -> str:
        """Send speeds of an input that is `age_s` old; returns why the robot was stopped instead, or ''."""
        self._age_s = age_s
        self._out.drive(twist_of(linear_m_s, angular_rad_s, lateral_m_s), clock_s() - age_s)
        return self._out.guard.reason

    def stop(self) -> None:
        """Send a stop; after it commands count again."""
        self._age_s = 0.0
        self._out.halt()


class NodeServices:
    """Calls services of the robot's node.  A ROS master that has gone does not keep a stop from it."""

    def __init__(self) -> None:
        self._addresses: Dict[str, str] = {}

    def look(self, *services: str) -> None:
        """Ask the master where these services are, for the time when it is gone."""
        for service in services:
            with contextlib.suppress(
                Exception
            ):  # a master that ends in its answer makes rospy raise whatever it does
                name = rospy.resolve_name(service)
                self._addresses[service] = rosgraph.Master(rospy.get_name()).lookupService(name)

    def __call__(self, service: str) -> Tuple[bool, str]:
        """Call a service where it was last; if that fails, where the master says that it is now."""
        why = ""
        for address in dict.fromkeys((self._addresses.get(service, ""), "")):
            try:
                answer = _Proxy(service, address)()
                return answer.success, answer.message
            except (rospy.ServiceException, rospy.ROSException, OSError) as error:
                why = str(error)
        return False, why


class _Proxy(rospy.ServiceProxy):
    """A service at an address; if that is empty, the master is asked for it."""

    def __init__(self, service: str, address: str) -> None:
        super().__init__(service, Trigger)
        self._address = address

    def _get_service_uri(self, request: Any) -> Any:
        return self._address or super()._get_service_uri(request)


class WebNode:
    """Serves the page of the robot in this namespace."""

    def __init__(self, given: Dict[str, Any]) -> None:
        """Raises ConfigError if the address is wrong, or the robot's model."""
        self._settings = settings_for(given["listen"], tell=rospy.logwarn)
        self._topics = given["record"].split()
        self._node, self._slow = rospy.resolve_name(ROBOT), ""
        self._commands = PageCommands(given["max_delay"])
        self._phone = rospy.Publisher("phone/imu", Imu, queue_size=10, tcp_nodelay=True)
        delay_s = lambda: self._commands.link_s  # noqa: E731
        self._robot = TopicRobot(lambda *_: None, rospy.is_shutdown, given["robot"], delay_s, self._node)
        if self._robot.model is not None:
            self._robot.model.require_odometry()
        folder = Path(given["recordings"] or USUAL).expanduser()
        recording = BagRecording(folder, subscribe, self._recorded, rospy.Time.now)
        self._services = NodeServices()
        emergency = EmergencyStop(self._services)
        self._page = TopicPageRobot(
            self._robot, self._commands, emergency, recording, self._on_phone, lambda: self._slow
        )

    def run(self) -> None:
        """Serve until the shutdown; ConfigError or LinkError without aiohttp, motors or a good address."""
        from mrl_driver.apps.web.server import serve  # here, so that what is missing is one line of the log

        self._robot.subscribe(rospy.Subscriber)
        threading.Thread(target=self._look, daemon=True).start()
        try:
            serve(self._page, self._settings, self._ended, self._tell)
        finally:
            self._page.close()
        if self._robot.model is not None:
            self._robot.model.require_odometry()

    def _ended(self) -> str:
        """Return why the page is to end; empty while it is not."""
        if self._robot.model is not None and not self._robot.model.drives:
            return NO_MOTORS.words
        return "the node has ended" if rospy.is_shutdown() else ""

    def _tell(self, server: Any) -> None:
        """Print the links: on stdout, because anybody can read the log of a ROS system."""
        sys.stdout.write("\n".join(lines_for(self._settings, server.port, picture=True)) + "\n")
        sys.stdout.flush()
        rospy.loginfo(f"the page is served at port {server.port}")

    def _on_phone(self, reading: PhoneReading) -> None:
        self._phone.publish(phone_imu.message(reading, rospy.Time.now()))

    def _recorded(self) -> Set[str]:
        """The topics of the robot's node, this node and the parameter; ConfigError if the master does not answer."""
        own = {self._node, rospy.get_name()}
        try:
            published, subscribed, _ = rosgraph.Master(rospy.get_name()).getSystemState()
        except (OSError, rosgraph.MasterException) as error:
            raise ConfigError(
                f"the ROS master does not answer, so the topics are not known: {error}"
            ) from None
        found = {name for name, nodes in (*published, *subscribed) if own.intersection(nodes)}
        found -= {name for name in found if name in NOT_RECORDED or name.startswith(f"{self._node}/")}
        return found | {rospy.resolve_name(name) for name in self._topics}

    def _look(self) -> None:
        """Look where the services of the stop are.

        Say, here and on the page, if the robot would drive on for too long when this node or its computer fails.
        """
        row = next(row for row in ROBOT_ROWS if row.name == "cmd_vel_timeout")
        name = f"{self._node}/{row.name}"
        while not rospy.is_shutdown():
            self._services.look(STOP, RELEASE)
            if self._robot.age_s < LOOK_S:
                try:
                    stops_s = rospy.get_param(name, row.default)
                except (OSError, rosgraph.MasterException):  # the master has gone: the page still works
                    stops_s = STOPS_S
                words = too_slow(name, stops_s)
                if words and words != self._slow:
                    rospy.logwarn(words)
                self._slow = words
            time.sleep(LOOK_S)


def too_slow(name: str, stops_s: float) -> str:
    """Return a warning if the robot's node stops the robot later than the page promises; empty if it does not."""
    if stops_s <= STOPS_S:
        return ""
    return (
        f"{name} is {stops_s:g} s, expected at most {STOPS_S:g} s: the robot drives on for that time if this page's "
        f"node fails; start robot_node with cmd_vel_timeout:={STOPS_S:g}"
    )


def subscribe(topic: str, take: Callable[[Any], None]) -> Unsubscribe:
    """Call `take` with each message of a topic, whatever its type; returns how to end that."""
    end: Unsubscribe = rospy.Subscriber(topic, rospy.AnyMsg, take, tcp_nodelay=True).unregister
    return end


main = node("web_node", PARAMETERS, lambda given: WebNode(given).run())
