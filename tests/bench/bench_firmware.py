"""Measures the firmware images on the simulated chip and prints them beside the 2013 firmware and rosserial.

`make bench-firmware` runs it; the figures go to build/bench/firmware.json as one flat object.  Those of the H-bridge
image have the suffix `_hbridge`.
"""

import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

from mrl_driver.errors import MrlError
from tests.bench import bridge_measures as bridge
from tests.bench import firmware_measures as measures
from tests.bench import report
from tests.bench.bridge_board import BridgeRig
from tests.bench.firmware_board import Rig

FOLDER = Path(__file__).resolve().parents[2] / "build" / "firmware"
ELF, BRIDGE_ELF = FOLDER / "mrl_firmware.elf", FOLDER / "mrl_firmware_hbridge.elf"
BRIDGE_EDGES_HZ = 10000
"""Edges of both wheels together in the figures that both images have."""
Measure = Callable[[], Dict[str, float]]


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
    Row("move_idle_us_max", "move, line idle [us]", "792", "2125", "140", 350),
    Row("move_streaming_us_max", "move behind a full stream [us]", "39746", "4750", "about 400", 700),
    Row("stop_streaming_us_max", "stop behind a full stream [us]", "12502", "-", "about 350", 600),
    Row("commands_streaming_hz", "13-byte commands without loss [1/s]", "26.6", "400+", "886", 880, True),
    Row("int16_exact", "of 65536 values arrive exactly", "64796", "-", "65536", 65536, True),
    Row("boot_to_answer_ms", "start to first answer [ms]", "3349", "-", "", 300),
    Row("watchdog_stop_ms_max", "silent host to stop, watchdog 250 ms [ms]", "never", "-", "250", 265),
    Row("bus_hang_blocked_ms_max", "pause of the wire when I2C hangs [ms]", "for ever", "-", "", 25),
    Row("sram_free_bytes", "SRAM never touched [byte]", "1104", "65", "", 900, True),
    Row("flash_bytes", "flash [byte]", "13376", "16082", "32256", 20480),
)

BRIDGE_ROWS = (
    Row("encoders_turnaround_us_median", "@6e, 15 bytes [us]", "-", "-", "1280", 1400),
    Row("encoders_sonars_turnaround_us_median", "@8e, 27 bytes [us]", "-", "-", "2300", 2500),
    Row("stream_typical_hz", "stream of 8, 27 bytes [1/s]", "-", "-", "436", 425, True),
    Row("stream_wire_use", "share of the wire, streaming", "-", "-", "1.0", 0.97, True),
    Row("stream_jitter_us", "largest - smallest gap at 20 ms [us]", "-", "-", "", 300),
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
BRIDGE_MEASURES: Tuple[Callable[[measures.MakeRig], Dict[str, float]], ...] = (
    measures.memory_figures,
    measures.boot_figures,
    measures.turnaround_figures,
    measures.stream_figures,
    bridge.watchdog_figures,
    bridge.exact_figures,
)
"""Measures with turning wheels."""
BRIDGE_ALONE: Tuple[Callable[[Path], Dict[str, float]], ...] = (
    bridge.edge_figures,
    bridge.sample_figures,
    bridge.stop_figures,
    bridge.motion_figures,
)


def reaches(row: Row, value: float) -> bool:
    """Is the goal met?"""
    return row.goal is None or (value >= row.goal if row.least else value <= row.goal)


def shown(value: float) -> str:
    """A figure in at most four or five digits."""
    return (
        f"{value:.0f}"
        if value == int(value) or value >= 1000
        else f"{value:.3g}"
        if value < 1
        else f"{value:.1f}"
    )


def table(rows: Sequence[Row], figures: Dict[str, float]) -> List[str]:
    """The lines to print."""
    layout = "{:<42}{:>10}{:>11}{:>11}{:>11}{:>10}  {}"
    lines = [layout.format("figure", "2013", "rosserial", "limit", "goal", "ours", "")]
    for row in rows:
        if row.key in figures:
            sign = ">= " if row.least else "<= "
            verdict = "" if reaches(row, figures[row.key]) else "MISSED"
            cells = (
                row.board_2013,
                row.rosserial,
                row.limit,
                sign + shown(row.goal or 0),
                shown(figures[row.key]),
            )
            lines.append(layout.format(row.text, *cells, verdict).rstrip())
    return lines


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


def measured() -> Dict[str, float]:
    """All figures of the image for the OMNI-3MD."""
    figures: Dict[str, float] = {}
    for measure in MEASURES:
        figures.update(timed(measure.__name__, partial(measure, partial(Rig, ELF))))
    return figures


def measured_bridge() -> Dict[str, float]:
    """All figures of the H-bridge image, without suffix."""
    figures: Dict[str, float] = {}
    make = partial(BridgeRig, BRIDGE_ELF, BRIDGE_EDGES_HZ)
    for measure in BRIDGE_MEASURES:
        figures.update(timed(f"{measure.__name__}{SUFFIX}", partial(measure, make)))
    for alone in BRIDGE_ALONE:
        figures.update(timed(f"{alone.__name__}{SUFFIX}", partial(alone, BRIDGE_ELF)))
    return figures


def main() -> int:
    """Measures, prints, writes; 0 if every goal is met, 1 if one is missed, 13 without image or simulator."""
    try:
        figures, of_bridge = measured(), measured_bridge()
    except MrlError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    suffixed = {f"{key}{SUFFIX}": value for key, value in of_bridge.items()}
    report.write("firmware", {**figures, **suffixed, "compiler": compiler()})
    print(f"built with {compiler()}")
    print("\n".join(table(ROWS, figures)))
    print(f"\nH-bridge image, wheels at {BRIDGE_EDGES_HZ} edges/s where no other number is named")
    print("\n".join(table(BRIDGE_ROWS, of_bridge)))
    met = [
        reaches(row, found[row.key])
        for rows, found in ((ROWS, figures), (BRIDGE_ROWS, of_bridge))
        for row in rows
    ]
    return 0 if all(met) else 1


if __name__ == "__main__":
    sys.exit(main())
