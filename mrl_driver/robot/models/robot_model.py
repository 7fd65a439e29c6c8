"""A robot model: geometry, limits, sonar poses and default board parameters of one kind of robot."""

import math
from functools import lru_cache
from typing import Dict, Mapping, NamedTuple, Optional, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.robot.chips import ATMEGA328P, CHIPS
from mrl_driver.robot.wiring import range_inputs

from .drives import AnyDrive, Base, Drive, NoDrive, kind_of
from .range_sensors import ANALOG, SONARS, SonarMount, wired_types

Vector = Tuple[float, float, float]
SONAR, ENVIRONMENT = "sonar", "environment"
BUILDS = (SONAR, ENVIRONMENT)
"""Builds of the firmware that a model may name.  2013 boards do not report theirs, and the second has gas, dust and
light sensors instead of sonars."""
SENSOR_BOARD_IDS = range(6, 11)
"""Robot ids of 2013 boards that carry environment sensors and do not drive the robot."""


class Noise(NamedTuple):
    """Errors of odometry.  The first two are random, new ones in each step; the others are standard deviations of
    scales that stay the same.  A key that a model's `noise` leaves out has the value in `ON_WHEELS` or `ON_TRACKS`.
    """

    wheel_m2_per_m: float
    """Variance of a wheel's distance, per distance."""
    turn_rad2_per_rad: float
    """Variance of the yaw from slip, per angle turned."""
    distance_scale_sd: float = 0.0
    """True distance per distance by the wheels."""
    wheel_ratio_sd: float = 0.0
    """Ratio of right to left wheel."""
    turn_scale_sd: float = 0.0
    """True turn per turn by the wheels: wheel separation and slip."""


ON_WHEELS = Noise(1e-5, 0.0, 0.01, 0.005, 0.01)
ON_TRACKS = Noise(4e-5, 2e-4, 0.01, 0.005, 0.1)
"""Before a calibration.  Random errors are estimated: 3 mm over 1 m on wheels, 6 mm on tracks, which also slip.  Scales
are too, from the squares of (Araujo 2012), which end as with wheels that differ by 0.1 % and a wheelbase that is
wrong by 1 %; the share of a turn that tracks lose depends on the floor, and may be a tenth."""


class Limits(NamedTuple):
    """Largest speeds and accelerations that the driver commands; they must not exceed the board's ceilings."""

    linear_m_s: float
    angular_rad_s: float
    linear_acceleration_m_s2: float
    angular_acceleration_rad_s2: float
    lateral_m_s: float = 0.0
    """Speed sideways, if the base can; 0 means as fast as forward."""
    braking_m_s2: float = 0.0
    """Deceleration of slower commands, also of zero; 0 means at once.  Stops are at once in any case."""
    curve_m_s2: float = 0.0
    """Acceleration to the inside of a curve, linear times angular speed; 0 means no limit."""


class Body(NamedTuple):
    """Outer dimensions and mass."""

    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    tracks: bool
    """It stands on tracks, not on wheels."""


class ServoMount(NamedTuple):
    """A servo: its range, and the joint that it turns, about the vertical axis of base_link unless it tilts."""

    servo: int
    """Servo of the wiring: 1 for the one at servo_1."""
    low_rad: float
    """Smallest angle."""
    high_rad: float
    """Largest angle; counter-clockwise, or downward for one that tilts."""
    low_us: float
    """Length of the pulses at low_rad; larger than high_us if the servo turns in the other direction."""
    high_us: float
    """Length of the pulses at high_rad."""
    speed_rad_s: float = 1.0
    """Largest speed."""
    tilts: bool = False
    """It turns about the axis to the left."""
    parent: str = ""
    """Name of the servo that carries it; without it, it stands on base_link."""
    x_m: float = 0.0
    """Place of the joint in base_link, or on the servo that carries it."""
    y_m: float = 0.0
    z_m: float = 0.0

    @property
    def us_per_rad(self) -> float:
        """Change of the pulses in a radian."""
        return (self.high_us - self.low_us) / (self.high_rad - self.low_rad)

    def pulse_us(self, angle_rad: float) -> float:
        """Return the length of the pulses at an angle."""
        return self.low_us + (angle_rad - self.low_rad) * self.us_per_rad

    def angle_rad(self, pulse_us: float) -> float:
        """Return the angle at a length of the pulses."""
        return self.low_rad + (pulse_us - self.low_us) / self.us_per_rad


class LaserMount(NamedTuple):
    """Mounting pose in base_link of a laser that lies flat; yaw counter-clockwise from forward.

    The default is that of the Hokuyo URG-04LX in the launch files of 2013.
    """

    x_m: float = 0.085
    y_m: float = 0.0
    z_m: float = 0.045
    yaw_deg: float = 0.0


class ImuMount(NamedTuple):
    """Mounting pose of the IMU in base_link, and its gyro's scale; the board reports whether a chip is fitted.

    The angles turn the chip's axes into those of base_link, about the fixed axes of base_link: roll first, then pitch,
    then yaw.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    roll_deg: float = 0.0
    pitch_deg: float = 0.0
    yaw_deg: float = 0.0
    gyro_scale: float = 1.0
    """True rate over measured rate, about the vertical axis of base_link."""
    gyro_scale_sd: float = 0.01
    """Standard deviation of `gyro_scale`; the default is a third of the tolerance in the data sheet of the MPU-6050."""

    def rotate(self, vector: Vector) -> Vector:
        """Return a vector in the chip's axes as one in the axes of base_link."""
        x, y, z = vector
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = _rotation(self.roll_deg, self.pitch_deg, self.yaw_deg)
        return xx * x + xy * y + xz * z, yx * x + yy * y + yz * z, zx * x + zy * y + zz * z


@lru_cache(maxsize=16)
def _rotation(roll_deg: float, pitch_deg: float, yaw_deg: float) -> Tuple[Vector, Vector, Vector]:
    """Return the rows of the rotation matrix; a reading is rotated many times a second by the same one."""
    roll, pitch, yaw = map(math.radians, (roll_deg, pitch_deg, yaw_deg))
    sr, cr, sp, cp, sy, cy = (f(angle) for angle in (roll, pitch, yaw) for f in (math.sin, math.cos))
    return (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


class Battery(NamedTuple):
    """Battery voltages of the states [V], and capacity [Ah]."""

    full_v: float
    """Charged."""
    low_v: float
    """Below it the driver warns."""
    empty_v: float
    """Below it the robot does not start."""
    off_v: float
    """Below it the motors' power is off."""
    capacity_ah: float

    def charge(self, volts: float) -> float:
        """Return the charge at a voltage: 0 when empty and 1 when full, not limited to them."""
        return (volts - self.empty_v) / (self.full_v - self.empty_v)


class RobotModel(NamedTuple):
    """One robot model; `board` maps parameter names (rows of `table.PARAMETERS`) to wire values."""

    name: str
    ids: Tuple[int, ...]
    drive: AnyDrive
    board: Dict[str, int]
    limits: Limits
    body: Body
    sonars: Dict[str, SonarMount]
    battery: Battery
    noise: Noise = ON_WHEELS
    build: str = ""
    """One of `BUILDS`; empty if the model names none.  `sonars` is empty for the environment build."""
    imu: ImuMount = ImuMount()
    laser: LaserMount = LaserMount()
    """Where a laser is, if one is fitted."""
    chip: str = ATMEGA328P.name
    """Chip of an H-bridge board, one of `chips.CHIPS`."""
    servos: Dict[str, ServoMount] = {}
    virtual: bool = False
    """No robot: a bare board calculates it."""

    @property
    def drives(self) -> bool:
        """The board drives the robot.  False for a board that only has sensors (`drive: none`)."""
        return not isinstance(self.drive, NoDrive)

    @property
    def base(self) -> Base:
        """The drive, for functions that need wheels; raise ConfigError if the board has no motors."""
        if isinstance(self.drive, NoDrive):
            raise ConfigError(
                f"robot {self.name} is a board without motors (drive: none): it has sensors, and something else "
                "drives its robot"
            )
        return self.drive

    def require_motors(self) -> None:
        """Raise ConfigError if the board has no motors."""
        _ = self.base

    @property
    def has_odometry(self) -> bool:
        """The board counts how the wheels turn.  False without motors, and for motors without encoders."""
        return self.drives and not self.board.get("no_encoders")

    def require_odometry(self) -> None:
        """Raise ConfigError if the board has no motors, or if they have no encoders."""
        self.require_motors()
        if not self.has_odometry:
            raise ConfigError(
                f"robot {self.name} has no odometry, because its motors have no encoders (wiring.no_encoders)"
            )

    @property
    def differential(self) -> Drive:
        """The drive, for functions that need two wheels or tracks; raise ConfigError for another drive type."""
        if not isinstance(self.base, Drive):
            raise ConfigError(
                f"robot {self.name} has a drive of kind {kind_of(self.drive)}, expected differential, tracked "
                "or skid: this is for robots with wheels on two sides, or tracks"
            )
        return self.base


def with_build(model: RobotModel, build: str) -> RobotModel:
    """Return the model with this build instead of its own; raise ConfigError if the model cannot have it."""
    if not build or build == model.build:
        return model
    if model.build == ENVIRONMENT:
        raise ConfigError(
            f"build is {build!r}, but robot {model.name} has build: {ENVIRONMENT} and no sonars, expected "
            f"{ENVIRONMENT}, or another robot model"
        )
    if build == ENVIRONMENT and model.board.get("bridge"):
        raise ConfigError(
            f"build is {build!r}, but robot {model.name} has an H-bridge on the same pins, expected {SONAR}"
        )
    return model._replace(build=build, sonars={} if build == ENVIRONMENT else model.sonars)


def has_environment(model: RobotModel, robot_id: Optional[int]) -> bool:
    """Return whether a 2013 board with this id has environment sensors: as the model says, else by the id."""
    return model.build == ENVIRONMENT if model.build else robot_id in SENSOR_BOARD_IDS


def require_inputs(model: RobotModel, place: str) -> None:
    """Raise ConfigError unless a board reads each sonar, on pins of its own; `place` begins the error."""
    users: Dict[str, str] = {}
    chip = CHIPS[model.chip]
    inputs = range_inputs(chip)
    for name, mount in model.sonars.items():
        given = mount.input_of(name)
        if given not in SONARS + inputs:
            raise ConfigError(
                f"{place}sonars.{name} is on the input {given!r}, expected input: {', '.join(SONARS)}, or "
                f"{inputs[0]} to {inputs[-1]} of the wiring on the {chip.board}"
            )
        if users.setdefault(given, name) != name:
            raise ConfigError(f"{place}sonars.{name} is on the input {given}, as sonars.{users[given]}")
        there, types = wired_types(model.board, given)
        if not types:
            of_range = f"{given}_trigger and {given}_echo, or for an analog sensor {given}_echo alone"
            pins = f"sonar_{given}" if given in SONARS else of_range
            raise ConfigError(
                f"{place}sonars.{name} is on the input {given}, which has no pins: add to the section wiring {pins}"
            )
        if mount.type not in types and (mount.type or types == ANALOG):
            raise ConfigError(
                f"{place}sonars.{name}.type is {mount.type or 'missing'}, expected {' or '.join(types)}: the input "
                f"{given} has {there}"
            )


def require_supported(model: RobotModel) -> None:
    """Raise ConfigError unless a board reads the sonars of this model."""
    require_inputs(model, f"robot {model.name}: ")


BOARD_KEYS = range(1, 12)
"""Indices of the parameters whose defaults differ between models; `COMMON_BOARD` has the others."""
CURVE_KEYS = ("sonar_a", "sonar_b", "sonar_c")
"""Parameters that a model may override after a calibration."""
BRIDGE_KEYS = (
    "bridge",
    "wiring",
    "stop_mode",
    "reversal_pause",
    "friction_duty",
    "battery_divider",
    "undervoltage",
)
"""Parameters of boards with an H-bridge; without a bridge and its wiring, such a board refuses to move."""
OWN_KEYS = (*CURVE_KEYS, "full_speed", *BRIDGE_KEYS)
"""Shared parameters that a model may override."""
COMMON_BOARD = {
    "motor_timeout": 3,
    "sonar_a": 11767,
    "sonar_b": 9466,
    "sonar_c": -3759,
    "bus_speed": 400,
    "bus_stop": 0,
    "full_speed": 160,
    **dict.fromkeys(BRIDGE_KEYS, 0),
    "reversal_pause": 50,
    "radio_hold": 0,
    "plain_calibrate": 0,
    "virtual_faults": 0,
}
"""Defaults that all models share.

Source: (Araujo 2012).  160 rpm at 7.2 V; sonar curve, with b = 0.94657 cut to the wire's resolution of 1e-4."""


OF_CONTROL = ("gearbox", "encoder_counts", "full_speed", "wheel_radius", "axis_radius")
"""What `beyond_control` looks at."""
CONTROLLED = 51, 25600
"""Least and most counts of a wheel at full duty that a board with H-bridges can control [1/s]."""


def full_speeds(board: Mapping[str, int]) -> Tuple[float, float]:
    """Return the speeds of a robot with H-bridges at full duty, straight ahead and turning [mm/s mrad/s]."""
    turns_s = board.get("full_speed", COMMON_BOARD["full_speed"]) / 60
    mm_s = turns_s * 2 * math.pi * board["wheel_radius"] / 100
    return mm_s, 1e5 * mm_s / board["axis_radius"]


def beyond_control(board: Mapping[str, int]) -> str:
    """Return in words why a board with H-bridges cannot control its wheels, and refuses all moves; empty if it can.

    `wheel_settings.cpp` has the numbers in fixed point.
    """
    turns_s = board.get("full_speed", COMMON_BOARD["full_speed"]) / 60
    counts_s = turns_s * board["gearbox"] * board["encoder_counts"] / 100
    mm_s, mrad_s = full_speeds(board)
    for names, value, unit, least, most in (
        ("gearbox, encoder_counts and full_speed", counts_s, "counts/s", *CONTROLLED),
        ("wheel_radius and full_speed", mm_s, "mm/s", 65, math.inf),
        ("axis_radius, wheel_radius and full_speed", mrad_s, "mrad/s", 1030, math.inf),
    ):
        if not least <= value <= most:
            limits = f"at least {least}" if most == math.inf else f"{least} to {most}"
            return f"board.{names} give {value:.0f} {unit} at most, expected {limits}: the board cannot control that"
    return ""
