"""Measures the firmware images on the simulated chip and prints them beside the 2013 firmware and rosserial.

The columns of those two are from an earlier measurement on this bench, with the released firmware of August 2013 and
with a sketch on ros_lib; neither is in this repository.  The sketches of `firmware/comparison` repeat that of `@6e`.

`make bench-firmware` runs it; the figures go to build/bench/firmware.json as one flat object.  Those with an IMU have
the suffix `_imu`, those while it streams `_imu_100hz`, and those of the H-bridge image `_hbridge` before it.
"""

import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from statistics import median
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple, TypeVar

from mrl_driver.errors import MrlError
from sim_arduino.experiments import message_times
from sim_arduino.experiments.experiment_robot import Setting
from tests.bench import bridge_measures as bridge
from tests.bench import firmware_measures as measures
from tests.bench import report
from tests.bench.bridge_board import BridgeRig
from tests.bench.firmware_board import Rig


class Case(NamedTuple):
    """What is connected to the bus besides the motor board: the suffix of its figures, the heading of its column, and
    the period of the IMU's stream [ms]; 0 is an IMU that does not stream, None no IMU."""

    suffix: str
    heading: str
    imu_period_ms: Optional[int]


CASES = (Case("", "ours", None), Case("_imu", "IMU", 0), Case("_imu_100hz", "IMU 100Hz", 10))
FOLDER = Path(__file__).resolve().parents[2] / "build" / "firmware"
ELF, BRIDGE_ELF = FOLDER / "mrl_firmware.elf", FOLDER / "mrl_firmware_hbridge.elf"
BRIDGE_EDGES_HZ = 10000
"""Edges of both wheels together in the figures that both images have."""
Measure = Callable[[], Dict[str, float]]
RigOfCase = TypeVar("RigOfCase", bound=Rig)


class Row(NamedTuple):
    """A figure's name, what others reach, what physics allows, and our goal (`least`: more is better)."""

    key: str
    text: str
    board_2013: str
    rosserial: str
    limit: str
    goal: Optional[float]
    least: bool = False


ROWS = (
    Row("encoders_turnaround_us_median", "@6e, 15 bytes [us]", "2445", "2896", "1280", 1400),
    Row("encoders_sonars_turnaround_us_median", "@8e, 27 bytes [us]", "4877", "-", "2300", 2500),
    Row("info_turnaround_us_median", "@5e, 23 bytes [us]", "6442", "6422", "1960", 2200),
    Row("stream_typical_hz", "stream of 8, 27 bytes [1/s]", "325.5", "235", "436", 425, True),
    Row("stream_wire_use", "share of the wire, streaming", "0.75", "1.0", "1.0", 0.97, True),
    Row("stream_checked_wire_use", "the same with check, sequence, time", "-", "-", "1.0", 0.97, True),
    Row("stream_checked_frames_bad", "of its frames, refused by the decoder", "-", "-", "0", 0),
    Row("count_age_ms_max", "age of counts at the frame's start [ms]", "-", "-", "", 2),
    Row("stream_jitter_us", "largest - smallest gap at 20 ms [us]", "-", "-", "", 300),
    Row("imu_hz", "IMU frames behind a full stream [1/s]", "-", "-", "100", 99, True),
    Row("imu_jitter_us", "largest - smallest gap of IMU readings [us]", "-", "-", "", 1000),
    Row("move_idle_us_max", "move, line idle [us]", "792", "2125", "140", 350),
    Row("move_streaming_us_max", "move behind a full stream [us]", "39746", "4750", "about 400", 700),
    Row("stop_streaming_us_max", "stop behind a full stream [us]", "12502", "-", "about 350", 600),
    Row("commands_streaming_hz", "13-byte commands without loss [1/s]", "26.6", "400+", "886", 880, True),
    Row("int16_exact", "of 65536 values arrive exactly", "64796", "-", "65536", 65536, True),
    Row("boot_to_answer_ms", "start to first answer [ms]", "3349", "-", "", 300),
    Row("watchdog_stop_ms_max", "silent host to stop, watchdog 250 ms [ms]", "never", "-", "250", 265),
    Row("bus_hang_blocked_ms_max", "pause of the wire when I2C hangs [ms]", "for ever", "-", "", 25),
    Row("sram_free_bytes", "SRAM never touched [byte]", "1104", "65", "", 900, True),
    Row("flash_bytes", "flash [byte]", "13376", "16082", "32256", 21504),
)

BRIDGE_ROWS = (
    Row("encoders_turnaround_us_median", "@6e, 15 bytes [us]", "-", "-", "1280", 1400),
    Row("encoders_sonars_turnaround_us_median", "@8e, 27 bytes [us]", "-", "-", "2300", 2500),
    Row("stream_typical_hz", "stream of 8, 27 bytes [1/s]", "-", "-", "436", 425, True),
    Row("stream_wire_use", "share of the wire, streaming", "-", "-", "1.0", 0.97, True),
    Row("stream_jitter_us", "largest - smallest gap at 20 ms [us]", "-", "-", "", 300),
    Row("imu_hz", "IMU frames behind a full stream [1/s]", "-", "-", "100", 99, True),
    Row("imu_jitter_us", "largest - smallest gap of IMU readings [us]", "-", "-", "", 1000),
    Row("watchdog_stop_ms_max", "silent host to outputs off, 250 ms [ms]", "-", "-", "250", 265),
    Row("boot_to_answer_ms", "start to first answer [ms]", "-", "-", "", 300),
    Row("int16_exact", "of 65536 counts arrive exactly", "-", "-", "65536", 65536, True),
    Row("edges_hz", "edges, phase error 20 %, full load [1/s]", "-", "-", "", 40000, True),
    Row("sample_spread_us", "largest - smallest sample interval [us]", "-", "-", "64", 40),
    Row("sample_hz", "count samples [1/s]", "-", "-", "", 199, True),
    Row("stop_us_max", "@13e to outputs off, full load [us]", "-", "-", "", 250),
    Row("step_overshoot", "0 to 0.3 m/s, overshoot", "-", "-", "", 0.05),
    Row("step_mean_error", "the same, mean error", "-", "-", "", 0.01),
    Row("step_within_ms", "the same, within 5 % [ms]", "-", "-", "", 250),
    Row("slow_ripple", "peak to peak over mean at 0.02 m/s", "-", "-", "", 0.20),
    Row("sram_free_bytes", "SRAM never touched [byte]", "-", "-", "", 700, True),
    Row("flash_bytes", "flash [byte]", "-", "-", "32256", 24576),
)
"""Rows of the H-bridge image; their keys get `SUFFIX` in the file."""
SUFFIX = "_hbridge"

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


WIRE_USE = 0.97
"""Share of what the serial link leaves to the stream that it must use."""


def goal_of(row: Row, found: Dict[str, float]) -> Optional[float]:
    """The goal; a stream next to the IMU's can have what that leaves of the serial link."""
    left_hz = found.get("stream_left_hz") if row.key == "stream_typical_hz" else None
    return row.goal if left_hz is None else WIRE_USE * left_hz


def reaches(row: Row, found: Dict[str, float]) -> bool:
    """Is the goal met?  A figure that the case does not have is."""
    goal, value = goal_of(row, found), found.get(row.key)
    return goal is None or value is None or (value >= goal if row.least else value <= goal)


def shown(value: float) -> str:
    """A figure in at most four or five digits."""
    return (
        f"{value:.0f}"
        if value == int(value) or value >= 1000
        else f"{value:.3g}"
        if value < 1
        else f"{value:.1f}"
    )


Found = Sequence[Tuple[Case, Dict[str, float]]]
"""The figures of each case."""


def table(rows: Sequence[Row], found: Found) -> List[str]:
    """The lines to print."""
    layout = "{:<44}{:>10}{:>11}{:>11}{:>11}" + "{:>10}" * len(found) + "  {}"
    headings = [case.heading for case, _ in found]
    lines = [layout.format("figure", "2013", "rosserial", "limit", "goal", *headings, "")]
    for row in rows:
        values = [shown(figures[row.key]) if row.key in figures else "-" for _, figures in found]
        goal = "-" if row.goal is None else (">= " if row.least else "<= ") + shown(row.goal)
        missed = [case.heading for case, figures in found if not reaches(row, figures)]
        verdict = f"MISSED: {', '.join(missed)}" if missed else ""
        cells = (row.board_2013, row.rosserial, row.limit, goal, *values, verdict)
        lines.append(layout.format(row.text, *cells).rstrip())
    return lines


def bound(found: Found) -> List[str]:
    """What the serial link leaves to the full stream where the IMU streams as well."""
    return [
        f"{case.heading}: {figures['imu_hz']:.0f} IMU frames a second leave room for {figures['stream_left_hz']:.0f} "
        f"frames of 8 a second, of which the goal is {WIRE_USE:.0%}"
        for case, figures in found
        if "stream_left_hz" in figures
    ]


def compiler() -> str:
    """The compiler's name and version: the goals hold for avr-gcc 5.4."""
    said = subprocess.run(["avr-gcc", "--version"], stdout=subprocess.PIPE, check=True, text=True)
    return said.stdout.splitlines()[0]


def timed(name: str, measure: Measure) -> Dict[str, float]:
    """What a measure gives; its duration is printed."""
    begun = time.monotonic()
    found = measure()
    print(f"{name} took {time.monotonic() - begun:.1f} s", file=sys.stderr)
    return found


def with_imu(make: Callable[[], RigOfCase], case: Case) -> RigOfCase:
    """A rig with what the case connects."""
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
        return with_imu(partial(BridgeRig, BRIDGE_ELF, edges_hz), case)

    make, suffix = partial(turning, BRIDGE_EDGES_HZ), f"{SUFFIX}{case.suffix}"
    for measure in BRIDGE_MEASURES + IMU_MEASURES * bool(case.imu_period_ms):
        figures.update(timed(f"{measure.__name__}{suffix}", partial(measure, make)))
    for alone in BRIDGE_TURNING:
        figures.update(timed(f"{alone.__name__}{suffix}", partial(alone, turning)))
    if case.imu_period_ms is None:
        figures.update(timed(f"motion_figures{suffix}", partial(bridge.motion_figures, BRIDGE_ELF)))
    return figures


def measured_sketches() -> Dict[str, float]:
    """Turnaround of the request for the counters, median, of the sketches of `firmware/comparison` [us]."""
    sketches = {"2013": message_times.TIMING_2013, "rosserial": message_times.ROSSERIAL}
    return {
        f"encoders_turnaround_us_median_sketch_{column}": 1e6
        * median(message.reply_s for message in message_times.measure(Setting(""), sketch))
        for column, sketch in sketches.items()
    }


def about_columns(sketches: Dict[str, float]) -> str:
    """Where the columns 2013 and rosserial come from, and what of them is repeated here."""
    of_2013, of_rosserial = (shown(value) for value in sketches.values())
    return (
        "2013, rosserial: an earlier measurement with programs that are not in this repository; the sketches of "
        f"firmware/comparison need {of_2013} and {of_rosserial} us for @6e"
    )


def flat(found: Found, image: str = "") -> Dict[str, float]:
    """One object of all cases; the keys get the suffixes of image and case."""
    return {f"{key}{image}{case.suffix}": value for case, figures in found for key, value in figures.items()}


def main() -> int:
    """Measures, prints, writes; 0 if every goal is met, 1 if one is missed, 13 without image or simulator."""
    try:
        found = [(case, measured(case)) for case in CASES]
        of_bridge = [(case, measured_bridge(case)) for case in CASES]
        sketches = measured_sketches()
    except MrlError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    report.write("firmware", {**flat(found), **flat(of_bridge, SUFFIX), **sketches, "compiler": compiler()})
    print(f"built with {compiler()}")
    print("\n".join([*table(ROWS, found), *bound(found), about_columns(sketches)]))
    print(f"\nH-bridge image, wheels at {BRIDGE_EDGES_HZ} edges/s where no other number is named")
    print("\n".join(table(BRIDGE_ROWS, of_bridge) + bound(of_bridge)))
    met = [
        reaches(row, figures)
        for rows, cases in ((ROWS, found), (BRIDGE_ROWS, of_bridge))
        for row in rows
        for _, figures in cases
    ]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
