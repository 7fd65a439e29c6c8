"""`mrl tip-over`: tip-over margin of a vehicle, and its largest safe acceleration."""

import math
from typing import TYPE_CHECKING, Mapping, Optional

import click

from .shared import Between, json_option, print_json

if TYPE_CHECKING:
    from mrl_driver.tip_over.margin import Vehicle


@click.command("tip-over")
@click.argument("vehicle")
@click.option(
    "--reserve",
    type=Between(0, 90, max_open=True),
    default=10.0,
    show_default=True,
    metavar="DEG",
    help="Margin to keep at least [deg].",
)
@click.option(
    "--slope",
    type=Between(0, 90, max_open=True),
    default=0.0,
    show_default=True,
    metavar="DEG",
    help="Slope of the ground, in the worst direction [deg].",
)
@click.option("--plot", "picture", metavar="PICTURE", type=click.Path(), help="Draw it: PNG, PDF or SVG.")
@json_option
def tip_over(vehicle: str, reserve: float, slope: float, picture: Optional[str], as_json: bool) -> None:
    """Show how much a vehicle may accelerate before it tips over.

    VEHICLE is mecanum-arm, a robot model, or a .yaml file: name, contacts (points [x, y] on the ground), body and
    payloads (mass_kg, x_m, y_m, height_m).  For a robot model, the centre of mass is assumed at half its height.

    \b
    Examples:
      mrl tip-over mecanum-arm
      mrl tip-over traxbot --slope 15
      mrl tip-over mecanum-arm --reserve 15 --plot arm.png
    """
    from mrl_driver.tip_over import margin, vehicle_file

    found = vehicle_file.load(vehicle)
    reserve_rad, slope_rad = math.radians(reserve), math.radians(slope)
    if picture:
        from mrl_driver.tip_over import margin_plot

        margin_plot.draw(found, picture, reserve_rad, slope_rad)
    tips = margin.limits(found, 0.0, slope_rad)
    kept = margin.limits(found, reserve_rad, slope_rad)
    if as_json:
        print_json(
            {
                "vehicle": found.name,
                "whole": found.whole._asdict(),
                "margin_rad": margin.least(margin.margins(found)).angle_rad,
                "tips_m_s2": tips,
                "limit_m_s2": kept,
                "reserve_rad": reserve_rad,
                "slope_rad": slope_rad,
                "picture": picture,
            }
        )
        return
    _print(found, tips, kept, reserve)
    if picture:
        click.echo(picture)


def _print(vehicle: "Vehicle", tips: Mapping[str, float], kept: Mapping[str, float], reserve: float) -> None:
    from mrl_driver.tip_over import margin

    mass = vehicle.whole
    click.echo(
        f"{vehicle.name}: {mass.mass_kg:g} kg, centre of mass at x {mass.x_m:.3f} m, y {mass.y_m:.3f} m, "
        f"height {mass.height_m:.3f} m"
    )
    margin_deg = math.degrees(margin.least(margin.margins(vehicle)).angle_rad)
    tips_at_rest = (
        "" if margin_deg > 0 else "; it tips over at rest: its centre of mass is not above its contacts"
    )
    click.echo(f"margin at rest on flat ground: {margin_deg:.1f} deg{tips_at_rest}")
    click.echo(f"{'accelerating':14}{'tips over at':>14}{f'{reserve:g} deg kept to':>18}   [m/s2]")
    for name in tips:
        click.echo(f"{name:14}{tips[name]:14.2f}{kept[name]:18.2f}")
    click.echo(
        f"limit in every direction: {min(kept.values()):.2f} m/s2; a curve uses v * omega of it sideways"
    )
