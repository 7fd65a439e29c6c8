"""Drives circles until the battery packs reach 9 V, to measure how long they last at each speed."""

import math
from typing import List, NamedTuple, Tuple

from mrl_driver.errors import BoardError, ConfigError, MrlError

from . import plot_style
from .experiment_report import Figure, Result
from .experiment_robot import ExperimentRobot, Setting, open_robot

SPEEDS_MM_S = (50, 100, 200)
RADIUS_M = 0.3
EMPTY_V = 9.0
READ_PERIOD_S = 10.0
PERIOD_MS = 50
TIME_LIMIT_S = 6 * 3600.0
TIME_FACTOR = 10.0
"""Emulated packs have a capacity this many times smaller, and measured times are multiplied by it."""


class PowerRun(NamedTuple):
    """Voltages over time at one speed."""

    speed_mm_s: int
    hours: List[float]
    volts: List[float]


def run(setting: Setting) -> Result:
    """Drives each speed with full packs, and draws the voltages."""
    runs = [_circle(setting, speed) for speed in SPEEDS_MM_S]
    rows = [
        Figure(
            f"hours_{each.speed_mm_s}_mm_s",
            f"packs last at {each.speed_mm_s} mm/s",
            each.hours[-1],
            "h",
            "2-3 h",
        )
        for each in runs
    ]
    remark = (
        "Published: 2 to 3 hours, shorter at higher speed. The emulated packs are fitted to these figures; they hold a "
        f"{TIME_FACTOR:g}th, and measured times are multiplied by {TIME_FACTOR:g}."
    )
    return Result("power", "Circles until the packs reach 9 V", rows, [_draw(setting, runs)], remark)


def _circle(setting: Setting, speed_mm_s: int) -> PowerRun:
    linear = speed_mm_s / 1000
    driven = PowerRun(speed_mm_s, [], [])
    with open_robot(setting, "square", period_ms=PERIOD_MS, command_timeout_s=2 * READ_PERIOD_S) as robot:
        driver, (factor, period_s) = robot.driver, _time_factor(robot)
        if math.isnan(driver.battery_v):
            raise ConfigError(
                "the board does not measure its battery, which this experiment plots; expected one that does"
            )
        start_s = driver.now_s
        while not driven.volts or driven.volts[-1] > EMPTY_V:
            if not driver.drive(linear, linear / RADIUS_M):
                raise MrlError(
                    f"the robot refuses commands ({driver.stop_reason}, battery {driver.battery_state}); see mrl doctor"
                )
            driver.wait(period_s)
            driven.hours.append(factor * (driver.now_s - start_s) / 3600)
            driven.volts.append(driver.battery_v)
            if driven.hours[-1] > TIME_LIMIT_S / 3600:
                raise BoardError(
                    f"the packs have {driven.volts[-1]:.1f} V after {TIME_LIMIT_S / 3600:g} h, "
                    f"expected at most {EMPTY_V:g} V; unplug the charger"
                )
    return driven


def _time_factor(robot: ExperimentRobot) -> Tuple[float, float]:
    """Factor for times, and period of the readings [s]; reduces the capacity of an emulated robot's packs."""
    if robot.plant is None:
        return 1.0, READ_PERIOD_S
    body = robot.plant.robot
    body.params = body.params._replace(capacity_ah=body.params.capacity_ah / TIME_FACTOR)
    return TIME_FACTOR, READ_PERIOD_S / TIME_FACTOR


def _draw(setting: Setting, runs: List[PowerRun]) -> str:
    made, (axes,) = plot_style.figure()
    colours = (plot_style.BLUE, plot_style.ORANGE, plot_style.GREEN)
    for each, colour, line in zip(runs, colours, plot_style.LINES):
        label = f"{each.speed_mm_s} mm/s: {each.hours[-1]:.2f} h"
        axes.plot(each.hours, each.volts, line, color=colour, label=label)
    axes.axhline(EMPTY_V, color=plot_style.GREY, linewidth=1.0)
    axes.axvspan(2.0, 3.0, color=plot_style.SKY, alpha=0.2, label="published: 2 to 3 h")
    axes.set(xlabel="time [h]", ylabel="battery [V]", xlim=(0, None))
    axes.legend(loc="lower left")
    return plot_style.save(made, setting.folder, "power")
