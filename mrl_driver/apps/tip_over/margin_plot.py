"""Plots of the tip-over margin over acceleration and direction, or a sweep; needs matplotlib, which is optional."""

import math
from typing import Any

from mrl_driver import figures

from .margin import DIRECTIONS, NO_PUSH, Push, Vehicle, greatest_acceleration, least, limits, margins
from .sweep import Range, Situation, sweep

_DIRECTIONS_DRAWN, _VALUES = 120, 100
_LOWEST_DEG = -20.0  # lower end of the axis of a sweep's margins; the vehicle tips over far above it
_LINES = {
    "forward": (figures.BLUE, "-"),
    "back": (figures.ORANGE, "--"),
    "left": (figures.GREEN, ":"),
    "right": (figures.PINK, "-."),
}


def draw(
    vehicle: Vehicle, path: str, reserve_rad: float, slope_rad: float = 0.0, push: Push = NO_PUSH
) -> None:
    """Draw a vehicle's margins into a PNG, PDF or SVG file.

    Raises:
        ConfigError: matplotlib is missing, or the folder cannot be written.
        OutputError: the file cannot be written.
    """
    figures.require_writable(path)
    figure = figures.figure(11.0, 5.0)
    mass = vehicle.whole
    figure.suptitle(
        f"{figures.plain(vehicle.name)}: {mass.mass_kg:g} kg, centre of mass {mass.height_m:.3f} m above the ground"
    )
    _draw_margins(figure.add_subplot(1, 2, 1), vehicle, reserve_rad, slope_rad, push)
    _draw_directions(figure.add_subplot(1, 2, 2, projection="polar"), vehicle, reserve_rad, slope_rad, push)
    figures.save(figure, path)


def draw_sweep(situation: Situation, over: Range, path: str, reserve_rad: float) -> None:
    """Draw the least margin over a quantity into a PNG, PDF or SVG file.

    Raises:
        ConfigError: as `draw`, or the sweep needs an arm.
        OutputError: the file cannot be written.
    """
    figures.require_writable(path)
    found = sweep(situation, over, _VALUES + 1)
    figure = figures.figure(7.0, 4.5)
    axes = figure.add_subplot()
    angles = [math.degrees(margin.angle_rad) for _, margin in found]
    axes.plot([value for value, _ in found], angles, color=figures.BLUE, label="least margin")
    axes.axhspan(_LOWEST_DEG, 0.0, color=figures.ORANGE, alpha=0.2, label="tips over")
    if reserve_rad:
        axes.axhline(math.degrees(reserve_rad), color=figures.GREY, label="reserve")
    axes.set(
        xlabel=f"{over.name.replace('-', ' ')} [{over.quantity.unit}]",
        ylabel="least force-angle margin [deg]",
        title=figures.plain(situation.vehicle.name),
        xlim=(over.first, over.last),
        ylim=(_LOWEST_DEG, max(30.0, 1.1 * max(angles))),
    )
    axes.grid(color="0.9")
    axes.legend()
    figures.save(figure, path)


def _draw_margins(axes: Any, vehicle: Vehicle, reserve_rad: float, slope_rad: float, push: Push) -> None:
    most = 1.05 * max(limits(vehicle, 0.0, slope_rad, push).values()) or 1.0
    values = [most * i / _VALUES for i in range(_VALUES + 1)]
    for name, (x, y) in DIRECTIONS.items():
        colour, dashes = _LINES[name]
        slope = (-x * math.sin(slope_rad), -y * math.sin(slope_rad))
        angles = [
            math.degrees(least(margins(vehicle, (x * value, y * value), slope=slope, push=push)).angle_rad)
            for value in values
        ]
        axes.plot(values, angles, dashes, color=colour, label=name)
    axes.axhline(0.0, color="black", linewidth=0.8)
    if reserve_rad:
        axes.axhline(math.degrees(reserve_rad), color=figures.GREY, label="reserve")
    axes.set_xlabel("acceleration [m/s2]")
    axes.set_ylabel("least force-angle margin [deg]")
    axes.grid(color="0.9")
    axes.legend()


def _draw_directions(axes: Any, vehicle: Vehicle, reserve_rad: float, slope_rad: float, push: Push) -> None:
    angles = [2 * math.pi * i / _DIRECTIONS_DRAWN for i in range(_DIRECTIONS_DRAWN + 1)]
    for reserve, style, label in ((0.0, "-", "tips over"), (reserve_rad, "--", "keeps the reserve")):
        most = [
            greatest_acceleration(vehicle, (math.cos(angle), math.sin(angle)), reserve, slope_rad, push)
            for angle in angles
        ]
        axes.plot(angles, most, style, color=figures.BLUE if style == "-" else figures.ORANGE, label=label)
    axes.set_theta_zero_location("N")
    axes.set_title("greatest acceleration by direction [m/s2]", fontsize="medium")
    axes.legend(loc="lower right")
