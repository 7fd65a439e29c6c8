"""Plots of the tip-over margin over acceleration and direction, or a sweep; needs matplotlib, which is optional."""

import math
from typing import Any

from mrl_driver import figures

from .margin import DIRECTIONS, Situation, greatest_acceleration, limits
from .sweep import Range, sweep

_DIRECTIONS_DRAWN, _VALUES = 120, 100
_LOWEST_DEG = -20.0  # lower end of the axis of a sweep's margins; the vehicle tips over far above it
_LINES = {
    "forward": (figures.BLUE, "-"),
    "back": (figures.ORANGE, "--"),
    "left": (figures.GREEN, ":"),
    "right": (figures.PINK, "-."),
}


def draw(now: Situation, path: str, reserve_rad: float) -> None:
    """Draw a vehicle's margins over acceleration and direction into a PNG, PDF or SVG file."""
    figures.require_writable(path)
    figure, mass = figures.figure(11.0, 5.0), now.vehicle.whole
    figure.suptitle(
        f"{figures.plain(now.vehicle.name)}: {mass.mass_kg:g} kg, centre of mass {mass.height_m:.3f} m above the ground"
    )
    _draw_margins(figure.add_subplot(1, 2, 1), now, reserve_rad)
    _draw_directions(figure.add_subplot(1, 2, 2, projection="polar"), now, reserve_rad)
    figures.save(figure, path)


def draw_sweep(now: Situation, over: Range, path: str, reserve_rad: float) -> None:
    """Draw the least margin over a quantity into a PNG, PDF or SVG file."""
    figures.require_writable(path)
    found = sweep(now, over, _VALUES + 1)
    figure = figures.figure(7.0, 4.5)
    axes = figure.add_subplot()
    angles = [math.degrees(margin.angle_rad) for _, margin in found]
    axes.plot([value for value, _ in found], angles, color=figures.BLUE, label="least margin")
    axes.axhspan(_LOWEST_DEG, 0.0, color=figures.ORANGE, alpha=0.2, label="tips over")
    axes.set(
        title=figures.plain(now.vehicle.name),
        xlim=(over.first, over.last),
        ylim=(_LOWEST_DEG, max(30.0, 1.1 * max(angles))),
    )
    _finish(axes, f"{over.name.replace('-', ' ')} [{over.quantity.unit}]", reserve_rad)
    figures.save(figure, path)


def _finish(axes: Any, x_label: str, reserve_rad: float) -> None:
    if reserve_rad:
        axes.axhline(math.degrees(reserve_rad), color=figures.GREY, label="reserve")
    axes.set(xlabel=x_label, ylabel="least force-angle margin [deg]")
    axes.grid(color="0.9")
    axes.legend()


def _draw_margins(axes: Any, now: Situation, reserve_rad: float) -> None:
    most = 1.05 * max(limits(now).values()) or 1.0
    values = [most * i / _VALUES for i in range(_VALUES + 1)]
    for name, direction in DIRECTIONS.items():
        colour, dashes = _LINES[name]
        found = [now._replace(acceleration_m_s2=value, direction=direction).margin() for value in values]
        angles = [math.degrees(each.angle_rad) for each in found]
        axes.plot(values, angles, dashes, color=colour, label=name)
    axes.axhline(0.0, color="black", linewidth=0.8)
    _finish(axes, "acceleration [m/s2]", reserve_rad)


def _draw_directions(axes: Any, now: Situation, reserve_rad: float) -> None:
    angles = [2 * math.pi * i / _DIRECTIONS_DRAWN for i in range(_DIRECTIONS_DRAWN + 1)]
    for reserve, style, colour, label in (
        (0.0, "-", figures.BLUE, "tips over"),
        (reserve_rad, "--", figures.ORANGE, "keeps the reserve"),
    ):
        most = [greatest_acceleration(now, (math.cos(angle), math.sin(angle)), reserve) for angle in angles]
        axes.plot(angles, most, style, color=colour, label=label)
    axes.set_theta_zero_location("N")
    axes.set_title("greatest acceleration by direction [m/s2]", fontsize="medium")
    axes.legend(loc="lower right")
