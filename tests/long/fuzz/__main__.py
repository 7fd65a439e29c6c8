"""The long run of the damaged frames: `make fuzz MINUTES=n`.  Writes build/bench/reliability.json."""

import multiprocessing
import os
import sys
import time
from typing import Dict, List, Tuple

import click

from tests.long.bench import report
from tests.long.fuzz import damage, faulty_robot

BATCH = report.either(1000, 400)
DRIVE_S, DRIVING_SHARE = report.either(5.0, 1.0), 0.2
"""Simulated length of one drive, and the share of the time that goes to drives."""
Found = Tuple[str, bool, damage.Tally]


def work(job: Tuple[int, float]) -> List[Found]:
    """One process: batches of all kinds in turn until the time is over."""
    seed, end_s = job
    found: List[Found] = []
    kinds = 2 * damage.EXACT + damage.LOSSY
    while not found or time.monotonic() < end_s:
        for kind in kinds:
            for direction in damage.DIRECTIONS.values():
                seed += 1
                found.append((kind.__name__, True, damage.try_random(direction, kind, BATCH, seed)))
        found.append(
            ("flip_bit", False, damage.try_random(damage.REPLIES, damage.flip_bit, BATCH, seed, False))
        )
    return found


def work_driving(job: Tuple[int, float]) -> List[Tuple[int, int, float]]:
    """One process: drives over faulty links until the time is over; accepted frames, wrong ones, and jump [m]."""
    seed, end_s = job
    found: List[Tuple[int, int, float]] = []
    while not found or time.monotonic() < end_s:
        seed += 1
        robot, _ = faulty_robot.drive(seed, DRIVE_S)
        found.append((robot.accepted, len(robot.wrong), robot.jump_m))
    return found


def total(found: List[Found], kinds: Tuple[damage.Damage, ...], checked: bool) -> damage.Tally:
    names = {kind.__name__ for kind in kinds}
    tallies = [tally for kind, c, tally in found if kind in names and c == checked]
    return damage.Tally(sum(t.tried for t in tallies), sum(t.wrong for t in tallies))


@click.command()
@click.option("--minutes", type=click.FloatRange(0.01), default=1.0, show_default=True)
def main(minutes: float) -> None:
    """Damage frames for so long, and count how many were taken for good; exit code 1 if a figure misses its goal."""
    end_s = time.monotonic() + (1 - DRIVING_SHARE) * minutes * 60
    with multiprocessing.Pool(os.cpu_count()) as pool:
        starts = [((1000 + i) * 10**6, end_s) for i in range(os.cpu_count() or 1)]
        found = [each for batches in pool.map(work, starts) for each in batches]
        starts = [(start, time.monotonic() + DRIVING_SHARE * minutes * 60) for start, _ in starts]
        drives = [each for some in pool.map(work_driving, starts) for each in some]
    exact, lossy = total(found, damage.EXACT, True), total(found, damage.LOSSY, True)
    bare = total(found, (damage.flip_bit,), False)
    figures: Dict[str, report.Measured] = {
        "damaged_frames_tried": exact.tried,
        "wrong_accepted": exact.wrong,
        "lost_byte_frames_tried": lossy.tried,
        "lost_byte_wrong_per_million": 1e6 * lossy.wrong / lossy.tried,
        "drive_frames_accepted": sum(accepted for accepted, _, _ in drives),
        "drive_wrong_accepted": sum(wrong for _, wrong, _ in drives),
        "drive_jump_mm_max": 1000 * max(0.0, *(jump_m for _, _, jump_m in drives)),
        "wrong_accepted_unchecked_1bit_percent": 100 * bare.wrong / bare.tried,
    }
    sys.exit(report.conclude("reliability", figures))


if __name__ == "__main__":
    main()
