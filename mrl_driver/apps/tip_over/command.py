"""`mrl tip-over`: tip-over margin of a vehicle, its largest safe acceleration, and the force that tips it over."""

import math
from typing import Any, Dict, Optional

import click

from mrl_driver import figures
from mrl_driver.cli.commands.shared import Between, json_option, print_json
from mrl_driver.errors import ConfigError

from . import margin, vehicle_file
from .margin import DIRECTIONS, Push, Range, Situation, Vector, greatest_acceleration, limits

_LINES = 12  # most lines of a sweep that are printed
_NAMED: Dict[str, Vector] = {name: (*level, 0.0) for name, level in DIRECTIONS.items()}
_NAMED.update(up=(0.0, 0.0, 1.0), down=(0.0, 0.0, -1.0))  # directions of a force, by name
_VALUES = 100
_LOWEST_DEG = -20.0  # lower end of the axis of a sweep's margins; the vehicle tips over far above it


def _number(name: str, low: float, high: float, unit: str, text: str, **options: Any) -> Any:
    """An option that takes a number; `min_open` and `max_open` are those of `Between`."""
    ends = {key: options.pop(key) for key in ("min_open", "max_open") if key in options}
    shown = "default" in options
    return click.option(
        name, type=Between(low, high, **ends), metavar=unit, help=text, show_default=shown, **options
    )


@click.command("tip-over")
@click.argument("vehicle")
@_number("--reserve", 0, 90, "DEG", "Margin to keep at least [deg].", max_open=True, default=10.0)
@_number(
    "--slope", 0, 90, "DEG", "Slope of the ground, in the worst direction [deg].", max_open=True, default=0.0
)
@_number(
    "--acceleration",
    0,
    1000,
    "M_S2",
    "Acceleration that acts with a force or in a sweep, in the worst direction [m/s2].",
    default=0.0,
)
@_number("--force", 0, 1e5, "N", "External force [N].")
@click.option(
    "--at",
    metavar="X,Y,HEIGHT",
    help="Point of attack of the force [m]: forward, to the left, above the ground; default: the tip of the arm.",
)
@click.option(
    "--direction",
    default="worst",
    show_default=True,
    metavar="DIRECTION",
    help=f"Direction of the force: worst, {', '.join(_NAMED)}, or a vector X,Y,UP.",
)
@_number("--arm-angle", 0, 180, "DEG", "Angle of the arm: 0 forward, 90 up [deg].")
@_number("--arm-height", 0, 100, "M", "Height of the arm's lower end [m].", min_open=True)
@click.option(
    "--sweep",
    "swept",
    metavar="QUANTITY=FROM:TO",
    help="Show the margin over arm-angle [deg], arm-height [m], acceleration [m/s2] or force [N].",
)
@click.option(
    "--plot",
    "picture",
    metavar="PICTURE",
    type=click.Path(),
    help="Draw that, or the margin over the acceleration: PNG, PDF or SVG.",
)
@click.option(
    "--limits",
    "robot",
    metavar="ROBOT",
    help="Write the limits of acceleration, braking and curves that keep the reserve to this robot's file.",
)
@json_option
def tip_over(
    vehicle: str,
    reserve: float,
    swept: Optional[str],
    picture: Optional[str],
    robot: Optional[str],
    **given: Any,
) -> None:
    """Show how much a vehicle may accelerate before it tips over.

    With --force, also which external force tips it over.  With --limits, the driver keeps to it from then on.

    VEHICLE is mecanum-arm, a robot model, or a .yaml file: name, contacts (points [x, y] on the ground), body and
    payloads (mass_kg, x_m, y_m, height_m), arm (mass_kg, place of its lower end, length_m, centre_m, angle_deg).  For a
    robot model, the centre of mass is assumed at half its height.

    \b
    Examples:
      mrl tip-over mecanum-arm
      mrl tip-over traxbot --slope 15 --force 5 --at 0,0,0.1
      mrl tip-over mecanum-arm --force 30 --direction left
      mrl tip-over mecanum-arm --sweep arm-angle=0:180 --plot angle.png
      mrl tip-over tall.yaml --slope 5 --limits myrobot.yaml
    """
    as_json = given.pop("as_json")
    if robot and (swept or picture):
        raise ConfigError(f"--limits and {'--sweep' if swept else '--plot'} are given, expected one of them")
    if picture is not None:
        figures.require_writable(picture)
    situation = _situation(Situation(vehicle_file.load(vehicle)), swept or "", **given)
    if swept is not None:
        _show_sweep(situation, margin.parse_range(swept), math.radians(reserve), picture, as_json)
    elif robot:
        from .robot_limits import write_limits  # it needs numpy

        _tell_limits(write_limits(situation, math.radians(reserve), robot), as_json)
    else:
        _show(situation, math.radians(reserve), picture, as_json)


def _tell_limits(written: Dict[str, Any], as_json: bool) -> None:
    numbers = ", ".join(f"{name} {written[name]:.3g}" for name in written if name.endswith("_s2"))
    if as_json:
        print_json(written)
    else:
        click.echo(f"{written['file']}: {numbers}; the file as it was: {written['kept']}")


def _situation(
    situation: Situation, swept: str, *, at: Optional[str], direction: str, slope: float, **given: Any
) -> Situation:
    acceleration, force = given.pop("acceleration"), given["force"]
    named = {"acceleration": acceleration or None, **given}
    twice = [name.replace("_", "-") for name, value in named.items() if value is not None]
    twice = [name for name in twice if swept.startswith(f"{name}=")]
    if twice:
        raise ConfigError(f"--{twice[0]} and --sweep {swept} are given, expected one of them")
    arm = {"angle_deg": given["arm_angle"], "height_m": given["arm_height"]}
    changed = {name: value for name, value in arm.items() if value is not None}
    if changed:
        situation = situation.with_arm(**changed)
    pushed = force is not None or swept.startswith("force=")
    if not pushed and (at is not None or direction != "worst"):
        raise ConfigError("--at and --direction are given without a force, expected --force N too")
    push = Push(force or 0.0, None if at is None else _vector("--at", at), _direction(direction))
    if pushed and push.at_m is None:
        push = push._replace(at_m=None if swept.startswith("arm") else situation.vehicle.tip)
    if push.at_m is not None and push.at_m[2] < 0:
        raise ConfigError(f"--at {at} is below the ground, expected a height of at least 0")
    return situation._replace(acceleration_m_s2=acceleration, slope_rad=math.radians(slope), push=push)


def _vector(option: str, text: str) -> Vector:
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        x = y = z = math.nan
    if not all(math.isfinite(each) and abs(each) <= 1000 for each in (x, y, z)):
        raise ConfigError(f"{option} is {text!r}, expected three numbers such as 0.1,0,0.5")
    return x, y, z


def _direction(text: str) -> Optional[Vector]:
    if text == "worst":
        return None
    if text in _NAMED:
        return _NAMED[text]
    if "," not in text:
        raise ConfigError(f"--direction is {text!r}, expected worst, {', '.join(_NAMED)} or a vector X,Y,UP")
    x, y, z = _vector("--direction", text)
    length = math.sqrt(x * x + y * y + z * z)
    if not length:
        raise ConfigError("--direction is 0,0,0, expected a vector that is not zero")
    return x / length, y / length, z / length


# -- accelerations, and a force


def _show(situation: Situation, reserve_rad: float, picture: Optional[str], as_json: bool) -> None:
    vehicle, push = situation.vehicle, situation.push
    tips = limits(situation)
    if picture:
        over = Range("acceleration", 0.0, 1.05 * max(tips.values()) or 1.0)
        _draw_sweep(situation, over, picture, reserve_rad)
    made: Dict[str, Any] = {
        "vehicle": vehicle.name,
        "whole": vehicle.whole._asdict(),
        "margin_rad": Situation(vehicle).margin().angle_rad,
        "tips_m_s2": tips,
        "limit_m_s2": limits(situation, reserve_rad),
        "limit_anywhere_m_s2": greatest_acceleration(situation, None, reserve_rad),
        "reserve_rad": reserve_rad,
        "slope_rad": situation.slope_rad,
        "picture": picture,
    }
    if push.force_n or situation.acceleration_m_s2:
        made["acceleration_m_s2"] = situation.acceleration_m_s2
        made["loaded_margin_rad"] = situation.margin().angle_rad
    if push.force_n:
        made["push"] = {
            "force_n": push.force_n,
            "at_m": push.at_m,
            "worst": push.direction is None,
            "direction": situation.margin().push,
            "tips_n": margin.greatest_force(situation),
            "limit_n": margin.greatest_force(situation, reserve_rad),
        }
    if as_json:
        print_json(made)
        return
    _print(situation, made, math.degrees(reserve_rad))
    if picture:
        click.echo(picture)


def _print(situation: Situation, made: Dict[str, Any], reserve: float) -> None:
    mass, tips, kept = situation.vehicle.whole, made["tips_m_s2"], made["limit_m_s2"]
    click.echo(
        f"{situation.vehicle.name}: {mass.mass_kg:g} kg, centre of mass at x {mass.x_m:.3f} m, y {mass.y_m:.3f} m, "
        f"height {mass.height_m:.3f} m"
    )
    margin_deg = math.degrees(made["margin_rad"])
    tips_at_rest = (
        "" if margin_deg > 0 else "; it tips over at rest: its centre of mass is not above its contacts"
    )
    click.echo(f"margin at rest on flat ground: {margin_deg:.1f} deg{tips_at_rest}")
    if "loaded_margin_rad" in made:
        _print_load(situation, made, reserve)
    click.echo(f"{'accelerating':14}{'tips over at':>14}{f'{reserve:g} deg kept to':>18}   [m/s2]")
    for name in tips:
        click.echo(f"{name:14}{tips[name]:14.2f}{kept[name]:18.2f}")
    click.echo(
        f"limit in every direction: {made['limit_anywhere_m_s2']:.2f} m/s2; a curve uses v * omega of it sideways"
    )


def _print_load(situation: Situation, made: Dict[str, Any], reserve: float) -> None:
    parts = [f"{situation.acceleration_m_s2:g} m/s2 in the worst direction"] * bool(
        situation.acceleration_m_s2
    )
    push = made.get("push")
    if push:
        kind = "worst direction" if push["worst"] else "direction"
        parts.append(f"{push['force_n']:g} N at {_text(push['at_m'])} m, {kind} {_text(push['direction'])}")
    click.echo(f"margin with {' and '.join(parts)}: {_margin_text(made['loaded_margin_rad'])}")
    if push:
        click.echo(
            f"force there: tips over at {push['tips_n']:.1f} N, {reserve:g} deg kept to {push['limit_n']:.1f} N"
        )


def _text(vector: Vector) -> str:
    return ", ".join(f"{each:.2f}" for each in vector)


def _margin_text(angle_rad: float) -> str:
    return "tips over" if angle_rad < 0 else f"{math.degrees(angle_rad):.1f} deg"


# -- a sweep


def _show_sweep(
    situation: Situation, over: Range, reserve_rad: float, picture: Optional[str], as_json: bool
) -> None:
    found = margin.sweep(situation, over)
    turning = margin.crossings(situation, over, found)
    if picture:
        _draw_sweep(situation, over, picture, reserve_rad)
    if as_json:
        print_json(
            {
                "vehicle": situation.vehicle.name,
                "quantity": over.name,
                "unit": over.quantity.unit,
                "values": [value for value, _ in found],
                "margin_rad": [each.angle_rad for _, each in found],
                "crossings": turning,
                "picture": picture,
            }
        )
        return
    unit = over.quantity.unit
    click.echo(f"{f'{over.name} [{unit}]':>22}  least margin")
    for value, each in found[:: (len(found) - 1) // _LINES]:
        click.echo(f"{value:22g}  {_margin_text(each.angle_rad)}")
    for value in turning:
        click.echo(f"margin 0 at {value:.4g} {unit}")
    if picture:
        click.echo(picture)


# -- the picture


def _draw_sweep(now: Situation, over: Range, path: str, reserve_rad: float) -> None:
    found = margin.sweep(now, over, _VALUES + 1)
    figure = figures.figure(7.0, 4.5)
    axes = figure.add_subplot()
    angles = [math.degrees(each.angle_rad) for _, each in found]
    axes.plot([value for value, _ in found], angles, color=figures.BLUE, label="least margin")
    axes.axhspan(_LOWEST_DEG, 0.0, color=figures.ORANGE, alpha=0.2, label="tips over")
    if reserve_rad:
        axes.axhline(math.degrees(reserve_rad), color=figures.GREY, label="reserve")
    axes.set(
        title=figures.plain(now.vehicle.name),
        xlim=(over.first, over.last),
        ylim=(_LOWEST_DEG, max(30.0, 1.1 * max(angles))),
        xlabel=f"{over.name.replace('-', ' ')} [{over.quantity.unit}]",
        ylabel="least force-angle margin [deg]",
    )
    axes.grid(color="0.9")
    axes.legend()
    figures.save(figure, path)
