"""Pictures of calibrations, as PNG, PDF or SVG.  Needs matplotlib, an extra of the package."""

from typing import Sequence

import numpy as np

from mrl_driver import figures
from mrl_driver.figures import BLUE, GREY, ORANGE
from mrl_driver.robot.sonar_curve import THESIS, SonarFit

from .gain_procedures import Tuned, listed
from .gains import speeds
from .imu_procedures import ImuOutcome
from .trial import LEFT


def draw_ends(path: str, before: np.ndarray, after: np.ndarray, senses: Sequence[str]) -> None:
    """Plot the errors of the ends, (R, 3) x y yaw, before and after, by direction; as in Borenstein and Feng 1996."""
    figure = figures.figure(6.0, 5.6)
    axes = figure.add_subplot()
    for sense, colour, name in ((LEFT, BLUE, LEFT), ("", ORANGE, "clockwise, or straight")):
        mine = np.array([(each == LEFT) == (sense == LEFT) for each in senses])
        if not mine.any():
            continue
        axes.plot(*(1000 * before[mine, :2].T), "o", mfc="none", color=colour, label=f"{name}, before")
        axes.plot(*(1000 * after[mine, :2].T), "+", color=colour, label=f"{name}, after")
    axes.axhline(0, color=GREY, linewidth=0.8)
    axes.axvline(0, color=GREY, linewidth=0.8)
    axes.set(
        xlabel="measured end minus odometry, x [mm]",
        ylabel="measured end minus odometry, y [mm]",
        aspect="equal",
        title="Errors of the odometry at the ends of the runs",
    )
    axes.margins(0.15)
    axes.legend(fontsize="small")
    figures.save(figure, path)


def draw_sonar(path: str, counts: np.ndarray, ranges_m: np.ndarray, fit: SonarFit) -> None:
    """Plot the curve, the readings (N,), and the remaining errors."""
    figure = figures.figure(7.0, 6.0)
    upper, lower = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": [2, 1]})
    valid = np.isfinite(counts)
    line = np.linspace(max(1.0, counts[valid].min() * 0.8), counts[valid].max() * 1.05, 200)
    a, b, c = fit.curve
    upper.plot(
        line, 100 * fit.curve.range_m(line), color=BLUE, label=f"{a:.4f} s^{b:.5f} {c:+.4f}, R² {fit.r2:.5f}"
    )
    upper.plot(
        line,
        100 * THESIS.range_m(line),
        "--",
        color=GREY,
        label="Araujo 2012: 1.1767 s^0.94657 -0.3759, R² 0.9992",
    )
    upper.plot(counts[fit.used], 100 * ranges_m[fit.used], "o", color=ORANGE, markersize=4, label="readings")
    upper.set(ylabel="distance [cm]", title="Sonar curve")
    upper.legend(fontsize="small")
    lower.axhline(0, color=GREY, linewidth=0.8)
    lower.plot(counts[fit.used], 100 * fit.errors_m[fit.used], "o", color=ORANGE, markersize=4)
    lower.set(xlabel="ADC count s", ylabel="curve minus\ndistance [cm]")
    figures.save(figure, path)


def draw_gains(path: str, tuned: Tuned) -> None:
    """Plot the steps of both wheels with the old and the new gains, and the target if it is known."""
    figure = figures.figure(7.0, 5.6)
    pair = figure.subplots(2, 1, sharex=True)
    for axes, name in zip(pair, ("left", "right")):
        for steps, gains, colour, style in (
            (tuned.steps_before, tuned.before, GREY, "--"),
            (tuned.steps_after, tuned.after, BLUE, "-"),
        ):
            times_s, speed = speeds(steps.times_s, steps.of(name))
            axes.plot(times_s, speed, style, color=colour, label=listed(gains))
        if tuned.target_counts_s is not None:
            axes.axhline(tuned.target_counts_s, color=ORANGE, linewidth=0.8, label="target")
        axes.set(ylabel=f"{name} wheel [count/s]")
        axes.legend(fontsize="small", loc="lower right")
    pair[0].set(title="Step response of the speed")
    pair[1].set(xlabel="time since the step [s]")
    figures.save(figure, path)


def draw_gyro(path: str, outcome: ImuOutcome) -> None:
    """Plot the error of the gyro over the angle of each turn, before and after."""
    figure = figures.figure(6.0, 4.0)
    axes = figure.add_subplot()
    angles = np.degrees([turn.true_rad for turn in outcome.turns])
    for name, style, colour, mount in (
        ("before", "o", ORANGE, outcome.before),
        ("after", "+", BLUE, outcome.after),
    ):
        errors = np.degrees([turn.error_rad(mount.gyro_scale) for turn in outcome.turns])
        axes.plot(angles, errors, style, color=colour, label=f"{name}, scale {mount.gyro_scale:.4f}")
    axes.axhline(0, color=GREY, linewidth=0.8)
    axes.set(xlabel="true angle [deg]", ylabel="gyro minus truth [deg]", title="Errors of the gyro")
    axes.legend(fontsize="small")
    figures.save(figure, path)
