"""Drives with other seeds, robots and worlds than the tests: is the right finding first, and are good drives clean?

    python -m tests.review.holdout --seeds 10

It prints a table of the faults: how often the right finding came first, and what came first instead.  The figures go to
build/bench/holdout.json.
"""

import argparse
import os
import tempfile
from collections import Counter
from typing import Dict, List

from mrl_driver.apps.review.drive_data import read
from mrl_driver.apps.review.findings import Finding, find
from mrl_driver.driver.recorded import RecordedDriver
from tests.long.bench import report

from .drives import Drive, record
from .faulty_drives import faulty, good, more

ROBOTS, WORLDS = ("traxbot", "stingbot"), ("room", "l-course", "house", "corridor")
NONE = "nothing"
FIRST_SEED = 100  # The tests have the seeds below


def examine(drive: Drive, path: str) -> List[Finding]:
    """The findings of a drive; those of a contact with a wall do not count, because there the wheels slip."""
    touched = record(drive, path)
    found = find(read(RecordedDriver(path)))
    true = ("slip", "pushing", "wheel_blocked", "wheel_dead", "wheels_powerless") if touched else ()
    return [each for each in found if each.kind not in true or each.kind in drive.expected]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--seeds", type=int, default=report.either(10, 1), help="number of drives for each fault"
    )
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="first seed")
    args = parser.parse_args()
    firsts: Dict[str, Counter] = {}
    right: Counter = Counter()
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "drive.mrl")
        for seed in range(args.first, args.first + args.seeds):
            robot, world = ROBOTS[seed % 2], WORLDS[seed // 2 % 4]
            drives = [*faulty(seed, robot, world, 20.0), *more(seed, robot, world, 20.0)]
            for drive in report.either(drives, drives[:2]):
                found = examine(drive, path)
                first = found[0].kind if found else NONE
                firsts.setdefault(drive.name, Counter())[first] += 1
                right[drive.name] += first in drive.expected
            for each, minutes in report.either(((robot, 0.5), ("duo", 0.3), ("omni", 0.3)), ((robot, 0.1),)):
                found = examine(good(seed, each, world, 60 * minutes), path)
                firsts.setdefault("good", Counter())[found[0].kind if found else NONE] += 1
                right["good"] += not found
    for name, counter in firsts.items():
        total = sum(counter.values())
        kinds = ", ".join(f"{kind} {count}" for kind, count in counter.most_common())
        print(f"{name:24s} {right[name]:4d} of {total:4d}   {kinds}")
    faults = [name for name in firsts if name != "good"]
    done = sum(sum(firsts[name].values()) for name in faults)
    print(f"{'all faults':24s} {sum(right[name] for name in faults):4d} of {done:4d}")
    figures = {
        "faults": done,
        "first_percent": 100 * sum(right[name] for name in faults) / done,
        "good": sum(firsts["good"].values()),
        "clean_percent": 100 * right["good"] / sum(firsts["good"].values()),
    }
    report.conclude("holdout", figures)


if __name__ == "__main__":
    main()
