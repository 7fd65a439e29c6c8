"""Parameters of all nodes except robot_node, one row each.  Pure, no ROS."""

from mrl_driver.navigation.goal_seeker import PATIENCE_S
from mrl_driver.terminal.teleop_keys import ANGULAR_RAD_S, LINEAR_M_S
from ros1_bridge.teleop.joystick_mapping import LAYOUTS

from .parameters import Row

_SLOWEST, _FASTEST_M_S, _FASTEST_RAD_S = 0.01, 10.0, 100.0


def _speeds(linear: str, angular: str, linear_m_s: float = 0.25, angular_rad_s: float = 0.9) -> tuple:
    return (
        Row("linear_speed", float, linear_m_s, "m/s", linear, _SLOWEST, _FASTEST_M_S),
        Row("angular_speed", float, angular_rad_s, "rad/s", angular, _SLOWEST, _FASTEST_RAD_S),
    )


GO_TO_GOAL = (
    *_speeds("Speed on free ways", "Yaw rate"),
    Row("avoid", bool, True, "", "Go around what the sonars see"),
    Row(
        "patience", float, PATIENCE_S, "s", "A goal that comes no nearer for so long is aborted", 1.0, 3600.0
    ),
)
WORLD_NODE = (
    Row("world", str, "room", "", "World by name, or path of a .yaml"),
    Row("world_name", str, "world", "", "Name by which the boards share it"),
    Row("only", str, "", "", "Serve this robot alone, without its name as namespace; empty: all robots"),
    Row("prefix", str, "", "", "Goes before that robot's frames"),
    Row("map_frame", str, "map", "", "Frame of the map"),
    Row("resolution", float, 0.025, "m", "Side of a map cell", 0.005, 1.0),
    Row("localise", bool, True, "", "Publish the true map to odom on /tf; false beside amcl or gmapping"),
)
TELEOP_KEYBOARD = _speeds("Speed forward and back", "Yaw rate", LINEAR_M_S, ANGULAR_RAD_S)
TELEOP_JOYSTICK = (
    Row("layout", str, "ps3", "", "Which button does what", choices=tuple(LAYOUTS)),
    *_speeds("Speed at full deflection", "Yaw rate at full deflection"),
)
