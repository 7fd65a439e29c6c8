"""Vehicles for the tip-over margin, read from a short YAML file or from a robot model."""

import math
import os
from typing import Any, List, Tuple

from mrl_driver import yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.robot import models
from mrl_driver.robot.models import RobotModel
from mrl_driver.robot.models.drives import MecanumDrive, OmniDrive, SkidDrive
from mrl_driver.yaml_file import Reader
from mrl_driver.yaml_form import Number, Numbers, Rows, Section, Text

from .margin import RANGES, Arm, Mass, Point, Vehicle, hull

_FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "vehicles")
_MOST_CONTACTS = 100
_KEYS = ("name", "contacts", "body", "payloads", "arm")
_POINTS = Rows(Numbers(x=RANGES["x_m"], y=RANGES["y_m"]))


def names() -> List[str]:
    """Return the names of the packaged vehicles; the names of robot models are valid as well."""
    return sorted(file[:-5] for file in os.listdir(_FOLDER) if file.endswith(".yaml"))


def load(name_or_path: str) -> Vehicle:
    """Return the vehicle with this name, from this .yaml file, or of this robot model; ConfigError if there is none."""
    if name_or_path in names():
        return read(os.path.join(_FOLDER, f"{name_or_path}.yaml"))
    if name_or_path.endswith((".yaml", ".yml")):
        return read(name_or_path)
    if name_or_path in models.names():
        return of_model(models.load(name_or_path))
    known = ", ".join([*names(), *models.names()])
    raise ConfigError(f"vehicle {name_or_path!r} is unknown, expected {known} or the path of a .yaml file")


def read(path: str) -> Vehicle:
    """Return the vehicle in a file, as `parse` does; the file may also be a robot model."""
    data = yaml_file.read_expected(path, "a vehicle's or a robot's .yaml")
    if isinstance(data, dict) and "drive" in data:
        return of_model(models.parse(data, path))
    return parse(data, path)


def parse(data: Any, path: str) -> Vehicle:
    """Return the vehicle described by parsed YAML; `path` is its file, for messages of a ConfigError."""
    reader = Reader(path)
    found = reader.keys("", data, _KEYS, ("payloads", "arm"))
    payloads = reader.mapping("payloads", found.get("payloads", {}), "a mapping of names to masses")
    mass = _section(Mass)
    return Vehicle(
        Text().read(reader, "name", found["name"]),
        _contacts(reader, found["contacts"]),
        mass.read(reader, "body", found["body"]),
        {str(name): mass.read(reader, f"payloads.{name}", value) for name, value in payloads.items()},
        _arm(reader, found["arm"]) if "arm" in found else None,
    )


def of_model(model: RobotModel) -> Vehicle:
    """Return a robot model as a vehicle, with its mass at the centre of its body.

    Raise ConfigError if the model does not contain all ground contact points.
    """
    drive, body = model.drive, model.body
    if isinstance(drive, MecanumDrive):
        contacts = _corners(drive.half_length_m, drive.half_width_m)
    elif isinstance(model.base, OmniDrive):
        angles, radius_m = map(math.radians, model.base.angles_deg), model.base.radius_m
        contacts = [(radius_m * math.cos(angle), radius_m * math.sin(angle)) for angle in angles]
    elif body.tracks or isinstance(model.base, SkidDrive):
        contacts = _corners(body.length_m / 2, model.base.wheel_separation_m / 2)
    else:
        raise ConfigError(
            f"{model.name} has two wheels, and its model does not hold what else touches the ground, expected a "
            "vehicle's .yaml with contacts"
        )
    return Vehicle(model.name, tuple(contacts), Mass(body.mass_kg, 0.0, 0.0, body.height_m / 2), {})


def _corners(half_length_m: float, half_width_m: float) -> List[Point]:
    return [(x * half_length_m, y * half_width_m) for x, y in ((1, 1), (1, -1), (-1, 1), (-1, -1))]


def _contacts(reader: Reader, value: Any) -> Tuple[Point, ...]:
    if not isinstance(value, list) or not 3 <= len(value) <= _MOST_CONTACTS:
        raise reader.fail("contacts", value, f"a list of three to {_MOST_CONTACTS} points [x, y]")
    points: Tuple[Point, ...] = _POINTS.read(reader, "contacts", value)  # type: ignore[assignment]
    try:
        hull(points)
    except ConfigError as error:
        raise ConfigError(f"{reader.path}: {error}") from None
    return points


def _arm(reader: Reader, data: Any) -> Arm:
    arm: Arm = _section(Arm).read(reader, "arm", data)
    if arm.centre_m > arm.length_m:
        raise reader.fail(
            "arm.centre_m", arm.centre_m, f"a place on the arm, which is {arm.length_m:g} m long"
        )
    return arm


def _section(kind: Any) -> Section:
    return Section(kind, {name: Number(*RANGES[name]) for name in kind._fields})
