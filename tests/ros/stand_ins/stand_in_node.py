"""`python -m tests.ros.stand_ins.stand_in_node PACKAGE NODE ...` stands in for a node that Debian lacks.

It ends with a line if a private parameter is one that the real node does not know or take.  Otherwise it offers the
topics, services, actions and dynamic_reconfigure servers of the real node, as far as this machine has their types.
"""

import sys
from typing import Any, List, Mapping

import actionlib
import roslib.message
import rospy
from dynamic_reconfigure.server import Server

from mrl_driver.errors import ConfigError
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.run_node import run_node
from ros1_bridge.robot.reconfigure import Description
from tests.ros import stand_ins


class StandIn:
    """Offers what a table says."""

    def __init__(self, node: stand_ins.Table, given: Mapping[str, Any]) -> None:
        self._kept: List[Any] = []
        for name, kind in node.names("publishes").items():
            message = roslib.message.get_message_class(kind)
            if message is not None:
                self._kept.append(rospy.Publisher(name, message, queue_size=1))
        for name, kind in {**node.names("subscribes"), **stand_ins.inputs_of(node, given)}.items():
            message = roslib.message.get_message_class(kind)
            if message is not None:
                self._kept.append(rospy.Subscriber(name, message))
        for name, kind in node.names("services").items():
            service = roslib.message.get_service_class(kind)
            if service is not None:
                reply = service._response_class
                self._kept.append(rospy.Service(name, service, lambda _, reply=reply: reply()))
        for name, kind in node.names("actions").items():
            action = roslib.message.get_message_class(f"{kind}Action")
            server = actionlib.SimpleActionServer(name, action, lambda _: None, auto_start=False)
            server.start()
            self._kept.append(server)
        for place in node.rows.get("reconfigure", []):
            self._reconfigure(node, given, place.strip("~"))

    def _reconfigure(self, node: stand_ins.Table, given: Mapping[str, Any], space: str) -> None:
        """Serve the numbers of a namespace that have two bounds; values of the parameters at first."""
        group = stand_ins.group_at(node, given, space)
        rows = []
        for name, kind in group.items():
            words = kind.split() if isinstance(kind, str) else []
            if len(words) == 3 and words[0] in ("int", "double"):
                low, high = map(float, words[1:])
                number = int if words[0] == "int" else float
                start = given.get(space, {}).get(name, low) if space else given.get(name, low)
                rows.append(Row(name, number, number(start), "", name, number(low), number(high)))
        self._kept.append(Server(Description(rows), lambda config, _level: config, space))


def run(node: stand_ins.Table) -> None:
    """Serve until the shutdown.

    Raises:
        ConfigError: the real node does not know a parameter, or not its value.
    """
    given = rospy.get_param(rospy.get_name(), {})
    found = stand_ins.faults(node, given)
    if found:
        raise ConfigError(f"{node.package}/{node.node} refuses: {'; '.join(found)}")
    stand_in = StandIn(node, given)  # noqa: F841 - it lives as long as the node
    rospy.spin()


if __name__ == "__main__":
    known = stand_ins.table(*sys.argv[1:3])
    sys.exit(run_node(known.node.replace(".py", ""), lambda: run(known)))
