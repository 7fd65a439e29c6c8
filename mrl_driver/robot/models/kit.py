"""The model file of a new robot with two wheels on an H-bridge, from the few numbers that its builder knows."""

import math
from typing import Dict, Mapping, NamedTuple, Set, Tuple

from mrl_driver import yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import INT16_MAX
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P
from mrl_driver.yaml_form import schema_line

from . import SCHEMA, RobotModel, load, load_packaged, names, parse

LEAST_ID = 11  # ids below belong to the robots of the papers
LIKE = "duo"  # model whose other numbers a new robot has until it is calibrated
CEILING_SHARE = 0.85
"""Ceiling of the speed as a share of full speed, so that the control has duty left; assumed."""
DIAMETER_MM, SEPARATION_MM, COUNTS = (10.0, 650.0), (30.0, 650.0), (4.0, 100_000.0)
"""Ranges of the numbers; half the separation and the wheel's radius must fit into 16 bits of 0.01 mm."""


class Kit(NamedTuple):
    """What the builder of a robot knows."""

    name: str
    robot_id: int
    wheel_diameter_mm: float
    wheel_separation_mm: float
    counts_per_turn: float  # encoder counts of a wheel turn
    bridge: str  # one of `table.BRIDGES`
    pins: Mapping[str, int]  # the wiring, parameters of an ATmega328P


def parse_counts(text: str) -> float:
    """Return a number in the range of `COUNTS`, or the product of several, such as `1496` or `11 x 4 x 34`."""
    product = 1.0
    try:
        for factor in text.lower().replace("*", "x").split("x"):
            product *= float(factor)
    except ValueError:
        product = math.nan
    low, high = COUNTS
    if not low <= product <= high:
        raise ConfigError(
            f"counts of a wheel turn are {text!r}, expected a number from {low:g} to {high:g}, or a product such as "
            "11 x 4 x 34"
        )
    return product


def gearbox_and_counts(counts_per_turn: float) -> Tuple[int, int]:
    """Return the parameters `gearbox` and `encoder_counts` [0.1]; their product is the counts of a wheel turn."""
    gearbox = math.ceil(counts_per_turn * 10 / INT16_MAX) * 10
    return gearbox, round(counts_per_turn * 100 / gearbox)


def free_id() -> int:
    """Return the lowest id from `LEAST_ID` on that no model lists; invalid files of the user do not count."""
    taken: Set[int] = set()
    for name in names():
        try:
            taken.update(load(name).ids)
        except ConfigError:
            continue
    return next(each for each in range(LEAST_ID, INT16_MAX) if each not in taken)


def text_of(kit: Kit) -> str:
    """Return the YAML file of a new robot."""
    like = load_packaged(LIKE)
    full_mm_s = like.board["full_speed"] / 60 * math.pi * kit.wheel_diameter_mm
    ceiling = max(1, round(CEILING_SHARE * full_mm_s))
    turning = max(1, min(INT16_MAX, round(2 * ceiling / (kit.wheel_separation_mm / 1000))))
    return _drive_and_board(kit, like.board, ceiling, turning) + _limits_and_body(kit, like, ceiling, turning)


def _drive_and_board(kit: Kit, like: Dict[str, int], ceiling: int, turning: int) -> str:
    diameter_m, separation_m = kit.wheel_diameter_mm / 1000, kit.wheel_separation_mm / 1000
    gearbox, encoder_counts = gearbox_and_counts(kit.counts_per_turn)
    wheel = f"pi x {diameter_m:.6g} m at {kit.counts_per_turn:g} counts a turn"
    return f"""\
{schema_line(SCHEMA)}
# {kit.name}: two wheels on an H-bridge; from mrl new.  Numbers that it did not ask for are assumed.
name: {kit.name}
ids: [{kit.robot_id}]
drive:
  wheel_separation_m: {separation_m:.6g}
  metres_per_count: {math.pi * diameter_m / kit.counts_per_turn:.12f}   # {wheel}
board:
  axis_radius: {round(kit.wheel_separation_mm * 50)}                # 0.01 mm, half the separation
  wheel_radius: {round(kit.wheel_diameter_mm * 50)}               # 0.01 mm
  gearbox: {gearbox}                      # 0.1
  encoder_counts: {encoder_counts}            # 0.1; times gearbox / 10: counts of a wheel turn
  kp: {like["kp"]}                         # kp, ki, full_speed and friction_duty: mrl calibrate gains
  ki: {like["ki"]}
  kd: {like["kd"]}
  ramp_time: {like["ramp_time"]}                  # ms
  ramp_gain: {like["ramp_gain"]}
  linear_ceiling: {ceiling}              # mm/s
  angular_ceiling: {turning}            # mrad/s
  full_speed: {like["full_speed"]}                  # 1/min
  bridge: {kit.bridge}
  friction_duty: {like["friction_duty"]}                # 0.1 %
{_wiring(kit.pins)}"""


def _wiring(pins: Mapping[str, int]) -> str:
    """Return the section of the pins: those that are connected."""
    words = {True: "true", False: "false"}
    section = wiring.section(pins, ATMEGA328P)
    return "wiring:\n" + "".join(f"  {name}: {words.get(pin, pin)}\n" for name, pin in section.items())


def _limits_and_body(kit: Kit, like: RobotModel, ceiling: int, turning: int) -> str:
    diameter_m, separation_m = kit.wheel_diameter_mm / 1000, kit.wheel_separation_mm / 1000
    limits, battery = like.limits, like.battery
    return f"""\
limits:
  linear_m_s: {min(limits.linear_m_s, ceiling / 1000):g}
  angular_rad_s: {min(limits.angular_rad_s, turning / 1000):g}
  linear_acceleration_m_s2: {limits.linear_acceleration_m_s2:g}
  angular_acceleration_rad_s2: {limits.angular_acceleration_rad_s2:g}
body:
  length_m: {separation_m + diameter_m / 2:.3f}
  width_m: {separation_m + 0.02:.3f}
  height_m: {diameter_m + 0.03:.3f}
  mass_kg: {like.body.mass_kg:g}
  tracks: false
sonars: {{}}
battery: {{full_v: {battery.full_v:g}, low_v: {battery.low_v:g}, empty_v: {battery.empty_v:g}, \
off_v: {battery.off_v:g}, capacity_ah: {battery.capacity_ah:g}}}
"""


def model_of(kit: Kit) -> RobotModel:
    """Return the model that the file describes; raise ConfigError if a number is out of range."""
    for text, value, (low, high) in (
        ("wheel diameter [mm]", kit.wheel_diameter_mm, DIAMETER_MM),
        ("wheel separation [mm]", kit.wheel_separation_mm, SEPARATION_MM),
        ("counts of a wheel turn", kit.counts_per_turn, COUNTS),
    ):
        if not low <= value <= high:
            raise ConfigError(f"{text} is {value:g}, expected a number from {low:g} to {high:g}")
    path = f"{kit.name}.yaml"
    return parse(yaml_file.parse(text_of(kit), path), path)
