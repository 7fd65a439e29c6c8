"""Renders the description (URDF) of the robots from their models; `robot_description` prints one for a launch file.

`python -m ros1_bridge.description` renders `urdf/`; `--check` reports whether the files are current.  base_link is at
the height of the axle, midway between the wheels.
"""

import argparse
import math
import sys
from pathlib import Path
from typing import Iterable, Iterator, List, NamedTuple, Sequence, Tuple
from xml.sax.saxutils import quoteattr

from mrl_driver.errors import ConfigError
from mrl_driver.robot import models
from mrl_driver.robot.models import MecanumDrive, OmniDrive, RobotModel
from mrl_driver.robot.models.drives import SkidDrive
from ros1_bridge.node.tf_names import SONAR_HEIGHT_M, imu_frame, joints_of, servo_joint, wheel_radius_m

FOLDER = Path(__file__).resolve().parent.parent / "urdf"
WHEEL_WIDTH_M, TRACK_WIDTH_M = 0.026, 0.035
WHEEL_MASS_SHARE = 0.1  # Mass of each wheel as a share of the robot's mass
CASTER_RADIUS_M = 0.012
SONAR_LENGTH_M, SONAR_RADIUS_M = 0.016, 0.011  # MB1300: 22 mm across (data sheet)
SERVO_SIZE_M, SERVO_MASS_KG, SERVO_NM = 0.02, 0.01, "0.2"  # small ones; assumed
LASER_SIZE_M = (0.05, 0.05, 0.07)
LASER_MASS_KG = 0.16
COLOURS = {
    "dark": "0.15 0.15 0.17 1",
    "grey": "0.55 0.57 0.6 1",
    "traxbot": "0.1 0.35 0.7 1",
    "stingbot": "0.85 0.55 0.1 1",
    "omni": "0.1 0.5 0.25 1",
    "duo": "0.75 0.15 0.15 1",
}

Point = Tuple[float, float, float]
Lines = Iterator[str]


class LinkShape(NamedTuple):
    """A shape and its place in its link; `size` is (x, y, z) of a box, (radius, length) or (radius,) of a sphere."""

    size: Sequence[float]
    at: Point = (0.0, 0.0, 0.0)
    roll_rad: float = 0.0
    colour: str = "grey"


def side_of(model: RobotModel) -> float:
    """Distance from the middle to the wheels on a side [m]."""
    drive = model.base
    return drive.half_width_m if isinstance(drive, MecanumDrive) else drive.wheel_separation_m / 2


def render(model: RobotModel, prefix: str = "", laser: bool = False, imu: bool = False) -> str:
    """The URDF of a robot, links named with `prefix`, such as `robot1/`; ConfigError if the board has no motors."""
    if not model.drives:
        raise ConfigError(
            f"robot {model.name} is a board without motors (drive: none), expected a robot with a body of its own: "
            "describe the robot that carries the board, and start this one with description:=false"
        )
    wanted = {_base: True, _wheels: True, _sonars: True, _servos: True, _laser: laser, _imu: imu}
    parts = (part(model, prefix) for part, is_wanted in wanted.items() if is_wanted)
    lines = [
        '<?xml version="1.0"?>',
        "<!-- Rendered by ros1_bridge/description/urdf.py out of the robot's model; do not edit. -->",
        *_tag("robot", *parts, name=model.name),
    ]
    return "\n".join(lines) + "\n"


def _tag(tag: str, *content: Iterable[str], **attributes: str) -> Lines:
    """The lines of an element, with its content indented."""
    head = tag + "".join(f" {key}={quoteattr(value)}" for key, value in attributes.items())
    if not content:
        yield f"<{head}/>"
        return
    yield f"<{head}>"
    yield from (f"  {line}" for part in content for line in part)
    yield f"</{tag}>"


def files() -> List[Tuple[Path, str]]:
    """The committed files and their text."""
    made = []
    for model in models.driven_models():
        made.append((FOLDER / f"{model.name}.urdf", render(model)))
        made.append((FOLDER / f"{model.name}_laser.urdf", render(model, laser=True)))
    return made


def _base(model: RobotModel, prefix: str) -> Lines:
    body, radius = model.body, wheel_radius_m(model)
    side_m = side_of(model)
    width = 2 * side_m - (TRACK_WIDTH_M if body.tracks else WHEEL_WIDTH_M) - 0.01
    middle, height = body.height_m / 2 - radius + 0.008, body.height_m - 0.016
    round_body = isinstance(model.base, OmniDrive)
    size = (width / 2, height) if round_body else (body.length_m, width, height)
    chassis = LinkShape(size, (0.0, 0.0, middle), colour=model.name if model.name in COLOURS else "grey")
    parts = [chassis]
    if body.tracks:
        track = (body.length_m - 2 * radius, TRACK_WIDTH_M, 2 * radius)
        for sign in (1, -1):
            parts.append(LinkShape(track, (0.0, sign * side_m, 0.0), colour="dark"))
    elif not round_body and len(_places(model)) == 2:
        tail = -body.length_m / 2 + 2 * CASTER_RADIUS_M
        parts.append(LinkShape((CASTER_RADIUS_M,), (tail, 0.0, CASTER_RADIUS_M - radius), colour="dark"))
    mass = body.mass_kg * (1 - len(_places(model)) * WHEEL_MASS_SHARE)
    yield from _tag("link", name=prefix + "base_link")  # KDL forbids a root link with inertia
    yield from _link(prefix + "chassis", parts, mass, chassis, collisions=parts)
    yield from _joint("chassis_joint", prefix + "base_link", prefix + "chassis", (0.0, 0.0, 0.0))


def _places(model: RobotModel) -> List[Tuple[str, Point, float]]:
    """Joint of each wheel, its position [m], and the direction in which it rolls [rad] when its counter counts up."""
    drive = model.base
    if isinstance(drive, OmniDrive):
        left, rear, right = map(math.radians, drive.angles_deg)
        return [
            (joint, (drive.radius_m * math.cos(at), drive.radius_m * math.sin(at), 0.0), at + math.pi / 2)
            for joint, at in zip(joints_of(drive), (right, left, rear))
        ]
    side_m, ahead_m = side_of(model), 0.0
    if isinstance(drive, MecanumDrive):
        ahead_m = drive.half_length_m
    elif isinstance(drive, SkidDrive):  # at the ends of the body; odometry does not depend on it
        ahead_m = model.body.length_m / 2 - wheel_radius_m(model)
    places = ((ahead_m, -side_m), (ahead_m, side_m), (-ahead_m, side_m), (-ahead_m, -side_m))
    return [(joint, (x, y, 0.0), 0.0) for joint, (x, y) in zip(joints_of(drive), places)]


def _wheels(model: RobotModel, prefix: str) -> Lines:
    radius = wheel_radius_m(model)
    width = TRACK_WIDTH_M if model.body.tracks else WHEEL_WIDTH_M
    wheel = LinkShape((radius, width), roll_rad=math.pi / 2, colour="dark")
    hub = LinkShape((radius / 3, width + 0.004), roll_rad=math.pi / 2)
    spoke = LinkShape((1.5 * radius, width + 0.002, radius / 6))
    for joint, at, yaw_rad in _places(model):
        link = prefix + joint.replace("_joint", "")
        mass = model.body.mass_kg * WHEEL_MASS_SHARE
        yield from _link(link, [wheel, hub, spoke], mass, wheel, collisions=[wheel])
        yield from _joint(joint, prefix + "base_link", link, at, yaw_rad, turns=True)


def _sonars(model: RobotModel, prefix: str) -> Lines:
    across = 2 * SONAR_RADIUS_M
    box = LinkShape((SONAR_LENGTH_M, across, across), (-SONAR_LENGTH_M / 2, 0.0, 0.0))
    for name, mount in model.sonars.items():
        link = f"{prefix}sonar_{name}"
        yield from _link(link, [box], 0.005, box, collisions=[])
        at, yaw_rad = (mount.x_m, mount.y_m, SONAR_HEIGHT_M), math.radians(mount.yaw_deg)
        yield from _joint(f"sonar_{name}_joint", prefix + "base_link", link, at, yaw_rad)


def _servos(model: RobotModel, prefix: str) -> Lines:
    """What a servo turns is where its joint is, and has the name of the servo."""
    box = LinkShape((SERVO_SIZE_M,) * 3, colour="dark")
    for name, mount in model.servos.items():
        yield from _link(prefix + name, [box], SERVO_MASS_KG, box, collisions=[])
        ends = _tag("parent", link=prefix + (mount.parent or "base_link")), _tag("child", link=prefix + name)
        speed, low, high = (f"{each:.6g}" for each in (mount.speed_rad_s, mount.low_rad, mount.high_rad))
        limit = _tag("limit", lower=low, upper=high, velocity=speed, effort=SERVO_NM)
        axis = _tag("axis", xyz="0 1 0" if mount.tilts else "0 0 1")
        at = _origin((mount.x_m, mount.y_m, mount.z_m))
        yield from _tag("joint", *ends, at, axis, limit, name=servo_joint(name), type="revolute")


def _laser(model: RobotModel, prefix: str) -> Lines:
    box = LinkShape(LASER_SIZE_M, (0.0, 0.0, -LASER_SIZE_M[2] / 2 + 0.015), colour="dark")
    yield from _link(prefix + "laser", [box], LASER_MASS_KG, box, collisions=[box])
    mount, base = model.laser, prefix + "base_link"
    at, yaw_rad = (mount.x_m, mount.y_m, mount.z_m), math.radians(mount.yaw_deg)
    yield from _joint("laser_joint", base, prefix + "laser", at, yaw_rad)


def _imu(model: RobotModel, prefix: str) -> Lines:
    """A frame at the IMU's place, with the axes of base_link: the driver has already rotated what the chip measured."""
    base, mount = prefix + "base_link", model.imu
    yield from _tag("link", name=imu_frame(base))
    yield from _joint("imu_joint", base, imu_frame(base), (mount.x_m, mount.y_m, mount.z_m))


def _link(
    name: str, visuals: Sequence[LinkShape], mass_kg: float, solid: LinkShape, collisions: Sequence[LinkShape]
) -> Lines:
    """A link with the inertia of `solid` alone."""
    seen = (_tag("visual", *_shape(part), _material(part.colour)) for part in visuals)
    hit = (_tag("collision", *_shape(part)) for part in collisions)
    ixx, iyy, izz = (f"{moment:.4g}" for moment in inertia(solid, mass_kg))
    moments = _tag("inertia", ixx=ixx, ixy="0", ixz="0", iyy=iyy, iyz="0", izz=izz)
    mass = _tag("mass", value=f"{mass_kg:.4g}")
    return _tag(
        "link", *seen, *hit, _tag("inertial", _origin(solid.at, solid.roll_rad), mass, moments), name=name
    )


def _material(colour: str) -> Lines:
    return _tag("material", _tag("color", rgba=COLOURS.get(colour, COLOURS["grey"])), name=colour)


def inertia(part: LinkShape, mass_kg: float) -> Point:
    """Moments of inertia about its own axes of a solid of uniform density [kg m2]."""
    if len(part.size) == 3:
        x, y, z = (size * size for size in part.size)
        return mass_kg * (y + z) / 12, mass_kg * (x + z) / 12, mass_kg * (x + y) / 12
    radius2, length2 = part.size[0] ** 2, part.size[1] ** 2
    across = mass_kg * (3 * radius2 + length2) / 12
    return across, across, mass_kg * radius2 / 2


def _shape(part: LinkShape) -> Tuple[Iterable[str], Iterable[str]]:
    """Place and geometry of a shape."""
    size = " ".join(f"{value:.5g}" for value in part.size)
    if len(part.size) == 3:
        form = _tag("box", size=size)
    elif len(part.size) == 2:
        radius, length = size.split()
        form = _tag("cylinder", radius=radius, length=length)
    else:
        form = _tag("sphere", radius=size)
    return _origin(part.at, part.roll_rad), [f"<geometry>{next(form)}</geometry>"]


def _joint(name: str, parent: str, child: str, at: Point, yaw_rad: float = 0.0, turns: bool = False) -> Lines:
    ends = _tag("parent", link=parent), _tag("child", link=child)
    axis = [_tag("axis", xyz="0 1 0")] if turns else []
    kind = "continuous" if turns else "fixed"
    return _tag("joint", *ends, _origin(at, yaw_rad=yaw_rad), *axis, name=name, type=kind)


def _origin(at: Point, roll_rad: float = 0.0, yaw_rad: float = 0.0) -> Lines:
    return _tag("origin", xyz=" ".join(f"{value:.5g}" for value in at), rpy=f"{roll_rad:.6g} 0 {yaw_rad:.6g}")


def main() -> None:
    """Print the description of a robot model, for a launch file's `command`."""
    parser = argparse.ArgumentParser("robot_description", description=main.__doc__)
    parser.add_argument("model", help="name of a packaged model, or path of a .yaml file")
    parser.add_argument("--prefix", default="", help="prefix of each link name, such as robot1/")
    builds, flags = ("", *models.BUILDS), ("false", "true")
    parser.add_argument("--build", default="", choices=builds, help="instead of the model's build")
    parser.add_argument("--laser", default="false", choices=flags, help="add a laser scanner")
    parser.add_argument("--imu", default="false", choices=flags, help="add the IMU's frame")
    given = parser.parse_args()
    model = models.with_build(models.load(given.model), given.build)
    sys.stdout.write(render(model, given.prefix, given.laser == "true", given.imu == "true"))
