"""Drives circles until the battery packs are empty: how long they last at each speed, and how far the robot gets after
the driver's warning.
"""

import math
import random
from functools import partial
from typing import List, NamedTuple, Sequence

from mrl_driver.errors import BoardError, ConfigError, MrlError
from mrl_driver.robot import battery

from . import disturbances, plot_style
from .experiment_report import Measure, Result, over_seeds
from .experiment_robot import ExperimentRobot, Setting, open_robot

SPEEDS_MM_S = (50, 100, 200)
RADIUS_M = 0.3
EMPTY_V = 9.0  # end of the published discharges (Araujo 2012); the driver warns from here on
STOP_V = 8.5  # end of the emulated discharges: the driver stops the robot when the battery stays below
READ_PERIOD_S, EMULATED_READ_S = 10.0, 1.0
"""Time between two readings of a real battery, and of an emulated one, which the driver reads once a second [s]."""
PERIOD_MS = 100
TIME_LIMIT_S = 6 * 3600.0
FASTER, NEAR_END, NEAR_END_V = 60.0, 6.0, 9.6
"""Emulated packs have a capacity this many times smaller, at first and below a voltage; times are multiplied by it."""
TITLE = f"Circles until the packs reach {EMPTY_V:g} V"
REMARK = (
    "Put in: the currents, which are fitted to the published 2 to 3 hours, and the curve of the packs. Each seed draws "
    "the packs' capacity and resistance, and the noise of each reading. The control has a current that does not depend "
    "on the speed."
)


class Discharge(NamedTuple):
    """Readings of the battery over time at one speed."""

    speed_mm_s: int
    hours: List[float]
    volts: List[float]
    warned_h: float  # time of the driver's first warning [h]; infinite without one

    @property
    def duration_h(self) -> float:
        """Time until the first reading of at most `EMPTY_V` [h]."""
        return next((hour for hour, volts in zip(self.hours, self.volts) if volts <= EMPTY_V), self.hours[-1])

    @property
    def left_m(self) -> float:
        """Distance driven after the driver's warning [m]."""
        return 3.6 * self.speed_mm_s * (self.hours[-1] - self.warned_h)


Packs = List[Discharge]  # the discharges of one seed's packs, one for each speed


def run(setting: Setting) -> Result:
    """Drives each speed with full packs, and draws the voltages."""
    if setting.port is not None:
        real = [[_circle(setting, speed, EMPTY_V) for speed in SPEEDS_MM_S]]
        rows = [
            _lasts(number).figure(real)._replace(worst=None, put_in=False) for number in range(len(real[0]))
        ]
        return Result("power", TITLE, rows, [_draw(setting, real)])
    packs = over_seeds(_discharges, setting)
    level = over_seeds(partial(_discharges, steady=True), setting)
    first, last = SPEEDS_MM_S[0], SPEEDS_MM_S[-1]
    ratio = f"duration at {first} mm/s over that at {last} mm/s"
    left = f"distance from the driver's warning to {STOP_V:g} V, where it stops the robot, at {last} mm/s"
    rows = [_lasts(number).figure(packs) for number in range(len(SPEEDS_MM_S))]
    rows += [
        Measure("ratio", ratio, "", _ratio, min, "above 1", put_in=True).figure(packs, level),
        Measure("left_m", left, "m", lambda packs: packs[-1].left_m, min, put_in=True).figure(packs),
    ]
    return Result("power", TITLE, rows, [_draw(setting, packs)], REMARK)


def _lasts(number: int) -> Measure:
    """How long packs last at a speed [h]."""
    speed = f"{SPEEDS_MM_S[number]} mm/s"
    key = f"hours_{SPEEDS_MM_S[number]}_mm_s"
    return Measure(
        key, f"packs last at {speed}", "h", lambda packs: packs[number].duration_h, min, "2-3 h", put_in=True
    )


def _ratio(packs: Packs) -> float:
    return packs[0].duration_h / packs[-1].duration_h


def _discharges(setting: Setting, steady: bool = False) -> Packs:
    """The discharges of this seed's packs; of `steady` ones, whose current does not depend on the speed, two."""
    speeds, end_v = (SPEEDS_MM_S[:: len(SPEEDS_MM_S) - 1], EMPTY_V) if steady else (SPEEDS_MM_S, STOP_V)
    return [_circle(setting, speed, end_v, steady) for speed in speeds]


def _circle(setting: Setting, speed_mm_s: int, end_v: float, steady: bool = False) -> Discharge:
    linear = speed_mm_s / 1000
    driven = Discharge(speed_mm_s, [], [], math.inf)
    with open_robot(setting, "square", period_ms=PERIOD_MS, command_timeout_s=2 * READ_PERIOD_S) as robot:
        driver, packs = robot.driver, _EmulatedPacks(robot, setting, speed_mm_s, steady)
        if math.isnan(driver.board.battery_v):
            raise ConfigError(
                "the board does not measure its battery, which this experiment plots; expected one that does"
            )
        time_s = 0.0
        while not driven.volts or driven.volts[-1] > end_v:
            if not driver.drive(linear, linear / RADIUS_M):
                raise MrlError(
                    f"the robot refuses commands ({driver.stop_reason}, battery {driver.battery_state}); see mrl doctor"
                )
            time_s += packs.wait(driver.board.battery_v)
            driven.hours.append(time_s / 3600)
            driven.volts.append(driver.board.battery_v)
            if driver.battery_state != battery.OK:
                driven = driven._replace(warned_h=min(driven.warned_h, driven.hours[-1]))
            if time_s > TIME_LIMIT_S:
                raise BoardError(
                    f"the packs have {driven.volts[-1]:.1f} V after {TIME_LIMIT_S / 3600:g} h, "
                    f"expected at most {end_v:g} V; unplug the charger"
                )
    return driven


class _EmulatedPacks:
    """The packs of a robot; those of an emulated one have errors, and less capacity so that time passes faster."""

    def __init__(self, robot: ExperimentRobot, setting: Setting, speed_mm_s: int, steady: bool) -> None:
        self._robot, self._body = robot, robot.plant.robot if robot.plant else None
        if self._body is None:
            return
        self._rng = random.Random(f"readings {setting.seed} {speed_mm_s} {steady}")
        params = self._body.params
        if steady:
            params = params._replace(running_a=0.0, starting_a=0.0)
        capacity, resistance = disturbances.packs(setting.seed)
        self._capacity_ah = params.capacity_ah * capacity
        self._body.params = params._replace(resistance_ohm=params.resistance_ohm * resistance)

    def wait(self, volts: float) -> float:
        """Lets time pass until the next reading; returns how long a pack of full capacity takes for it [s]."""
        start_s, driver = self._robot.driver.now_s, self._robot.driver
        if self._body is None:
            driver.wait(READ_PERIOD_S)
            return driver.now_s - start_s
        factor = FASTER if volts > NEAR_END_V else NEAR_END
        self._body.params = self._body.params._replace(capacity_ah=self._capacity_ah / factor)
        self._body.sag(self._rng.gauss(0.0, disturbances.BATTERY_NOISE_V))
        driver.wait(EMULATED_READ_S)
        return factor * (driver.now_s - start_s)


def _draw(setting: Setting, packs: Sequence[Packs]) -> str:
    made, (axes,) = plot_style.figure()
    colours = (plot_style.BLUE, plot_style.ORANGE, plot_style.GREEN)
    for number, (speed, colour, line) in enumerate(zip(SPEEDS_MM_S, colours, plot_style.LINES)):
        hours = sorted(each[number].duration_h for each in packs)
        for index, each in enumerate(packs):
            label = f"{speed} mm/s: {hours[0]:.2f} to {hours[-1]:.2f} h" if index == 0 else None
            axes.plot(each[number].hours, each[number].volts, line, color=colour, linewidth=0.8, label=label)
    axes.axhline(EMPTY_V, color=plot_style.GREY, linewidth=1.0)
    axes.axvspan(2.0, 3.0, color=plot_style.SKY, alpha=0.2, label="published: 2 to 3 h")
    axes.set(xlabel="time [h]", ylabel="battery [V]", xlim=(0, None))
    axes.legend(loc="lower left")
    return plot_style.save(made, setting.folder, "power")
