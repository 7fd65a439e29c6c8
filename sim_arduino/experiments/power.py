"""Endless circles until the packs reach 9 V: how long do they last at which speed?"""

from typing import List, NamedTuple, Tuple

from mrl_driver.errors import BoardError, MrlError

from . import plots
from .report import Figure, Result
from .stage import Actor, Setting, actor

SPEEDS_MM_S = (50, 100, 200)
RADIUS_M = 0.3
EMPTY_V = 9.0
LOOK_S = 10.0
PERIOD_MS = 50
MOST_S = 6 * 3600.0
LAPSE = 10.0
"""Emulated packs hold so many times less, and their time counts so many times more."""


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
        "Published: 2 to 3 hours, shorter with speed. The emulated packs are fitted to these two ends; they hold a "
        f"{LAPSE:g}th, and their time counts {LAPSE:g} times."
    )
    return Result("power", "Endless circles until the packs reach 9 V", rows, [_draw(setting, runs)], remark)


def _circle(setting: Setting, speed_mm_s: int) -> PowerRun:
    linear = speed_mm_s / 1000
    driven = PowerRun(speed_mm_s, [], [])
    with actor(setting, "square", period_ms=PERIOD_MS, command_timeout_s=2 * LOOK_S) as robot:
        driver, (lapse, look_s) = robot.driver, _lapse(robot)
        start_s = driver.now_s
        while not driven.volts or driven.volts[-1] > EMPTY_V:
            if not driver.drive(linear, linear / RADIUS_M):
                raise MrlError(
                    f"the robot takes no command ({driver.stop_reason}, battery {driver.battery_state})"
                )
            driver.wait(look_s)
            driven.hours.append(lapse * (driver.now_s - start_s) / 3600)
            driven.volts.append(driver.battery_v)
            if driven.hours[-1] > MOST_S / 3600:
                raise BoardError(
                    f"the packs have {driven.volts[-1]:.1f} V after {MOST_S / 3600:g} h; are they charged on?"
                )
    return driven


def _lapse(robot: Actor) -> Tuple[float, float]:
    """How many times time counts, and how often to look [s]; an emulated robot's packs are made to fit."""
    if robot.plant is None:
        return 1.0, LOOK_S
    body = robot.plant.robot
    body.params = body.params._replace(capacity_ah=body.params.capacity_ah / LAPSE)
    return LAPSE, LOOK_S / LAPSE


def _draw(setting: Setting, runs: List[PowerRun]) -> str:
    made, (axes,) = plots.figure()
    colours = (plots.BLUE, plots.ORANGE, plots.GREEN)
    for each, colour, line in zip(runs, colours, plots.LINES):
        label = f"{each.speed_mm_s} mm/s: {each.hours[-1]:.2f} h"
        axes.plot(each.hours, each.volts, line, color=colour, label=label)
    axes.axhline(EMPTY_V, color=plots.GREY, linewidth=1.0)
    axes.axvspan(2.0, 3.0, color=plots.SKY, alpha=0.2, label="published: 2 to 3 h")
    axes.set(xlabel="time [h]", ylabel="battery [V]", xlim=(0, None))
    axes.legend(loc="lower left")
    return plots.save(made, setting.folder, "power")
