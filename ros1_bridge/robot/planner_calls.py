"""A planner's parameters and its dynamic_reconfigure service, as plain functions for `PlannerLimit`."""

from typing import Any, Dict, Mapping, Optional, Tuple

from ros1_bridge.control.planner_limit import PlannerLimit

MEMORY = "zone_limit"
"""Parameter in the planner's namespace: the speed set and the planner's own, while a zone is entered."""


def limit_of(planner: str, ros: Any) -> PlannerLimit:
    """The highest speed of a planner, such as `move_base/TrajectoryPlannerROS`.

    Args:
        planner: name of its dynamic_reconfigure server, which keeps its values on the parameter server.
        ros: the module rospy.
    """
    from dynamic_reconfigure.encoding import decode_config, encode_config
    from dynamic_reconfigure.srv import Reconfigure

    service = ros.ServiceProxy(f"{planner}/set_parameters", Reconfigure)
    memory = f"{planner}/{MEMORY}"

    def configure(values: Dict[str, float]) -> Mapping[str, Any]:
        if not values:  # a call without values would make the planner begin again
            return dict(ros.get_param(planner))
        return dict(decode_config(service(encode_config(values)).config))

    def store(pair: Optional[Tuple[float, float]]) -> None:
        if pair is not None:
            ros.set_param(memory, list(pair))
        elif ros.has_param(memory):
            ros.delete_param(memory)

    return PlannerLimit(configure, store, ros.get_param(memory, None))
