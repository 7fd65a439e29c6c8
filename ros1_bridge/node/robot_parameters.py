"""Parameters of robot_node, each declared once, and the checks of one against another.  Pure, no ROS.

`description.launch_arguments` renders them into the launch files.
"""

import dataclasses
from typing import Any, Mapping, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.host import named_robots
from mrl_driver.protocol.table import BAUD
from mrl_driver.robot.models import BUILDS
from mrl_driver.robot.sonar import FARTHEST_M
from mrl_driver.safety.operator_delay import MAX_DELAY_S
from mrl_driver.safety.protective_zones import ZoneSettings, require_settings
from mrl_driver.safety.speed_limiter import AUTOMATIC, FASTEST_MANUAL_M_S, OPERATION_MODES
from mrl_driver.transport.address import require_port
from mrl_driver.transport.baud_rates import require_raisable

from .parameters import parameter, read, rows_of
from .tf_names import footprint_frame

BAUDS = (9600, 19200, 38400, 57600, 115200, 230400, 250000, 500000, 1000000)
_OWN = "0 uses the model's limit, which is also the maximum"
LEAST_RATE_HZ = 5.0  # Below this frame rate the ranges arrive too late for zones
PAUSE_S = 0.5  # Default of `cmd_vel_pause`
PARTS = ("odometry", "sonars", "commands", "status", "sensors")  # The parts that robot_node can have
WITHOUT_MOTORS = ("status", "sensors")
"""The parts that a board without motors can have: another node drives its robot."""
GROUPS = ("limits", "gains", "sonars")  # Namespaces in which dynamic_reconfigure keeps its own parameters


@dataclasses.dataclass(frozen=True)
class Parameters:
    """Checked values: the parameters, and the id of the robot that is meant."""

    port: str = parameter(
        None,
        "Serial port of the board, such as /dev/ttyACM0, tcp://HOST:PORT, or a name of mrl names with its robot id",
    )
    port_timeout: float = parameter(
        0.0, "Wait this long for a port that cannot be opened yet, at least 2 s", (0, 600), "s"
    )
    baud: int = parameter(BAUD, "Speed of the serial port", unit="baud", choices=BAUDS)
    fast: bool = parameter(
        False, "Raise the serial link to 500000 baud if board and adapter can; rates above 200 Hz need it"
    )
    robot: str = parameter(
        "auto", "Model name, path of a robot's .yaml file, or auto: chosen by the robot id of the board"
    )
    build: str = parameter(
        "",
        "Firmware build of a 2013 board: sonar or environment; empty uses the model's, or the one for the robot id",
        choices=("", *BUILDS),
    )
    odom_frame: str = parameter("odom", "Frame of the pose")
    base_frame: str = parameter("base_link", "Frame of the robot; sonar frames use its prefix")
    publish_tf: bool = parameter(True, "Publish odom_frame to base_frame on /tf; set false if an EKF does")
    publish_mounts: bool = parameter(
        True, "Publish base_frame to the sonars; set false if robot_state_publisher does"
    )
    publish_imu_mount: bool = parameter(
        True, "Publish base_frame to imu_link; set false if robot_state_publisher does"
    )
    publish_footprint: bool = parameter(False, "Publish base_frame to base_footprint, on the floor below it")
    rate: float = parameter(50.0, "Rate of odom and of the board's stream", (1, 400), "Hz")
    imu: bool = parameter(True, "Use the board's IMU, if it has one: heading from its gyro, and topics")
    imu_rate: float = parameter(50.0, "Rate of imu/data and imu/data_raw", (25, 100), "Hz")
    cmd_vel_timeout: float = parameter(
        0.5, "The robot stops if no cmd_vel arrives for this long", (0.05, 10), "s"
    )
    cmd_vel_pause: float = parameter(
        PAUSE_S,
        "After a stop or a start, refuse a source of cmd_vel until it was silent or zero for this long; 0 turns it off",
        (0, 5),
        "s",
    )
    max_command_delay: float = parameter(
        MAX_DELAY_S,
        "Refuse an operator's command that arrives this much later than his fastest; 0 turns it off",
        (0, 60),
        "s",
    )
    max_linear_speed: float = parameter(0.0, f"Highest speed forward or back; {_OWN}", (0, 10), "m/s")
    max_angular_speed: float = parameter(0.0, f"Highest yaw rate; {_OWN}", (0, 100), "rad/s")
    max_linear_acceleration: float = parameter(0.0, f"Limit for speeding up only; {_OWN}", (0, 100), "m/s2")
    max_angular_acceleration: float = parameter(0.0, f"The same for turns; {_OWN}", (0, 1000), "rad/s2")
    operation_mode: str = parameter(
        AUTOMATIC,
        "Mode at the start; in manual mode the robot is slow and takes no goals",
        choices=OPERATION_MODES,
    )
    manual_speed: float = parameter(
        0.0,
        f"Highest speed in manual mode; 0 uses half the model's limit, at most {FASTEST_MANUAL_M_S:g} m/s",
        (0, FASTEST_MANUAL_M_S),
        "m/s",
    )
    emergency_stop: bool = parameter(
        False, "The emergency stop is latched at the start; the services stop and release_stop set it"
    )
    motors_enabled: bool = parameter(
        True, "The motors follow commands from the start; the service enable_motors sets it"
    )
    clear_range: float = parameter(
        0.0,
        "Sonars report at most this distance, as max_range; 0: +Inf if they see nothing",
        (0, FARTHEST_M),
        "m",
    )
    reconnect: bool = parameter(True, "Search for a lost port; false ends the node")
    record: str = parameter(
        "",
        "File for a recording of all bytes; a file that exists is kept, and the new name gets a number; empty: none",
    )
    ignore_battery: bool = parameter(False, "Start, and keep driving, with an empty battery")
    allow_calibration: bool = parameter(False, "Offer the service calibrate, which turns the wheels")
    allow_gains: bool = parameter(False, "Offer gains in dynamic_reconfigure; the motor board stores them")
    parts: str = parameter(
        "all", "Parts that the node runs: all, or some of odometry, sonars, commands, status, sensors"
    )
    zones: str = parameter(
        "none",
        "Sensors that watch the warning zones and the protective zone",
        choices=("none", "sonars", "scan", "both"),
    )
    planner: str = parameter(
        "move_base/TrajectoryPlannerROS",
        "Planner whose max_vel_x follows the zones (its dynamic_reconfigure server), or none",
    )
    zone_warning: float = parameter(
        0.5,
        "Obstacles closer to the body than this slow the robot; the distance grows with speed",
        (0, 10),
        "m",
    )
    zone_protective: float = parameter(
        0.2,
        "Obstacles closer to the body than this stop the robot; the distance grows with speed",
        (0, 10),
        "m",
    )
    zone_slow_speed: float = parameter(0.1, "Lowest speed that the warning zone sets", (0.01, 10), "m/s")
    zone_braking: float = parameter(
        0.0,
        "Braking deceleration the robot always reaches; 0 uses the model's linear acceleration",
        (0, 100),
        "m/s2",
    )
    zone_reaction: float = parameter(0.5, "Twice the delays of sensors and commands together", (0, 10), "s")
    zone_hysteresis: float = parameter(
        0.05, "A zone is clear again if the free distance exceeds it by this much", (0, 1), "m"
    )
    zone_clearance: float = parameter(
        0.05, "Obstacles within this distance of the swept path count as in the way", (0, 1), "m"
    )
    zone_outer: float = parameter(
        0.0,
        "Obstacles closer to the body than this are reported; the distance grows with speed; 0 uses twice zone_warning",
        (0, 20),
        "m",
    )
    zone_outer_speed: float = parameter(
        0.0, "Lowest speed that the outer warning zone sets; 0: it does not slow the robot", (0, 10), "m/s"
    )
    zone_inf_is_free: bool = parameter(
        False, "A laser's +Inf means that nothing is in range; false: it is not a reading, as of an RPLIDAR"
    )
    robot_id: Optional[int] = None
    """Robot id that the name given as port stands for; None if it is not a name, or one without."""
    virtual: Optional[bool] = None
    """Whether that robot is virtual; None if the port is not a name."""

    def has(self, part: str) -> bool:
        """Whether the node has this part (one of `PARTS`)."""
        return part in split_parts(self.parts)

    @property
    def zones_by_sonar(self) -> bool:
        """Whether the zones use sonars."""
        return self.zones in ("sonars", "both")

    @property
    def zones_by_laser(self) -> bool:
        """Whether the zones use a laser."""
        return self.zones in ("scan", "both")

    def zone_settings(self, braking_m_s2: float) -> ZoneSettings:
        """The zone settings; `braking_m_s2` is used if `zone_braking` is 0."""
        return ZoneSettings(
            self.zone_warning,
            self.zone_protective,
            self.zone_slow_speed,
            self.zone_braking or braking_m_s2,
            self.zone_reaction,
            self.zone_hysteresis,
            self.zone_clearance,
            self.zone_outer,
            self.zone_outer_speed,
        )


ROWS = rows_of(Parameters)


def without_motors(parameters: Parameters) -> Parameters:
    """The parameters for a board without motors; ConfigError if it can have none of the parts, or zones are on."""
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
    return dataclasses.replace(parameters, parts=", ".join(parts))


def check(given: Mapping[str, Any], namespace: str) -> Parameters:
    """The checked parameters of robot_node.

    `given` is what the parameter server has for the node's full name `namespace`.  ConfigError if a value is missing,
    of the wrong type or out of range, or a name is unknown.
    """
    given = {name: value for name, value in given.items() if name not in GROUPS}
    if isinstance(given.get("parts"), list):
        given["parts"] = ", ".join(map(str, given["parts"]))
    values = read(ROWS, given, namespace)
    try:
        target = named_robots.target_of(values["port"])
        values["port"], values["robot_id"], values["virtual"] = target.port, target.id, target.virtual
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
    footprint = footprint_frame(values["base_frame"])
    for name in ("base_frame", "odom_frame"):
        if values["publish_footprint"] and values[name] == footprint:
            raise ConfigError(
                f"parameter {namespace}/{name} is {footprint!r}, which publish_footprint publishes below the robot; "
                "set that to false, or give another frame"
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


def _require_zones(parameters: Parameters, namespace: str) -> None:
    """Raise ConfigError if zone parameters contradict each other, or the stream is too slow for zones."""
    if parameters.zones == "none":
        return
    if parameters.rate < LEAST_RATE_HZ:
        raise ConfigError(
            f"parameter {namespace}/rate is {parameters.rate:g}, expected {LEAST_RATE_HZ:g} Hz or more with zones"
        )
    try:
        require_settings(parameters.zone_settings(braking_m_s2=1.0))
    except ConfigError as error:
        raise ConfigError(f"parameters {namespace}/zone_*: {error}") from None
