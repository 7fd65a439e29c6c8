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
    *_speeds("Speed on a free path", "Yaw rate"),
    Row("avoid", bool, True, "", "Avoid obstacles that the sonars see"),
    Row(
        "patience",
        float,
        PATIENCE_S,
        "s",
        "Abort the goal if the robot comes no closer for this long",
        1.0,
        3600.0,
    ),
)
WORLD_NODE = (
    Row("world", str, "room", "", "Name of a world, or path of a .yaml file"),
    Row("world_name", str, "world", "", "Name under which the boards share the world"),
    Row("only", str, "", "", "Serve only this robot, without its name as namespace; empty: all robots"),
    Row("prefix", str, "", "", "Prefix of that robot's frames"),
    Row("map_frame", str, "map", "", "Frame of the map"),
    Row("resolution", float, 0.025, "m", "Side of a map cell", 0.005, 1.0),
    Row(
        "localise", bool, True, "", "Publish the true map to odom on /tf; set false if amcl or gmapping does"
    ),
)
TELEOP_KEYBOARD = _speeds("Speed forward and back", "Yaw rate", LINEAR_M_S, ANGULAR_RAD_S)
TELEOP_JOYSTICK = (
    Row("layout", str, "ps3", "", "Which button does what", choices=tuple(LAYOUTS)),
    *_speeds("Speed at full deflection", "Yaw rate at full deflection"),
)
