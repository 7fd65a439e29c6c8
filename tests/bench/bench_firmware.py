"""Measures the firmware image on the simulated chip and prints it beside the 2013 firmware and rosserial.

`make bench-firmware` runs it; the figures go to build/bench/firmware.json as one flat object.
"""

import subprocess
import sys
import time
from pathlib import Path
from typing import Callable, Dict, List, NamedTuple, Optional, Tuple

from mrl_driver.errors import MrlError
from tests.bench import firmware_measures as measures
from tests.bench import report

ROOT = Path(__file__).resolve().parents[2]

ELF = ROOT / "build" / "firmware" / "mrl_firmware.elf"


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

MEASURES: Tuple[Callable[[Path], Dict[str, float]], ...] = (
    measures.memory_figures,
    measures.boot_figures,
    measures.turnaround_figures,
    measures.stream_figures,
    measures.checked_stream_figures,
    measures.command_figures,
    measures.rate_figures,
    measures.watchdog_figures,
    measures.hang_figures,
    measures.exact_figures,
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


def table(figures: Dict[str, float]) -> List[str]:
    """The lines to print."""
    layout = "{:<42}{:>10}{:>11}{:>11}{:>11}{:>10}  {}"
    lines = [layout.format("figure", "2013", "rosserial", "limit", "goal", "ours", "")]
    for row in ROWS:
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


def main() -> int:
    """Measures, prints, writes; 0 if every goal is met, 1 if one is missed, 13 without image or simulator."""
    figures: Dict[str, float] = {}
    try:
        for measure in MEASURES:
            begun = time.monotonic()
            figures.update(measure(ELF))
            print(f"{measure.__name__} took {time.monotonic() - begun:.1f} s", file=sys.stderr)
    except MrlError as error:
        print(error, file=sys.stderr)
        return error.exit_code
    report.write("firmware", {**figures, "compiler": compiler()})
    print(f"built with {compiler()}")
    print("\n".join(table(figures)))
    return 0 if all(reaches(row, figures[row.key]) for row in ROWS) else 1


if __name__ == "__main__":
    sys.exit(main())
