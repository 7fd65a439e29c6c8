"""Parameters of robot_node: one row each, and the checks of one parameter against another.  Pure, no ROS."""

from typing import Any, Mapping, NamedTuple, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.host import named_robots
from mrl_driver.protocol.table import BAUD
from mrl_driver.robot.models import BUILDS
from mrl_driver.robot.sonar import FARTHEST_M
from mrl_driver.safety.operation_mode import AUTOMATIC, FASTEST_MANUAL_M_S, OPERATION_MODES
from mrl_driver.safety.operator_delay import MAX_DELAY_S
from mrl_driver.safety.protective_zones import ZoneSettings, require_settings
from mrl_driver.transport.address import require_port
from mrl_driver.transport.baud_rates import require_raisable

from .parameters import Row, read

BAUDS = (9600, 19200, 38400, 57600, 115200, 230400, 250000, 500000, 1000000)
_OWN = "0 uses the model's limit, which is also the maximum"
LEAST_RATE_HZ = 5.0
"""Below this frame rate the ranges arrive too late for zones."""
PAUSE_S = 0.5
"""Default of `cmd_vel_pause`."""

ROWS = (
    Row(
        "port",
        str,
        None,
        "",
        "Serial port of the board, such as /dev/ttyACM0, tcp://HOST:PORT, or a name of mrl names with its robot id",
    ),
    Row(
        "port_timeout",
        float,
        0.0,
        "s",
        "Wait this long for a port that cannot be opened yet, at least 2 s",
        0.0,
        600.0,
    ),
    Row("baud", int, BAUD, "baud", "Speed of the serial port", choices=BAUDS),
    Row(
        "fast",
        bool,
        False,
        "",
        "Raise the serial link to 500000 baud if board and adapter can; rates above 200 Hz need it",
    ),
    Row(
        "robot",
        str,
        "auto",
        "",
        "Model name, path of a robot's .yaml file, or auto: chosen by the robot id of the board",
    ),
    Row(
        "build",
        str,
        "",
        "",
        "Firmware build of a 2013 board: sonar or environment; empty uses the model's, or the one for the robot id",
        choices=("", *BUILDS),
    ),
    Row("odom_frame", str, "odom", "", "Frame of the pose"),
    Row("base_frame", str, "base_link", "", "Frame of the robot; sonar frames use its prefix"),
    Row("publish_tf", bool, True, "", "Publish odom_frame to base_frame on /tf; set false if an EKF does"),
    Row(
        "publish_mounts",
        bool,
        True,
        "",
        "Publish base_frame to the sonars; set false if robot_state_publisher does",
    ),
    Row(
        "publish_imu_mount",
        bool,
        True,
        "",
        "Publish base_frame to imu_link; set false if robot_state_publisher does",
    ),
    Row("rate", float, 50.0, "Hz", "Rate of odom and of the board's stream", 1.0, 400.0),
    Row("imu", bool, True, "", "Use the board's IMU, if it has one: heading from its gyro, and topics"),
    Row("imu_rate", float, 50.0, "Hz", "Rate of imu/data and imu/data_raw", 25.0, 100.0),
    Row(
        "cmd_vel_timeout", float, 0.5, "s", "The robot stops if no cmd_vel arrives for this long", 0.05, 10.0
    ),
    Row(
        "cmd_vel_pause",
        float,
        PAUSE_S,
        "s",
        "After a stop or a start, refuse a source of cmd_vel until it was silent or zero for this long; 0 turns it off",
        0.0,
        5.0,
    ),
    Row(
        "max_command_delay",
        float,
        MAX_DELAY_S,
        "s",
        "Refuse an operator's command that arrives this much later than his fastest; 0 turns it off",
        0.0,
        60.0,
    ),
    Row("max_linear_speed", float, 0.0, "m/s", f"Highest speed forward or back; {_OWN}", 0.0, 10.0),
    Row("max_angular_speed", float, 0.0, "rad/s", f"Highest yaw rate; {_OWN}", 0.0, 100.0),
    Row("max_linear_acceleration", float, 0.0, "m/s2", f"Limit for speeding up only; {_OWN}", 0.0, 100.0),
    Row("max_angular_acceleration", float, 0.0, "rad/s2", f"The same for turns; {_OWN}", 0.0, 1000.0),
    Row(
        "operation_mode",
        str,
        AUTOMATIC,
        "",
        "Mode at the start; in manual mode the robot is slow and takes no goals",
        choices=OPERATION_MODES,
    ),
    Row(
        "manual_speed",
        float,
        0.0,
        "m/s",
        f"Highest speed in manual mode; 0 uses half the model's limit, at most {FASTEST_MANUAL_M_S:g} m/s",
        0.0,
        FASTEST_MANUAL_M_S,
    ),
    Row(
        "clear_range",
        float,
        0.0,
        "m",
        "Sonars report at most this distance, as max_range; 0: +Inf if they see nothing",
        0.0,
        FARTHEST_M,
    ),
    Row("reconnect", bool, True, "", "Search for a lost port; false ends the node"),
    Row(
        "record",
        str,
        "",
        "",
        "File for a recording of all bytes; a file that exists is kept, and the new name gets a number; empty: none",
    ),
    Row("ignore_battery", bool, False, "", "Start, and keep driving, with an empty battery"),
    Row("allow_calibration", bool, False, "", "Offer the service calibrate, which turns the wheels"),
    Row("allow_gains", bool, False, "", "Offer gains in dynamic_reconfigure; the motor board stores them"),
    Row(
        "parts",
        str,
        "all",
        "",
        "Parts that the node runs: all, or some of odometry, sonars, commands, status, sensors",
    ),
    Row(
        "zones",
        str,
        "none",
        "",
        "Sensors that watch the warning zones and the protective zone",
        choices=("none", "sonars", "scan", "both"),
    ),
    Row(
        "planner",
        str,
        "move_base/TrajectoryPlannerROS",
        "",
        "Planner whose max_vel_x follows the zones (its dynamic_reconfigure server), or none",
    ),
    Row(
        "zone_warning",
        float,
        0.5,
        "m",
        "Obstacles closer to the body than this slow the robot; the distance grows with speed",
        0.0,
        10.0,
    ),
    Row(
        "zone_protective",
        float,
        0.2,
        "m",
        "Obstacles closer to the body than this stop the robot; the distance grows with speed",
        0.0,
        10.0,
    ),
    Row("zone_slow_speed", float, 0.1, "m/s", "Lowest speed that the warning zone sets", 0.01, 10.0),
    Row(
        "zone_braking",
        float,
        0.0,
        "m/s2",
        "Braking deceleration the robot always reaches; 0 uses the model's linear acceleration",
        0.0,
        100.0,
    ),
    Row("zone_reaction", float, 0.5, "s", "Twice the delays of sensors and commands together", 0.0, 10.0),
    Row(
        "zone_hysteresis",
        float,
        0.05,
        "m",
        "A zone is clear again if the free distance exceeds it by this much",
        0.0,
        1.0,
    ),
    Row(
        "zone_clearance",
        float,
        0.05,
        "m",
        "Obstacles within this distance of the swept path count as in the way",
        0.0,
        1.0,
    ),
    Row(
        "zone_outer",
        float,
        0.0,
        "m",
        "Obstacles closer to the body than this are reported; the distance grows with speed; 0 uses twice zone_warning",
        0.0,
        20.0,
    ),
    Row(
        "zone_outer_speed",
        float,
        0.0,
        "m/s",
        "Lowest speed that the outer warning zone sets; 0: it does not slow the robot",
        0.0,
        10.0,
    ),
)
PARTS = ("odometry", "sonars", "commands", "status", "sensors")
"""The parts that robot_node can have."""
GROUPS = ("limits", "gains", "sonars")
"""Namespaces in which dynamic_reconfigure keeps its own parameters."""


class Parameters(NamedTuple):
    """Checked values, named as in `ROWS`, and `robot_id`; `cmd_vel_timeout` in seconds."""

    port: str
    port_timeout: float
    baud: int
    fast: bool
    robot: str
    build: str
    odom_frame: str
    base_frame: str
    publish_tf: bool
    publish_mounts: bool
    publish_imu_mount: bool
    rate: float
    imu: bool
    imu_rate: float
    cmd_vel_timeout: float
    cmd_vel_pause: float
    max_command_delay: float
    max_linear_speed: float
    max_angular_speed: float
    max_linear_acceleration: float
    max_angular_acceleration: float
    operation_mode: str
    manual_speed: float
    clear_range: float
    reconnect: bool
    record: str
    ignore_battery: bool
    allow_calibration: bool
    allow_gains: bool
    parts: str
    zones: str
    planner: str
    zone_warning: float
    zone_protective: float
    zone_slow_speed: float
    zone_braking: float
    zone_reaction: float
    zone_hysteresis: float
    zone_clearance: float
    zone_outer: float
    zone_outer_speed: float
    robot_id: Optional[int] = None
    """Robot id that the name given as port stands for; None if it is not a name, or one without."""

    def has(self, part: str) -> bool:
        """Whether the node has this part (one of `PARTS`)."""
        return part in split_parts(self.parts)


WITHOUT_MOTORS = ("status", "sensors")
"""The parts that a board without motors can have: another node drives its robot."""


def without_motors(parameters: Parameters) -> Parameters:
    """The parameters for a board without motors: of the parts, those that it can have.

    Raises:
        ConfigError: zones are on, or no part is left.
    """
    parts = [name for name in split_parts(parameters.parts) if name in WITHOUT_MOTORS]
    if not parts:
        raise ConfigError(
            f"parameter parts is {parameters.parts!r}, but this board has no motors, expected all, or some of "
            f"{', '.join(WITHOUT_MOTORS)}"
        )
    if parameters.zones != "none":
        raise ConfigError(
            f"parameter zones is {parameters.zones}, but this board has no motors, expected none"
        )
    return parameters._replace(parts=", ".join(parts))


def check(given: Mapping[str, Any], namespace: str) -> Parameters:
    """The checked parameters of robot_node.

    Args:
        given: name to value, as the parameter server returns `~`.
        namespace: the node's full name, for error messages.

    Raises:
        ConfigError: a value is missing, of the wrong type or out of range, or a name is unknown.
    """
    given = {name: value for name, value in given.items() if name not in GROUPS}
    if isinstance(given.get("parts"), list):
        given["parts"] = ", ".join(map(str, given["parts"]))
    values = read(ROWS, given, namespace)
    try:
        target = named_robots.target_of(values["port"])
        values["port"], values["robot_id"] = target.port, target.id
        require_port(values["port"])
        if values["fast"]:
            require_raisable(values["port"], values["baud"])
    except ConfigError as error:
        raise ConfigError(f"parameter {namespace}/{error}") from None
    if values["odom_frame"] == values["base_frame"]:
        got = values["base_frame"]
        raise ConfigError(
            f"parameter {namespace}/base_frame is {got!r}, expected a frame other than odom_frame"
        )
    parameters = Parameters(**values)
    _require_parts(parameters, namespace)
    _require_zones(parameters, namespace)
    return parameters


def split_parts(text: str) -> Tuple[str, ...]:
    """The parts in a list separated by commas or spaces; `all` means every part."""
    return PARTS if text.strip() == "all" else tuple(text.replace(",", " ").split())


def _require_parts(parameters: Parameters, namespace: str) -> None:
    named = split_parts(parameters.parts)
    unknown = [name for name in named if name not in PARTS]
    if unknown or not named:
        got = f"{unknown[0]!r} in {parameters.parts!r}" if unknown else repr(parameters.parts)
        raise ConfigError(
            f"parameter {namespace}/parts is {got}, expected all, or some of {', '.join(PARTS)}"
        )
    if parameters.zones != "none" and "commands" not in named:
        raise ConfigError(
            f"parameter {namespace}/zones needs the part commands, expected it in parts or zones none"
        )


def zone_sensors(parameters: Parameters) -> Tuple[bool, bool]:
    """Whether the zones use sonars, and whether they use a laser."""
    return parameters.zones in ("sonars", "both"), parameters.zones in ("scan", "both")


def zone_settings(parameters: Parameters, braking_m_s2: float) -> ZoneSettings:
    """The zone settings from the parameters."""
    return ZoneSettings(
        parameters.zone_warning,
        parameters.zone_protective,
        parameters.zone_slow_speed,
        braking_m_s2,
        parameters.zone_reaction,
        parameters.zone_hysteresis,
        parameters.zone_clearance,
        parameters.zone_outer,
        parameters.zone_outer_speed,
    )


def _require_zones(parameters: Parameters, namespace: str) -> None:
    """Check the zone parameters.

    Raises:
        ConfigError: the parameters contradict each other, or the stream is too slow for zones.
    """
    if parameters.zones == "none":
        return
    if parameters.rate < LEAST_RATE_HZ:
        raise ConfigError(
            f"parameter {namespace}/rate is {parameters.rate:g}, expected {LEAST_RATE_HZ:g} Hz or more with zones"
        )
    try:
        require_settings(zone_settings(parameters, parameters.zone_braking or 1.0))
    except ConfigError as error:
        raise ConfigError(f"parameters {namespace}/zone_*: {error}") from None
