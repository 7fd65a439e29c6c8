"""`python -m tests.documents.page_picture PHONE.png DESK.png` makes pictures of the page, on a phone and on a desk.

A robot in an emulated room is driven along an arc by a finger on the phone's page, while the desk's page watches.
It needs the packages chromium, chromium-driver and imagemagick.
"""

import math
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from typing import Sequence

from sim_arduino.world.world_file import load
from tests.long.bench.report import either
from tests.web.browser import DESK, PHONE, Browser
from tests.web.robot_page import RobotPage
from tests.web.served import Served

COLOURS = 128  # Colours in the palette; this keeps a file below 150 KB
ARC_RAD, NEAR_Y_M, WEST, END_X_M = math.radians(70.0), 1.55, -0.95, 0.3
"""The drive: an arc to the left, a line towards the wall, a turn before it (cosine of the heading), a line along it."""
GOAL = {"goal-x": -1.4, "goal-y": 1.2}


def take(phone_file: Path, desk_file: Path, folder: Path) -> None:
    """Make the pictures."""
    browser = Browser(folder)
    served = Served(folder, "--listen", "127.0.0.1:0", world=load("room"))
    try:
        desk, phone = RobotPage(browser, served.links[0], DESK), RobotPage(browser, served.links[0], PHONE)
        desk.arrive()
        phone.take()
        plant = served.robot.plant
        phone.set(speed=100, **GOAL)
        legs = (
            ((0.8, 0.5), lambda: plant.true_pose.yaw_rad > ARC_RAD),
            ((1.0, 0.0), lambda: plant.true_pose.y_m > NEAR_Y_M),
            ((0.0, 1.0), lambda: math.cos(plant.true_pose.yaw_rad) < WEST),
            ((0.9, 0.0), lambda: plant.true_pose.x_m < END_X_M),
        )
        for stick, reached in either(legs, ()):
            phone.hold_until(reached, partial(phone.push, *stick), phone.tab.lift)
            phone.hold_until(reached, partial(phone.push, *stick), phone.tab.lift)
        while True:
            for page, file in ((phone, phone_file), (desk, desk_file)):
                page.tab.picture(file)
            if phone.state["spent"] == "no":  # or else a busy computer has ended the press
                break
            phone.hold_until(lambda: served.robot.moves, phone.push, phone.tab.lift)
        phone.tab.lift()
    finally:
        served.close()
        browser.close()
    for file in (phone_file, desk_file):
        subprocess.run(["convert", file, "+dither", "-colors", str(COLOURS), f"png8:{file}"], check=True)


def main(arguments: Sequence[str]) -> int:
    """Take the pictures; returns the exit code."""
    if len(arguments) != 2:
        sys.stderr.write("expected the names of two .png files\n")
        return 2
    with tempfile.TemporaryDirectory() as folder:
        take(Path(arguments[0]), Path(arguments[1]), Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
