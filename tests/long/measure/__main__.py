"""Measures the images on simulated chips, in simulated time: python -m tests.long.measure writes docs/measured,
and the figures of docs/robots.
"""

import sys
from typing import Any, List

from mrl_driver.apps.measure import course, host, line, report
from mrl_driver.apps.measure.rows import Row, compared, kind_of
from mrl_driver.cli.commands.info import describe
from mrl_driver.files import replace_file
from mrl_driver.json_text import json_text
from tests.long.bench.figures import MEASURED, ROBOTS, ROOT
from tests.long.measure.boards import bench, truth

IMAGES = {
    "simulated_uno": ("traxbot", "mrl_firmware", "simulated Uno with an OMNI-3MD"),
    "simulated_uno_hbridge": ("duo", "mrl_firmware_hbridge", "simulated Uno with an H-bridge"),
    "simulated_uno_virtual": ("duo", "mrl_firmware_virtual", "simulated Uno, build virtual"),
    "simulated_mega_four_wheels": (
        str(ROBOTS / "four_wheels.yaml"),
        "mrl_firmware_hbridge_mega",
        "simulated Mega with four wheels",
    ),
}
KITS = {
    name: (str(ROBOTS / f"{name}.yaml"), f"mrl_firmware_{image}", "emulated; nobody has built it yet")
    for name, image in (("two_wheels", "hbridge"), ("four_wheels", "hbridge_mega"))
}
OF_COMPUTER = ("host_late_ms", "driver_cpu_percent")
"""Rows that say nothing about a board in simulated time."""


def measured(robot: str, image: str, about: str) -> Any:
    """What `mrl measure --drive` would write for this image."""
    there = bench(robot, engine="avr", elf=str(ROOT / "build" / "firmware" / f"{image}.elf"))
    rows: List[Row] = []
    with there.driver(imu_period_ms=0) as driver:
        facts, found = describe(driver, about), host.findings(driver)
        kind = kind_of(driver.board)
        rows += host.rows(driver, moves=True)
        rows += course.rows(driver, truth(driver))
    with there.link() as (link, clock):
        rows += line.rows(link, clock, moves=True)
    judged = [compared(row, kind) for row in rows if row.key not in OF_COMPUTER]
    return {**report.record(judged, facts, found, about), "computer": "simulated time"}


if __name__ == "__main__":
    for folder, rows in ((MEASURED, IMAGES), (ROBOTS, KITS)):
        for name, row in rows.items():
            if name in sys.argv[1:] or not sys.argv[1:]:
                replace_file(str(folder / f"{name}.json"), json_text(measured(*row)) + "\n")
