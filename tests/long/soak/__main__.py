"""`make soak`: the simulated part and the part in real time; both add to build/bench/soak.json.

build/soak.json has all that they noted, and how often each fault has struck.
"""

import json
import multiprocessing
import os
import signal
import sys
import time
from collections import Counter
from typing import Any, Dict, List

import click

from tests.long.bench import report
from tests.long.bench.figures import ROOT

from . import real as real_time
from .rows import LEAST, ROWS
from .simulated import Job, run_one
from .tally import GROWTH, Tally

SESSIONS, CHIPS = report.either((32, 4), (3, 1))
"""A full simulated run is this many simulations of a quarter of an hour; of these many the board is the chip."""
PARTS = ("simulated", "real_time")
LEFT = ("processes_left", "descriptors_left", "threads_left", "growth_descriptors", "growth_threads")


def table(known: Dict[str, Any]) -> List[Dict[str, Any]]:
    """How often each fault has struck, in which part, and whether that is enough."""
    rows = []
    for number, text in ROWS.items():
        counts = {part: known.get(part, {}).get("rows", {}).get(str(number), 0) for part in PARTS}
        rows.append({"row": number, "fault": text, **counts, "enough": sum(counts.values()) >= LEAST})
    return rows


def conclude(part: str, begun_s: float, tally: Tally, **more: Any) -> None:
    """Print and keep the figures of a part; exit code 1 if a judge has reported something."""
    notes = {"took_s": round(time.monotonic() - begun_s, 1), **more, **tally.report()}
    path = ROOT / "build" / "soak.json"
    report.write(path, {part: notes})
    rows = table(json.loads(path.read_text()))
    report.write(path, {"rows": rows})
    click.echo(json.dumps(notes, indent=2))
    few = [row["row"] for row in rows if not row["enough"]]
    click.echo(f"{path}: {notes['faults']} faults, problems {notes['problems'] or 'none'}")
    report.conclude("soak", figures_of(part, notes))
    if few:
        click.echo(f"rows that have struck fewer than {LEAST} times in both parts together: {few}")
    sys.exit(bool(tally.kinds))


def figures_of(part: str, notes: Dict[str, Any]) -> Dict[str, float]:
    judged, problems, largest = (Counter(notes[name]) for name in ("judged", "problems", "largest"))
    growth = [value for key, value in largest.items() if key.startswith("memory_kb_growth")]
    figures = {
        "hours": notes.get("simulated_h", notes["took_s"] / 3600),
        "faults": notes["faults"],
        "unasked_motion": problems["forbidden_motion"],
        "unasked_motion_judged": judged["forbidden_motion"],
        "late_stops": problems["time_to_stop"],
        "late_stops_judged": judged["time_to_stop"],
        "pose_jumps": problems["pose_jump"],
        "left": sum(problems[key] for key in LEFT),
        "memory_growth_mb": max(growth, default=0) / 1000,
        "problems": sum(problems.values()),
    }
    return {f"{part}_{key}": value for key, value in figures.items()}


@click.group()
def main() -> None:
    """Faults by the thousand."""


@main.command("simulated")
@click.option("--faults", type=click.IntRange(1), default=10000, show_default=True)
@click.option("--seed", type=int, default=1, show_default=True)
def simulated(faults: int, seed: int) -> None:
    """Faults of link, board, motor, battery and clock in simulated time, one in 2.88 s: 10 000 in 8 hours."""
    begun_s, tally = time.monotonic(), Tally()
    each = -(-faults // SESSIONS)
    jobs = [Job(1000 * seed + number, each, number < CHIPS) for number in range(SESSIONS)]
    with multiprocessing.Pool(os.cpu_count()) as pool:
        done = list(pool.imap(run_one, [*jobs, jobs[-1]], 1))
    again, first = done.pop(), done[-1]
    for one in done:
        tally.add(one["tally"])
    same = again["digest"] == first["digest"] and again["tally"].faults == first["tally"].faults
    tally.check("same_seed_same_run", same, seed=first["seed"])
    for process in {
        one["pid"] for one in done
    }:  # what it held after its first simulation and after its last one
        mine = [one for one in done if one["pid"] == process]
        tally.growth("simulation", mine[0], mine[-1], GROWTH)
    conclude(
        "simulated",
        begun_s,
        tally,
        seed=seed,
        simulated_h=round(sum(one["simulated_s"] for one in done) / 3600, 2),
        chip_h=round(sum(one["simulated_s"] for one in done if one["chip"]) / 3600, 2),
        cpu_s=round(sum(one["cpu_s"] for one in done), 1),
    )


@main.command("real")
@click.option("--minutes", type=click.FloatRange(0.1), default=60.0, show_default=True)
@click.option("--seed", type=int, default=1, show_default=True)
def real(minutes: float, seed: int) -> None:
    """Faults of process, disk, master, subscriber and port in real time."""
    begun_s, tally = time.monotonic(), Tally()
    # A background job of a shell ignores SIGINT, and so would the programs that it starts.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    real_time.run(60 * minutes, seed, tally)
    conclude("real_time", begun_s, tally, seed=seed)


if __name__ == "__main__":
    main()
