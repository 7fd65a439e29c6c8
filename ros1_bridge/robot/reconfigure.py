"""Makes the descriptions for dynamic_reconfigure in code, so that nothing has to be built.  Pure."""

import math
from typing import Any, Dict, List, Mapping, MutableMapping, Sequence

from mrl_driver.protocol.table import INT16_MAX
from mrl_driver.robot.models import Limits, RobotModel
from ros1_bridge.node.parameters import Row
from ros1_bridge.node.robot_parameters import ROWS

LIMITS = ("max_linear_speed", "max_angular_speed", "max_linear_acceleration", "max_angular_acceleration")
LOWEST = 0.01
"""Lowest limit that may be set at run time, unless a parameter has set a lower one."""


class Description:
    """Replaces the generated module that `dynamic_reconfigure.server.Server` expects."""

    all_level = 1

    def __init__(self, values: Sequence[Row]) -> None:
        self.defaults = {value.name: value.default for value in values}
        self.min = {value.name: value.low for value in values}
        self.max = {value.name: value.high for value in values}
        self.level = {value.name: 1 for value in values}
        self.config_description = _group([_parameter(value) for value in values])


def limits_description(model: RobotModel, start: Limits) -> Description:
    """Speed and acceleration limits, from 0.01 or the start if that is less; the model's limits are the maximum."""
    texts = (
        "Highest speed forward or back [m/s]",
        "Highest yaw rate [rad/s]",
        "Speeding up [m/s2]",
        "Speeding up a turn [rad/s2]",
    )
    return Description(
        tuple(
            Row(name, float, begin, "", text, min(LOWEST, begin), most)
            for name, begin, most, text in zip(LIMITS, start, model.limits, texts)
        )
    )


def limits_of(config: MutableMapping[str, Any], before: Limits) -> Limits:
    """The limits of a configuration; a NaN, which dynamic_reconfigure lets through, keeps the limit of `before`."""
    for name, limit in zip(LIMITS, before):
        if math.isnan(config[name]):
            config[name] = limit
    return Limits(*(config[name] for name in LIMITS), *before[len(LIMITS) :])


def gains_description(gains: Mapping[str, int]) -> Description:
    """Gains of the motor board, which stores each change; `gains` are those at the start."""
    return Description(
        tuple(
            Row(
                name,
                int,
                gains[name],
                "",
                f"{text} gain of the motor board; stored there",
                0,
                INT16_MAX,
            )
            for name, text in (("kp", "Proportional"), ("ki", "Integral"), ("kd", "Derivative"))
        )
    )


def sonars_description(clear_range_m: float) -> Description:
    """What the sonars report if nothing is in range."""
    (row,) = (row for row in ROWS if row.name == "clear_range")
    return Description((row._replace(default=clear_range_m),))


def _parameter(value: Row) -> Dict[str, Any]:
    kind = {int: "int", bool: "bool"}.get(value.kind, "double")
    return {
        "name": value.name,
        "type": kind,
        "ctype": kind,
        "cconsttype": f"const {kind}",
        "default": value.default,
        "min": value.low,
        "max": value.high,
        "level": 1,
        "description": value.text,
        "edit_method": "",
        "srcfile": __name__,
        "srcline": 0,
    }


def _group(parameters: List[Dict[str, Any]]) -> Dict[str, Any]:
    return {
        "name": "Default",
        "type": "",
        "id": 0,
        "parent": 0,
        "parentname": "",
        "parentclass": "",
        "class": "DEFAULT",
        "field": "default",
        "upper": "DEFAULT",
        "lower": "groups",
        "cstate": "true",
        "state": True,
        "groups": [],
        "parameters": parameters,
        "srcfile": __name__,
        "srcline": 0,
    }
