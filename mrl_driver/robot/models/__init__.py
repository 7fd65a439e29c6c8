"""Robot models: one YAML file each, in this folder, in the user's own folder, or anywhere by path.

A model holds geometry, limits, sonar poses, default board parameters, and the robot ids that it accepts.  The files
name the sources of the numbers.
"""

import logging
import math
import os
from functools import lru_cache
from typing import (
    Any,
    Dict,
    Iterable,
    List,
    NamedTuple,
    Optional,
    Tuple,
    Type,
    TypeVar,
    Union,
    get_type_hints,
)

from mrl_driver import folders, yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.protocol.table import BRIDGES, BY_NAME, PARAMETERS

from .drives import (
    DIFFERENTIAL,
    EXTRA,
    KINDS,
    NONE,
    TRACKED,
    Base,
    Drive,
    MecanumDrive,
    NoDrive,
    OmniDrive,
    kind_of,
)
from .imu_mount import ImuMount

__all__ = [
    "Base",
    "Drive",
    "ImuMount",
    "MecanumDrive",
    "NoDrive",
    "OmniDrive",
    "RobotModel",
    "kind_of",
    "load",
    "names",
    "packaged",
]

_FOLDER = os.path.dirname(os.path.abspath(__file__))
_Section = TypeVar("_Section", bound=tuple)

SONAR, ENVIRONMENT = "sonar", "environment"
BUILDS = (SONAR, ENVIRONMENT)
"""Builds of the firmware that a model may name.  2013 boards do not report theirs, and the second has gas, dust and
light sensors instead of sonars.
"""
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
wrong by 1 %; the share of a turn that tracks lose depends on the floor, and may be a tenth.
"""


class Limits(NamedTuple):
    """Largest speeds and accelerations that the driver commands; they must not exceed the board's ceilings."""

    linear_m_s: float
    angular_rad_s: float
    linear_acceleration_m_s2: float
    angular_acceleration_rad_s2: float
    lateral_m_s: float = 0.0
    """Speed sideways, if the base can; 0 means as fast as forward."""


class Body(NamedTuple):
    """Outer dimensions and mass."""

    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    tracks: bool


class SonarMount(NamedTuple):
    """Mounting pose of a sonar in base_link; yaw counter-clockwise from forward."""

    x_m: float
    y_m: float
    yaw_deg: float

    @property
    def pose(self) -> Pose:
        """The same as a pose, with the yaw in radians."""
        return Pose(self.x_m, self.y_m, math.radians(self.yaw_deg))


class LaserMount(NamedTuple):
    """Mounting pose in base_link of a laser that lies flat; yaw counter-clockwise from forward.

    The default is that of the Hokuyo URG-04LX in the launch files of 2013.
    """

    x_m: float = 0.085
    y_m: float = 0.0
    z_m: float = 0.045
    yaw_deg: float = 0.0


class Battery(NamedTuple):
    """Battery voltages of the states [V], and capacity [Ah]."""

    full_v: float
    low_v: float
    empty_v: float
    off_v: float
    capacity_ah: float

    def charge(self, volts: float) -> float:
        """Return the charge at a voltage: 0 when empty and 1 when full, not limited to them."""
        return (volts - self.empty_v) / (self.full_v - self.empty_v)


class RobotModel(NamedTuple):
    """One robot model; `board` maps parameter names (rows of `table.PARAMETERS`) to wire values."""

    name: str
    ids: Tuple[int, ...]
    drive: Union[Base, NoDrive]
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

    @property
    def drives(self) -> bool:
        """The board drives the robot.  False for a board that only has sensors (`drive: none`)."""
        return not isinstance(self.drive, NoDrive)

    def require_motors(self) -> None:
        """Raise ConfigError if the board has no motors."""
        if isinstance(self.drive, NoDrive):
            raise ConfigError(
                f"robot {self.name} is a board without motors (drive: none): it has sensors, and something else "
                "drives its robot"
            )

    @property
    def base(self) -> Base:
        """The drive, for functions that need wheels.

        Raises:
            ConfigError: the board has no motors.
        """
        self.require_motors()
        assert not isinstance(self.drive, NoDrive)
        return self.drive

    @property
    def differential(self) -> Drive:
        """The drive, for functions that need two wheels or tracks.

        Raises:
            ConfigError: the robot has another drive type.
        """
        if not isinstance(self.base, Drive):
            raise ConfigError(
                f"robot {self.name} has a drive of kind {kind_of(self.drive)}, expected differential or tracked: "
                "this is for robots with two wheels or tracks"
            )
        return self.base


def with_build(model: RobotModel, build: str) -> RobotModel:
    """Return the model with this build instead of its own; the same model if `build` is empty.

    Raises:
        ConfigError: the model cannot have this build.
    """
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


def require_sonars(names: Iterable[Any], place: str = "") -> None:
    """Check that a board reads each of these sonars; `place` begins the error.

    Raises:
        ConfigError: it does not.
    """
    for name in names:
        if name not in SONARS:
            raise ConfigError(
                f"{place}key sonars.{name} is unknown, expected {', '.join(SONARS)}: a board reads these three sonars; "
                "firmware/SENSORS.md shows how to add another sensor"
            )


def require_supported(model: RobotModel) -> None:
    """Check that a board can move the base of this model, and reads its sonars.

    Raises:
        ConfigError: it cannot, or does not.
    """
    require_sonars(model.sonars, f"robot {model.name}: ")
    if isinstance(model.drive, MecanumDrive):
        raise ConfigError(
            f"robot {model.name} has a drive of kind {kind_of(model.drive)}, which no board with three motors moves, "
            "expected differential, tracked or omni: use mrl_driver.robot.kinematics with boards of your own"
        )


def packaged() -> List[str]:
    """Return the names of the models that come with the package."""
    return _names_in(_FOLDER)


def own_folder() -> str:
    """Return the folder for the user's own models, one YAML file each; it may not exist."""
    return os.path.join(folders.config(), "robots")


def names() -> List[str]:
    """Return the names of all models: the packaged ones and the user's own."""
    return sorted({*packaged(), *_names_in(own_folder())})


def _names_in(folder: str) -> List[str]:
    try:
        return sorted(f[:-5] for f in os.listdir(folder) if f.endswith(".yaml"))
    except OSError:
        return []


def _path_of(name: str) -> str:
    """Return the path of the user's own file with this name; otherwise of the packaged one."""
    own = os.path.join(own_folder(), f"{name}.yaml")
    return own if os.path.isfile(own) else os.path.join(_FOLDER, f"{name}.yaml")


def load(name_or_path: str) -> RobotModel:
    """Return the model with this name, or from this YAML file.  The user's own model hides a packaged one of the same
    name.

    Raises:
        ConfigError: there is no such model, or a key is missing, unknown, of the wrong type or out of range.
    """
    is_path = name_or_path.endswith((".yaml", ".yml"))
    path = name_or_path if is_path else _path_of(name_or_path)
    try:
        data = yaml_file.read(path)
    except OSError as error:
        raise ConfigError(
            f"robot {name_or_path!r} {error.strerror if is_path else 'is unknown'}, expected {', '.join(names())} "
            f"or the path of a .yaml file; files in {own_folder()} are known by name"
        ) from None
    return parse(data, path)


def parse(data: Any, path: str) -> RobotModel:
    """Return the model described by parsed YAML; `path` is its file, for messages.

    Raises:
        ConfigError: a key is missing, unknown, of the wrong type or out of range.
    """
    return _Reader(path).model(data)


def by_id(robot_id: int) -> str:
    """Return the name of the model that lists `robot_id`, the user's own first; empty if none does.

    An invalid file in the user's folder is logged and skipped.

    Raises:
        ConfigError: the invalid file has the name of the packaged model that lists the id.
    """
    own = _names_in(own_folder())
    ordered = [*own, *(name for name in packaged() if name not in own)]
    return next((name for name in ordered if _lists(name, robot_id)), "")


def _lists(name: str, robot_id: int) -> bool:
    try:
        return robot_id in load(name).ids
    except ConfigError as error:
        if name in packaged() and robot_id in load_packaged(name).ids:
            raise
        _log_once(f"robot model ignored: {error}")
        return False


@lru_cache(maxsize=None)
def _log_once(text: str) -> None:
    logging.getLogger(__name__).warning(text)


def load_packaged(name: str) -> RobotModel:
    """Return the packaged model with this name and ignore the user's own: the firmware knows only packaged ones.

    Raises:
        ConfigError: there is none.
    """
    return load(os.path.join(_FOLDER, f"{name}.yaml"))


def driven_models() -> List[RobotModel]:
    """Return the packaged models with motors, sorted by id.  A board with another id uses the defaults of the first."""
    found = [load_packaged(name) for name in packaged()]
    return sorted((model for model in found if model.drives), key=lambda model: min(model.ids))


def firmware_defaults(model: RobotModel) -> Dict[str, int]:
    """Return the defaults that the firmware has for the ids of one of `driven_models`: all parameters but the id.

    The others of `model.board`, such as its bridge, reach a board only over the wire: by `mrl set-id`.
    """
    own = {row.name: model.board[row.name] for row in PARAMETERS if row.number in BOARD_KEYS}
    return {**COMMON_BOARD, **own}


_STILL = Limits(0.0, 0.0, 0.0, 0.0)
_NO_BODY = Body(0.0, 0.0, 0.0, 0.0, tracks=False)
_NO_BATTERY = Battery(math.nan, math.nan, math.nan, math.nan, math.nan)
SONARS = tuple(field.name for field in BY_NAME["read_sonars"].reply)
"""Names of the sonars that a board reads."""
_POSITIVE = (1e-9, 1e6)
_RANGES = {
    "linear_m_s": (1e-3, 32.7),
    "lateral_m_s": (0.0, 32.7),
    "angular_rad_s": (1e-3, 32.7),
    "x_m": (-10.0, 10.0),
    "y_m": (-10.0, 10.0),
    "z_m": (-10.0, 10.0),
    "roll_deg": (-180.0, 180.0),
    "pitch_deg": (-180.0, 180.0),
    "yaw_deg": (-180.0, 180.0),
    "gyro_scale": (0.8, 1.25),
    "gyro_scale_sd": (1e-5, 0.25),
    "off_v": (0.0, 100.0),
    "wheel_offset": (-0.2, 0.2),
    "turn_slip": (-0.5, 0.9),
    "wheel_m2_per_m": (0.0, 1.0),
    "turn_rad2_per_rad": (0.0, 1.0),
    "distance_scale_sd": (0.0, 0.5),
    "wheel_ratio_sd": (0.0, 0.5),
    "turn_scale_sd": (0.0, 0.9),
}


class _Reader(yaml_file.Reader):
    """Reads a model from parsed YAML."""

    def model(self, data: Any) -> RobotModel:
        if isinstance(data, dict) and data.get("drive") == NONE:
            return self._without_motors(data)
        keys = self.keys("", data, RobotModel._fields, RobotModel._field_defaults)
        body = self._section("body", keys["body"], Body)
        noise = ON_TRACKS if body.tracks else ON_WHEELS
        if "noise" in keys:
            given = self.keys("noise", keys["noise"], Noise._fields, Noise._fields)
            noise = self._section("noise", {**noise._asdict(), **given}, Noise)
        mounts = self.mapping("sonars", keys["sonars"])
        require_sonars(mounts, f"{self.path}: ")
        sonars = {name: self._section(f"sonars.{name}", value, SonarMount) for name, value in mounts.items()}
        build = keys.get("build", "")
        if "build" in keys and build not in BUILDS:
            raise self.fail("build", build, " or ".join(BUILDS))
        model = RobotModel(
            name=self.text("name", keys["name"]),
            ids=self._ids(keys["ids"]),
            drive=self._drive(keys["drive"]),
            board=self._board(keys["board"]),
            limits=self._section("limits", keys["limits"], Limits),
            body=body,
            sonars={} if build == ENVIRONMENT else sonars,
            build=build,
            battery=self._section("battery", keys["battery"], Battery),
            noise=noise,
            imu=self._section("imu", keys.get("imu", {}), ImuMount),
            laser=self._section("laser", keys.get("laser", {}), LaserMount),
        )
        self._check_battery(model.battery)
        self._check_limits(model)
        self._check_bridge(model)
        if keys["drive"].get("kind") == TRACKED and not body.tracks:
            raise self.fail("body.tracks", body.tracks, "true for a tracked drive")
        return model

    def _without_motors(self, data: Any) -> RobotModel:
        """Read a model with `drive: none`; it has nothing that belongs to motors."""
        keys = self.keys("", data, ("name", "ids", "drive", "build"))
        if keys["build"] != ENVIRONMENT:
            raise self.fail(
                "build", keys["build"], f"{ENVIRONMENT} for a board without motors (drive: {NONE})"
            )
        name, ids = self.text("name", keys["name"]), self._ids(keys["ids"])
        return RobotModel(name, ids, NoDrive(), {}, _STILL, _NO_BODY, {}, _NO_BATTERY, build=ENVIRONMENT)

    def _check_battery(self, battery: Battery) -> None:
        levels = battery[:4]
        if not levels[0] > levels[1] > levels[2] > levels[3]:
            got = ", ".join(f"{name} {value:g}" for name, value in zip(Battery._fields, levels))
            raise ConfigError(
                f"{self.path}: battery is {got}, expected full_v above low_v above empty_v above off_v"
            )

    def _check_limits(self, model: RobotModel) -> None:
        """Check that no limit exceeds the board's ceiling: the board would clamp it, unseen by the driver."""
        for key, ceiling in (("linear_m_s", "linear_ceiling"), ("angular_rad_s", "angular_ceiling")):
            got, most = getattr(model.limits, key), model.board[ceiling] / 1000
            if got > most:
                raise self.fail(f"limits.{key}", got, f"at most {most:g}, the board.{ceiling}")
        if isinstance(model.drive, Drive) and model.limits.lateral_m_s:
            base = kind_of(model.drive)
            raise self.fail("limits.lateral_m_s", model.limits.lateral_m_s, f"0 for a {base} base")

    def _check_bridge(self, model: RobotModel) -> None:
        """Check that an H-bridge can move the base, and that no sensor has the bridge's pins."""
        if not model.board.get("bridge"):
            return
        if not isinstance(model.drive, Drive):
            raise self.fail("drive.kind", kind_of(model.drive), "differential or tracked for a board.bridge")
        if model.build == ENVIRONMENT:
            raise self.fail("build", model.build, "sonar: other sensors need pins that the board.bridge uses")
        counts = model.board["gearbox"] * model.board["encoder_counts"] / 100
        if counts < 1:
            raise ConfigError(
                f"{self.path}: board.gearbox and board.encoder_counts give {counts:g} counts a wheel turn, "
                "expected at least 1"
            )

    def _drive(self, data: Any) -> Base:
        """Read the section by its `kind`; without a kind it is a differential drive."""
        found = dict(self.mapping("drive", data))
        kind = found.pop("kind", DIFFERENTIAL)
        if not isinstance(kind, str) or kind not in KINDS:
            raise self.fail("drive.kind", kind, ", ".join(KINDS))
        for name in EXTRA.get(kind, ()):
            if name not in found:
                raise ConfigError(f"{self.path}: key drive.{name} is missing, {kind} drives need it")
        try:
            return self._section("drive", found, KINDS[kind])  # type: ignore[return-value]
        except ConfigError as error:
            raise ConfigError(f"{error} (kind {kind})") from None

    def _section(self, key: str, data: Any, kind: Type[_Section]) -> _Section:
        defaults = kind._field_defaults  # type: ignore[attr-defined]
        found = self.keys(key, data, kind._fields, defaults)  # type: ignore[attr-defined]
        hints = get_type_hints(kind)
        return kind(
            **{
                name: self._value(f"{key}.{name}", found[name], hints[name])
                for name in hints
                if name in found
            }
        )

    def _value(self, key: str, value: Any, kind: Any) -> Any:
        if kind is bool:
            return self.flag(key, value)
        if kind is float:
            return self.number(key, value, *_RANGES.get(key.rpartition(".")[2], _POSITIVE))
        return self._angles(key, value)

    def _angles(self, key: str, value: Any) -> Tuple[float, ...]:
        """Read the angles of three wheels: the motor board's order and spacing, rotated as a whole by any angle."""
        if isinstance(value, list) and len(value) == 3:
            first, second, third = (self.number(key, each, -360.0, 360.0) for each in value)
            if all(abs((b - a) % 360.0 - 120.0) < 1e-6 for a, b in ((first, second), (second, third))):
                return first, second, third
        raise self.fail(
            key, value, "three angles, each 120 deg on from the one before, such as [60, 180, 300]"
        )

    def _ids(self, value: Any) -> Tuple[int, ...]:
        if not isinstance(value, list) or not value:
            raise self.fail("ids", value, "a list of robot ids")
        ids = tuple(self.whole("ids", each, 1, 32767) for each in value)
        if len(set(ids)) < len(ids):
            raise self.fail("ids", value, "each id once")
        return ids

    def _board(self, data: Any) -> Dict[str, int]:
        rows = {row.name: row for row in PARAMETERS if row.number in BOARD_KEYS}
        rows.update((row.name, row) for row in PARAMETERS if row.name in OWN_KEYS)
        found = dict(self.keys("board", data, tuple(rows), OWN_KEYS))
        if "bridge" in found:
            found["bridge"] = self._bridge(found["bridge"])
        return {
            name: self.whole(f"board.{name}", found[name], row.low, row.high)
            for name, row in rows.items()
            if name in found
        }

    def _bridge(self, value: Any) -> int:
        """Read the bridge of an H-bridge board, by the name of its chip or its number."""
        chips = BRIDGES[1:]
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= len(chips):
            return value
        if not isinstance(value, str) or value.lower() not in chips:
            raise self.fail("board.bridge", value, ", ".join(chips))
        return BRIDGES.index(value.lower())


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
}
"""Defaults that all models share.

Source: (Araujo 2012).  160 rpm at 7.2 V; sonar curve, with b = 0.94657 cut to the wire's resolution of 1e-4.
"""
