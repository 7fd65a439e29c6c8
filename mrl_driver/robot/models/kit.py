"""The model file of a new robot with two or four wheels on H-bridges, from the few numbers that its builder knows."""

import math
from typing import Dict, Mapping, NamedTuple, Set, Tuple

from mrl_driver import yaml_file
from mrl_driver.errors import ConfigError
from mrl_driver.protocol.table import INT16_MAX, NOT_CONNECTED
from mrl_driver.robot import wiring
from mrl_driver.robot.chips import ATMEGA328P, Chip
from mrl_driver.yaml_form import schema_line

from . import CONTROLLED, RANGE_KINDS, SCHEMA, RobotModel, load, load_packaged, names, parse
from .drives import DIFFERENTIAL, FOUR_WHEELS, MECANUM, SKID

LEAST_ID = 11  # ids below belong to the robots of the papers
LIKE = "duo"  # model whose other numbers a new robot has until it is calibrated
CEILING_SHARE = 0.85
"""Ceiling of the speed as a share of full speed, so that the control has duty left; assumed."""
NOMINAL_COUNTS = 1000.0
"""Counts of a wheel turn in the file of a robot without encoders, which nothing counts."""
SKID_SLIP = 0.4
"""Share of the yaw that four wheels lose by sliding in a turn, until it is calibrated; assumed."""
DIAMETER_MM, SEPARATION_MM, COUNTS = (10.0, 650.0), (30.0, 650.0), (4.0, 100_000.0)
"""Ranges of the numbers; half the separation and the wheel's radius must fit into 16 bits of 0.01 mm."""


_RANGE = "low_rad: -0.785, high_rad: 0.785, low_us: 1000, high_us: 2000"
_SERVOS = (("pan", _RANGE), ("tilt", f"{_RANGE}, tilts: true, parent: pan"))
"""Servos of a camera, and what they are assumed to be: usual ones, which turn by 90 degrees for 1 ms."""


SONAR_PLACES: Dict[str, Tuple[int, int, int]] = {
    "front": (1, 0, 0),
    "left": (1, 1, 45),
    "right": (1, -1, -45),
    "rear": (-1, 0, 180),
    "rear_left": (-1, 1, 135),
    "rear_right": (-1, -1, -135),
}
"""Range sensors of a new robot: place on the outline, as shares of half the body's length and width, and yaw [deg].

They are assumed.  A sensor is behind its place as far as its dead zone reaches, if the body is that large.
"""


class Kit(NamedTuple):
    """What the builder of a robot knows."""

    name: str
    robot_id: int
    wheel_diameter_mm: float
    wheel_separation_mm: float
    counts_per_turn: float  # encoder counts of a wheel turn; `NOMINAL_COUNTS` without encoders
    bridge: str  # one of `table.BRIDGES`
    pins: Mapping[str, int]  # the wiring
    chip: Chip = ATMEGA328P
    kind: str = DIFFERENTIAL  # or one of `FOUR_WHEELS`
    wheelbase_mm: float = 0.0  # from the front axle to the rear one, of mecanum wheels
    sonars: Mapping[str, Tuple[str, str]] = {}
    """Input and type of the range sensor at each of `SONAR_PLACES` that has one."""

    @property
    def half_body_m(self) -> Tuple[float, float]:
        """Half the length and half the width of the body, which are assumed [m]."""
        across_m = self.wheel_separation_mm / 1000
        length_m = max(across_m, self.wheelbase_mm / 1000) + self.wheel_diameter_mm / 2000
        return length_m / 2, across_m / 2 + 0.01

    @property
    def axis_radius_m(self) -> float:
        """Half the separation of two wheels that would run as fast in a turn [m]."""
        across_mm = self.wheel_separation_mm + (self.wheelbase_mm if self.kind == MECANUM else 0.0)
        return across_mm / 2000 / (1 - (SKID_SLIP if self.kind == SKID else 0.0))


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
    full_speed = _full_speed(gearbox_and_counts(kit.counts_per_turn), like.board["full_speed"])
    full_mm_s = full_speed / 60 * math.pi * kit.wheel_diameter_mm
    ceiling = max(1, round(CEILING_SHARE * full_mm_s))
    turning = max(1, min(INT16_MAX, round(ceiling / kit.axis_radius_m)))
    return _drive_and_board(
        kit, {**like.board, "full_speed": full_speed}, ceiling, turning
    ) + _limits_and_body(kit, like, ceiling, turning)


def _full_speed(counts: Tuple[int, int], assumed: int) -> int:
    """Return the assumed speed of a wheel, or the nearest one whose counts the board can control [1/min]."""
    slowest, fastest = (60 * counts_s / (counts[0] * counts[1] / 100) for counts_s in CONTROLLED)
    return max(math.ceil(slowest), min(assumed, math.floor(fastest)))


def _drive_and_board(kit: Kit, like: Dict[str, int], ceiling: int, turning: int) -> str:
    gearbox, encoder_counts = gearbox_and_counts(kit.counts_per_turn)
    wheels = "four wheels" if kit.kind in FOUR_WHEELS else "two wheels"
    half = "half the separation" + (" plus half the wheelbase" if kit.kind == MECANUM else "")
    return f"""\
{schema_line(SCHEMA)}
# {kit.name}: {wheels} on H-bridges; from mrl new.  Numbers that it did not ask for are assumed.
name: {kit.name}
ids: [{kit.robot_id}]
{_drive(kit, like)}board:
  axis_radius: {round(kit.axis_radius_m * 1e5)}                # 0.01 mm, {half}
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
{_wiring(kit)}"""


def _drive(kit: Kit, like: Dict[str, int]) -> str:
    """Return the section of the base."""
    diameter_m, separation_m = kit.wheel_diameter_mm / 1000, kit.wheel_separation_mm / 1000
    kind = "" if kit.kind == DIFFERENTIAL else f"  kind: {kit.kind}\n"
    if kit.kind == MECANUM:
        return f"""\
drive:
{kind}  half_length_m: {kit.wheelbase_mm / 2000:.6g}
  half_width_m: {separation_m / 2:.6g}
  wheel_radius_m: {diameter_m / 2:.6g}
  counts_per_turn: {kit.counts_per_turn:g}
  full_speed_m_s: {like["full_speed"] / 60 * math.pi * diameter_m:.3f}
"""
    nominal = ", nominal: no encoders" if kit.pins[wiring.NO_ENCODERS] else ""
    wheel = f"pi x {diameter_m:.6g} m at {kit.counts_per_turn:g} counts a turn{nominal}"
    slip = f"  turn_slip: {SKID_SLIP:g}                  # mrl calibrate turn\n" if kit.kind == SKID else ""
    return f"""\
drive:
{kind}  wheel_separation_m: {separation_m:.6g}
  metres_per_count: {math.pi * diameter_m / kit.counts_per_turn:.12f}   # {wheel}
{slip}"""


def _wiring(kit: Kit) -> str:
    """Return the section of the pins: those that are connected."""
    words = {True: "true", False: "false"}
    chip = kit.chip
    section = wiring.section(kit.pins, chip)
    if chip is not ATMEGA328P:
        section = {"chip": chip.name, **section}
    lines = "wiring:\n" + "".join(f"  {name}: {words.get(pin, pin)}\n" for name, pin in section.items())
    fitted = [number for number, name in enumerate(wiring.SERVOS, 1) if kit.pins[name] != NOT_CONNECTED]
    servos = "".join(
        f"  {name}: {{servo: {number}, {row}}}\n" for number, (name, row) in zip(fitted, _SERVOS)
    )
    return lines + ("servos:\n" + servos if servos else "")


def _limits_and_body(kit: Kit, like: RobotModel, ceiling: int, turning: int) -> str:
    (half_length_m, half_width_m), limits, battery = kit.half_body_m, like.limits, like.battery
    return f"""\
limits:
  linear_m_s: {min(limits.linear_m_s, ceiling / 1000):g}
  angular_rad_s: {min(limits.angular_rad_s, turning / 1000):g}
  linear_acceleration_m_s2: {limits.linear_acceleration_m_s2:g}
  angular_acceleration_rad_s2: {limits.angular_acceleration_rad_s2:g}
body:
  length_m: {2 * half_length_m:.3f}
  width_m: {2 * half_width_m:.3f}
  height_m: {kit.wheel_diameter_mm / 1000 + 0.03:.3f}
  mass_kg: {like.body.mass_kg:g}
  tracks: false
{_sonars(kit)}battery: {{full_v: {battery.full_v:g}, low_v: {battery.low_v:g}, empty_v: {battery.empty_v:g}, \
off_v: {battery.off_v:g}, capacity_ah: {battery.capacity_ah:g}}}
"""


def _sonars(kit: Kit) -> str:
    """Return the section of the range sensors."""
    lines, (half_length_m, half_width_m) = [], kit.half_body_m
    for name, (place, kind) in kit.sonars.items():
        ahead, aside, yaw_deg = SONAR_PLACES[name]
        back_m, yaw_rad = RANGE_KINDS[kind].nearest_m, math.radians(yaw_deg)
        x_m = ahead * max(-half_length_m, half_length_m - back_m * abs(math.cos(yaw_rad)))
        y_m = aside * max(0.0, half_width_m - back_m * abs(math.sin(yaw_rad))) + 0.0  # not -0.0
        lines.append(
            f"  {name}: {{input: {place}, type: {kind}, x_m: {x_m:.3f}, y_m: {y_m:.3f}, yaw_deg: {yaw_deg}}}\n"
        )
    heading = "sonars:                    # assumed places: correct them\n" if lines else "sonars: {}\n"
    return heading + "".join(lines)


def model_of(kit: Kit) -> RobotModel:
    """Return the model that the file describes; raise ConfigError if a number is out of range."""
    for text, value, (low, high) in (
        ("wheel diameter [mm]", kit.wheel_diameter_mm, DIAMETER_MM),
        ("wheel separation [mm]", kit.wheel_separation_mm, SEPARATION_MM),
        ("wheel separation with wheelbase or slip [mm]", kit.axis_radius_m * 2000, SEPARATION_MM),
        ("counts of a wheel turn", kit.counts_per_turn, COUNTS),
    ):
        if not low <= value <= high:
            raise ConfigError(f"{text} is {value:g}, expected a number from {low:g} to {high:g}")
    path = f"{kit.name}.yaml"
    return parse(yaml_file.parse(text_of(kit), path), path)
