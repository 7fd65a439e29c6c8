"""Parameters that dynamic_reconfigure changes while the node runs.  Their descriptions need no build."""

import math
from typing import Any, Dict, Mapping, MutableMapping, Sequence

import rospy

from mrl_driver.driver import Driver
from mrl_driver.errors import MrlError
from mrl_driver.protocol.table import INT16_MAX
from mrl_driver.robot.models import Limits, RobotModel
from ros1_bridge.control.commander import Commander
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.robot_parameters import GROUPS, ROWS, Parameters
from ros1_bridge.topics.publishers import Publishers

from .services import GAINS, Services

LIMITS = ("max_linear_speed", "max_angular_speed", "max_linear_acceleration", "max_angular_acceleration")
LOWEST = 0.01  # Lowest limit that may be set at run time, unless a parameter has set a lower one
AT_START = -1  # Level of the call that a server makes at its start


class Description:
    """Replaces the generated module that `dynamic_reconfigure.server.Server` expects."""

    def __init__(self, values: Sequence[Row]) -> None:
        self.defaults = {value.name: value.default for value in values}
        self.min = {value.name: value.low for value in values}
        self.max = {value.name: value.high for value in values}
        self.config_description = {
            "name": "Default",
            "type": "",
            "id": 0,
            "parent": 0,
            "state": True,
            "groups": [],
            "parameters": [_parameter(value) for value in values],
        }


def _parameter(value: Row) -> Dict[str, Any]:
    kind = "int" if value.kind is int else "double"
    return {"name": value.name, "type": kind, "level": 1, "description": value.text, "edit_method": ""}


def limits_description(model: RobotModel, start: Limits) -> Description:
    """Speed and acceleration limits, from 0.01 or the start if that is less; the model's limits are the maximum."""
    texts = (
        "Highest speed forward or back [m/s]",
        "Highest yaw rate [rad/s]",
        "Speeding up [m/s2]",
        "Speeding up a turn [rad/s2]",
    )
    each = zip(LIMITS, start, model.limits, texts)
    return Description(
        [Row(name, float, now, "", text, min(LOWEST, now), most) for name, now, most, text in each]
    )


def limits_of(config: MutableMapping[str, Any], before: Limits) -> Limits:
    """The limits of a configuration; a NaN, which dynamic_reconfigure lets through, keeps the limit of `before`."""
    for name, limit in zip(LIMITS, before):
        if math.isnan(config[name]):
            config[name] = limit
    return Limits(*(config[name] for name in LIMITS), *before[len(LIMITS) :])


def gains_description(gains: Mapping[str, int]) -> Description:
    """Gains of the motor board, which stores each change; `gains` are those at the start."""
    text = "gain of the motor board; stored there"
    kinds = zip(GAINS, ("Proportional", "Integral", "Derivative"))
    return Description(
        [Row(name, int, gains[name], "", f"{kind} {text}", 0, INT16_MAX) for name, kind in kinds]
    )


class Reconfigure:
    """The servers of one node: `limits`, `sonars` and `gains`."""

    def __init__(
        self,
        driver: Driver,
        commander: Commander,
        services: Services,
        publishers: Publishers,
        parameters: Parameters,
    ) -> None:
        self._driver, self._commander, self._services = driver, commander, services
        self._publishers, self._parameters = publishers, parameters
        self._servers: Dict[str, Any] = {}
        self._gains: Dict[str, int] = {}

    def offer(self, limits: Limits) -> None:
        """Start the servers, which takes a second; `limits` are those at the start."""
        try:
            for group in GROUPS:  # values of an earlier run must not override this run's parameters
                if rospy.has_param(f"~{group}"):
                    rospy.delete_param(f"~{group}")
            model = self._driver.model
            assert model is not None
            self._serve("limits", limits_description(model, limits), self._on_limits)
            if model.sonars and self._parameters.has("sonars"):
                row = next(row for row in ROWS if row.name == "clear_range")
                sonars = Description([row._replace(default=self._publishers.clear_range_m)])
                self._serve("sonars", sonars, self._on_sonars)
            if self._parameters.allow_gains:
                self._gains = self._services.gains()
                self._serve("gains", gains_description(self._gains), self._on_gains)
        except MrlError as error:
            if not rospy.is_shutdown():
                rospy.logerr(f"gains are not offered, because those of the board cannot be read: {error}")
        except (rospy.ROSException, OSError):  # the shutdown has closed a service, or the master, meanwhile
            if not rospy.is_shutdown():
                raise

    def _serve(self, group: str, description: Description, callback: Any) -> None:
        from dynamic_reconfigure.server import Server  # late: the import takes most of the second

        class Numbers(Server):
            def update_configuration(self, changes: Mapping[str, Any]) -> Any:
                for name, value in changes.items():
                    if isinstance(value, str):
                        raise rospy.ServiceException(f"{name} is {value!r}, expected a number")
                return super().update_configuration(changes)

        self._servers[group] = Numbers(description, callback, group)

    def _on_limits(self, config: Any, _level: int) -> Any:
        before = self._commander.limits
        self._commander.limits = limits = limits_of(config, before)
        for name, old, new in zip(LIMITS, before, limits):
            if new != old:
                rospy.set_param(f"~{name}", new)  # for a respawn of the node
        return config

    def _on_sonars(self, config: Any, level: int) -> Any:
        if math.isnan(config["clear_range"]):  # dynamic_reconfigure lets it through
            config["clear_range"] = self._publishers.clear_range_m
        self._publishers.clear_range_m = config["clear_range"]
        if level != AT_START:
            rospy.set_param("~clear_range", config["clear_range"])  # for a respawn of the node
        return config

    def _on_gains(self, config: Any, level: int) -> Any:
        if level != AT_START:  # at the start the board keeps its gains
            done, text = self._services.set_gains(*(config[name] for name in GAINS))
            (rospy.loginfo if done else rospy.logerr)(text)
            if done:
                self._gains = {name: config[name] for name in GAINS}
            config.update(self._gains)
        return config
