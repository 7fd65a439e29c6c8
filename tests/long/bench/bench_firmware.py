"""Measures the firmware images on the simulated chip; build/bench/firmware.json.  `make bench-firmware` runs it.

The figures of the 2013 firmware and of rosserial in docs/figures are from an earlier measurement on this bench, with
the released firmware of August 2013 and with a sketch on ros_lib; neither is in this repository.  The sketches of
`firmware/comparison` repeat that of `@6e`.

Figures with an IMU that streams have the suffix `_imu_100hz`, and those of the H-bridge image `_hbridge` before it.
With PWM on D9 and D10, so that another timer is the clock, the suffix is `_d9_d10`; on a Mega with four wheels `_mega`.
FAST=1 is shorter.
"""

import sys
import time
from functools import partial
from statistics import median
from typing import Callable, Dict, Mapping, NamedTuple, Optional, Tuple, TypeVar

from mrl_driver.robot.chips import ATMEGA2560
from sim_arduino.experiments import turnaround
from sim_arduino.experiments.experiment_robot import Setting
from tests.long.bench import bridge_measures as bridge
from tests.long.bench import firmware_measures as measures
from tests.long.bench import report
from tests.long.bench.bridge_board import (
    FOUR_WHEELS,
    ON_TIMER_1,
    WITH_INPUTS,
    WITH_SERVOS,
    BridgeRig,
    FullMega,
)
from tests.long.bench.figures import ROOT
from tests.long.bench.firmware_board import Rig
from tests.models import DUO_PINS


class Case(NamedTuple):
    """What is connected to the bus besides the motor board: the suffix of its figures, and the period of the IMU's
    stream [ms]; None is no IMU.  And the wiring of an H-bridge board."""

    suffix: str
    imu_period_ms: Optional[int]
    pins: Mapping[str, int] = DUO_PINS


CASES = Case("", None), Case("_imu_100hz", 10)
BRIDGE_CASES = (*CASES, Case("_d9_d10", None, ON_TIMER_1))
STOPS_OF_MEGA = {"pin_bumper_left": 36, "pin_emergency_stop": 37}
FOLDER = ROOT / "build" / "firmware"
ELF, BRIDGE_ELF, MEGA_ELF = (FOLDER / f"mrl_firmware{of}.elf" for of in ("", "_hbridge", "_hbridge_mega"))
BRIDGE_EDGES_HZ = 10000  # Edges of both wheels together in the figures that both images have
SUFFIX = "_hbridge"
Measure = Callable[[], Dict[str, float]]
RigOfCase = TypeVar("RigOfCase", bound=Rig)

MEASURES: Tuple[Callable[[measures.MakeRig], Dict[str, float]], ...] = (
    measures.memory_figures,
    measures.boot_figures,
    measures.turnaround_figures,
    measures.stream_figures,
    measures.count_age_figures,
    measures.checked_stream_figures,
    measures.command_figures,
    measures.rate_figures,
    measures.watchdog_figures,
    measures.hang_figures,
    measures.exact_figures,
)
IMU_MEASURES: Tuple[Callable[[measures.MakeRig], Dict[str, float]], ...] = (measures.imu_figures,)
BRIDGE_MEASURES: Tuple[Callable[[measures.MakeRig], Dict[str, float]], ...] = (
    measures.memory_figures,
    measures.boot_figures,
    measures.turnaround_figures,
    measures.stream_figures,
    bridge.watchdog_figures,
    bridge.exact_figures,
)
"""Measures with turning wheels."""
BRIDGE_TURNING: Tuple[Callable[[bridge.MakeTurning], Dict[str, float]], ...] = (
    bridge.edge_figures,
    bridge.sample_figures,
    bridge.stop_figures,
)


def timed(name: str, measure: Measure) -> Dict[str, float]:
    """What a measure gives; its duration is printed."""
    begun = time.monotonic()
    found = measure()
    print(f"{name} took {time.monotonic() - begun:.1f} s", file=sys.stderr)
    return found


def with_imu(make: Callable[[], RigOfCase], case: Case) -> RigOfCase:
    rig = make()
    if case.imu_period_ms is not None:
        rig.fit_imu(case.imu_period_ms)
    return rig


def measured(case: Case) -> Dict[str, float]:
    """All figures of the image for the OMNI-3MD."""
    figures: Dict[str, float] = {}
    make = partial(with_imu, partial(Rig, ELF), case)
    for measure in MEASURES + IMU_MEASURES * bool(case.imu_period_ms):
        figures.update(timed(f"{measure.__name__}{case.suffix}", partial(measure, make)))
    return figures


def measured_bridge(case: Case) -> Dict[str, float]:
    """All figures of the H-bridge image, without its suffix."""
    figures: Dict[str, float] = {}

    def turning(edges_hz: float) -> BridgeRig:
        return with_imu(partial(BridgeRig, BRIDGE_ELF, edges_hz, case.pins), case)

    make, suffix = partial(turning, BRIDGE_EDGES_HZ), f"{SUFFIX}{case.suffix}"
    for measure in BRIDGE_MEASURES + IMU_MEASURES * bool(case.imu_period_ms):
        figures.update(timed(f"{measure.__name__}{suffix}", partial(measure, make)))
    for alone in BRIDGE_TURNING:
        figures.update(timed(f"{alone.__name__}{suffix}", partial(alone, turning)))
    if not case.suffix:
        figures.update(timed(f"motion_figures{suffix}", partial(bridge.motion_figures, BRIDGE_ELF)))
        with_servos = partial(BridgeRig, BRIDGE_ELF, pins=WITH_SERVOS)
        figures.update(timed(f"servo_figures{suffix}", partial(bridge.servo_figures, with_servos)))
        fitted = partial(BridgeRig, BRIDGE_ELF, pins=WITH_INPUTS)
        figures.update(timed(f"input_figures{suffix}", partial(bridge.input_figures, fitted)))
    return figures


def measured_mega() -> Dict[str, float]:
    """Figures of a Mega with four wheels, six HC-SR04 and two servos, without their suffix."""
    turning = partial(FullMega, MEGA_ELF, pins=FOUR_WHEELS, chip=ATMEGA2560)
    fitted = partial(FullMega, MEGA_ELF, pins={**FOUR_WHEELS, **STOPS_OF_MEGA}, chip=ATMEGA2560)
    found = timed("memory_figures_mega", partial(measures.memory_figures, partial(turning, BRIDGE_EDGES_HZ)))
    found.update(timed("edge_figures_mega", partial(bridge.edge_figures, turning)))
    for measure, make in (
        (bridge.stop_figures, turning),
        (bridge.servo_figures, turning),
        (bridge.range_figures, turning),
        (bridge.input_figures, fitted),
    ):
        found.update(timed(f"{measure.__name__}_mega", partial(measure, make, bridge.FOUR_WHEELS_HZ)))
    return found


def measured_sketches() -> Dict[str, float]:
    """Turnaround of the request for the counters, median, of the sketches of `firmware/comparison` [us]."""
    sketches = {"2013": turnaround.TIMING_2013, "rosserial": turnaround.ROSSERIAL}
    return {
        f"encoders_turnaround_us_median_sketch_{column}": 1e6
        * median(message.reply_s for message in turnaround.measure(Setting(""), sketch))
        for column, sketch in sketches.items()
    }


def figures() -> Dict[str, report.Measured]:
    found: Dict[str, float] = {}
    for image, measure, cases in ("", measured, CASES), (SUFFIX, measured_bridge, BRIDGE_CASES):
        for case in cases:
            found.update({f"{key}{image}{case.suffix}": value for key, value in measure(case).items()})
    found.update({f"{key}{SUFFIX}_mega": value for key, value in measured_mega().items()})
    return {**found, **measured_sketches()}
