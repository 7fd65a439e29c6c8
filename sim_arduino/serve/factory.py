"""Makes an emulated robot from its options; `mrl-sim` and the test fixtures use it."""

import math
import os
from typing import Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

from mrl_driver.errors import ConfigError
from mrl_driver.geometry import Pose
from mrl_driver.host.firmware_images import VIRTUAL, VIRTUAL_MODEL, image_path
from mrl_driver.robot import models
from sim_arduino.board.engine import Engine
from sim_arduino.faults import fault_table, key_values
from sim_arduino.faults.faulty_engine import FaultyEngine
from sim_arduino.hardware.bridge_plant import has_bridge
from sim_arduino.hardware.collision import footprint_for
from sim_arduino.hardware.environment_sensors import PERFECT, EnvironmentErrors
from sim_arduino.hardware.imu import FLAWLESS_IMU, ImuErrors
from sim_arduino.hardware.sonars import FLAWLESS, OF_CHAIN
from sim_arduino.hardware.wiring import Plant, chain_of
from sim_arduino.hardware.xbee import LOWEST_ADDRESS, RadioFit
from sim_arduino.world import world_file
from sim_arduino.world.free_places import free_places
from sim_arduino.world.shapes import Footprint
from sim_arduino.world.world import World

PROFILES = ("current", "2013-august", "2013-january")
ENGINES = ("python", "avr")
OWN_ADDRESS = "auto"
_LIMITS = {
    "robot_id": (0, 32767),
    "battery": (0.0, 15.0),
    "wiring": (0, 4095),
    "imu_seed": (0, 10**6),
    "radio_range": (0.0, math.inf),
    "radio_loss": (0.0, 1.0),
}
_NO_BRIDGE = "boards of 2013 have no H-bridge"
_BRIDGED = "expected a robot with an H-bridge, such as duo"
_RADIO_BUILD = "expected a board with sonars, an OMNI-3MD and profile current: only they have a radio build"


class Options(NamedTuple):
    """The options of `mrl-sim`, by name; each has a default."""

    robot: str = ""  # empty for the robot of the build virtual, or a TraxBot
    robot_id: Optional[int] = None
    engine: str = "python"
    profile: str = "current"
    environment: bool = False
    build: str = ""  # `virtual`: that image runs as a bare board; empty for what the model needs
    elf: Optional[str] = None
    world: Union[World, str] = "room"
    world_name: Optional[str] = None
    name: Optional[str] = None
    pose: Optional[str] = None
    slip: bool = False
    error: str = ""
    sonar: str = ""
    footprint: str = "box"
    omni: bool = False
    battery: Optional[float] = None
    seed: int = 0
    faults: Tuple[str, ...] = ()
    wiring: Optional[int] = None
    imu: bool = False
    imu_seed: int = 0  # draws the errors of the IMU, see `ImuErrors.drawn`; 0: it has none
    imu_errors: Optional[ImuErrors] = None  # errors of the IMU in place of drawn ones
    environment_errors: EnvironmentErrors = PERFECT  # errors of the environment sensors; `seed` draws them
    radio: Optional[str] = None
    """64-bit address of a radio in hexadecimal; `OWN_ADDRESS` makes one of the robot's name; None: no radio."""
    radio_range: float = math.inf  # largest distance at which it receives others and they receive it [m]
    radio_loss: float = 0.0  # share of the radio packets that this radio does not receive

    @property
    def model(self) -> models.RobotModel:
        """The robot's model."""
        return models.load(self.robot or (VIRTUAL_MODEL if self.build == VIRTUAL else "traxbot"))


class Emulated(NamedTuple):
    """An emulated robot and its board."""

    plant: Plant
    board: FaultyEngine  # the engine with its faults
    has_faults: bool

    @property
    def engine(self) -> Engine:
        """The engine to serve; without faults this is the original engine itself."""
        return self.board if self.has_faults else self.board.engine

    def close(self) -> None:
        """Takes the robot out of its world and frees the engine."""
        self.board.close()
        if self.plant.xbee:
            self.plant.xbee.close()
        self.plant.world.remove(self.plant.name)


def make(options: Options, world: Optional[World] = None) -> Emulated:
    """Makes a robot and its board, in the world of the options or in an existing one.

    ConfigError if an option is out of range, no board can move this base, or the start pose is inside a wall or another
    robot.
    """
    faults = [fault_table.parse(spec) for spec in options.faults]
    model = options.model
    models.require_supported(model)
    options = options._replace(environment=_has_environment(model, options))
    for refusal in _refusals(model, options):
        raise ConfigError(refusal)
    world = _world(options) if world is None else world
    name = options.name or f"robot{os.getpid()}"
    pose = world_file.parse_pose(options.pose, world.start_of(name))
    _require_room(world, pose, footprint_for(model, options.footprint), name)
    plant = _plant(options, model, world, pose, name)
    return Emulated(plant, FaultyEngine(_engine(plant, options), faults, options.seed), bool(faults))


def _plant(options: Options, model: models.RobotModel, world: World, pose: Pose, name: str) -> Plant:
    """The hardware; a wiring that is given with `--wiring` is for the user to find out, so the new board lacks it."""
    given, known = options.wiring, model.board.get("wiring")
    return Plant(
        model if given is None else model._replace(board={"wiring": 0, **model.board}),
        world,
        pose,
        slip=options.slip,
        battery_v=options.battery,
        sonars=not options.environment,
        errors=key_values.robot_errors(options.error),
        sonar_errors=key_values.sonar_errors(options.sonar),
        seed=options.seed,
        footprint=options.footprint,
        omni=options.omni,
        name=name,
        wiring=known or 1 if given is None else given,
        imu=options.imu,
        imu_errors=options.imu_errors
        or (ImuErrors.drawn(options.imu_seed) if options.imu_seed else FLAWLESS_IMU),
        environment_errors=options.environment_errors,
        radio=_radio(options),
    )


def _has_environment(model: models.RobotModel, options: Options) -> bool:
    """Whether the board has environment sensors: as an option says, or the model, or for 2013 boards the robot id."""
    if options.environment or model.build == models.ENVIRONMENT:
        return True
    robot_id = model.ids[0] if options.robot_id is None else options.robot_id
    return options.profile != "current" and models.has_environment(model, robot_id)


def make_team(options: Options, names: Sequence[str], poses: Sequence[str]) -> List[Emulated]:
    """Makes a robot for each name in one world, or one robot without a name; the poses are in the same order.

    The seed of each robot is one higher than that of the robot before, and so are the IMU's if it is not 0, and the
    address of the radio if one is given.  ConfigError as for `make_all`.
    """
    team = [numbered(options, number, name) for number, name in enumerate(names or [options.name])]
    return make_all(
        [each._replace(pose=pose) for each, pose in zip(team, [*poses, *[options.pose] * len(team)])]
    )


def numbered(options: Options, number: int, name: Optional[str]) -> Options:
    """The options of the robot with this number in a team, from 0; it has this name."""
    its = options._replace(name=name, seed=options.seed + number)
    if options.imu_seed:
        its = its._replace(imu_seed=options.imu_seed + number)
    if options.radio not in (None, OWN_ADDRESS):
        its = its._replace(radio=f"{_radio_address(str(options.radio)) + number:x}")
    return its


def make_all(team: Sequence[Options], places: Sequence[int] = ()) -> List[Emulated]:
    """Makes robots, each with its options, in the world of the first one.

    `places` are the numbers of their places on the world's free floor, from 0, instead of their poses.  ConfigError as
    for `make`, or if a name appears twice, or the world has too little free floor.
    """
    names = [each.name for each in team]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise ConfigError(f"robot {twice[0]!r} is named twice, expected another name for each robot")
    world, robots = _world(team[0]), []
    try:
        for each in _placed(team, places, world) if places else team:
            robots.append(make(each, world))
    except BaseException:
        for robot in robots:
            robot.close()
        raise
    return robots


def _placed(team: Sequence[Options], places: Sequence[int], world: World) -> List[Options]:
    """The options with the poses of the places."""
    bodies = [footprint_for(each.model, each.footprint) for each in team]
    radius_m = max((body.radius_m for body in bodies if body), default=0.0)
    poses = free_places(world, radius_m, max(places) + 1)
    return [each._replace(pose=world_file.pose_text(poses[place])) for each, place in zip(team, places)]


def _refusals(model: models.RobotModel, options: Options) -> Iterator[str]:
    """What is wrong with the options, in sentences."""
    for name, (low, high) in _LIMITS.items():
        value = getattr(options, name)
        if value is not None and not low <= value <= high:
            yield f"{name} is {value!r}, expected {low:g} to {high:g}"
    old = options.profile != "current"
    if options.build not in ("", VIRTUAL):
        yield f"build is {options.build!r}, expected {VIRTUAL}"
    for option in ("omni", "slip", "error", "battery"):
        if not model.drives and getattr(options, option) not in (None, False, ""):
            yield f"--{option} is given for robot {model.name}, which has no motors (drive: none)"
    if has_bridge(model):
        for option in ("environment", "omni"):
            if getattr(options, option):
                yield f"--{option} is given for robot {model.name}, whose H-bridge uses the same pins"
        if old:
            yield f"profile {options.profile} is given for robot {model.name}, expected current: {_NO_BRIDGE}"
    elif options.build:
        yield f"build {options.build} is given for robot {model.name}, {_BRIDGED}"
    elif options.wiring is not None:
        yield f"wiring {options.wiring} is given for robot {model.name}, which has an OMNI-3MD; {_BRIDGED}"
    errors = key_values.sonar_errors(options.sonar)
    for key in OF_CHAIN if options.environment or not chain_of(model) else ():
        if getattr(errors, key) != getattr(FLAWLESS, key):
            yield f"--sonar {key} is given for robot {model.name}, which has no MB1300 sonars; leave it out"
    if not options.imu and (options.imu_seed or options.imu_errors):
        yield "errors of an IMU are given without an IMU, expected --imu too"
    if options.imu and old:
        yield f"--imu is given for profile {options.profile}, expected current: boards of 2013 have no IMU"
    for option in ("radio_range", "radio_loss"):
        if options.radio is None and getattr(options, option) != Options._field_defaults[option]:
            yield f"--{option.replace('_', '-')} is given without a radio, expected --radio too"
    if options.radio is not None and (old or options.environment or has_bridge(model)):
        yield f"--radio is given for robot {model.name}, {_RADIO_BUILD}"


def _radio(options: Options) -> Optional[RadioFit]:
    if options.radio is None:
        return None
    address = None if options.radio == OWN_ADDRESS else _radio_address(options.radio)
    return RadioFit(address, options.radio_range, options.radio_loss)


def _radio_address(text: str) -> int:
    try:
        address = int(text, 16)
    except ValueError:
        address = 0
    if not LOWEST_ADDRESS <= address < 1 << 64:
        raise ConfigError(
            f"radio address is {text!r}, expected a 64-bit address in hexadecimal, such as 0013a20040a1b2c3"
        )
    return address


def _world(options: Options) -> World:
    if isinstance(options.world, World):
        return options.world
    world = world_file.load(options.world)
    if options.world_name is not None:
        from sim_arduino.world.shared_robots import SharedRegistry

        world.registry = SharedRegistry(options.world_name)
        if options.radio is not None:
            from sim_arduino.world.shared_radio import SharedRadioMedium

            world.radio = SharedRadioMedium(options.world_name, world.registry)
    return world


def _require_room(world: World, pose: Pose, footprint: Optional[Footprint], name: str) -> None:
    if footprint is None:
        return
    if world.touching(pose, footprint, name) or world.is_solid(pose.x_m, pose.y_m):
        where = f"{pose.x_m:g},{pose.y_m:g}"
        others = [mover.name for mover in world.robots(name)]
        raise ConfigError(
            f"pose {where} is in a wall or another robot ({', '.join(others) or 'there is none'}), "
            "expected free floor; give another pose with --pose X,Y,YAW"
        )


def _engine(plant: Plant, options: Options) -> Engine:
    if options.profile not in PROFILES:
        raise ConfigError(f"profile is {options.profile!r}, expected {', '.join(PROFILES)}")
    if options.engine not in ENGINES:
        raise ConfigError(f"engine is {options.engine!r}, expected {', '.join(ENGINES)}")
    if options.engine == "avr" or options.build:
        return _avr_engine(plant, options)
    if options.profile != "current":
        from sim_arduino.board.board2013 import Board2013

        return Board2013(plant, january=options.profile == "2013-january", robot_id=options.robot_id)
    from sim_arduino.board import PythonBoard

    return PythonBoard(plant, options.robot_id, options.environment)


def _avr_engine(plant: Plant, options: Options) -> Engine:
    from sim_arduino.board.avr_board import AvrEngine

    if options.profile != "current":
        raise ConfigError(f"profile {options.profile} has no firmware binary, expected --engine python")
    build = "hbridge" if plant.bridge else "environment" if options.environment else "sonar"
    build = options.build or ("xbee" if plant.xbee else build)
    elf = options.elf or image_path(build, plant.model.chip)
    if not os.path.exists(elf):
        raise ConfigError(
            f"image {elf} does not exist, expected an ELF or Intel HEX file; without --elf the packaged one runs"
        )
    robot_id = plant.model.ids[0] if options.robot_id is None else options.robot_id
    return AvrEngine(plant, elf, robot_id or None, options.seed, bare=options.build == VIRTUAL)
