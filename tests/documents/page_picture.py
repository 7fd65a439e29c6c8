"""`python -m tests.documents.page_picture PHONE.png DESK.png` makes pictures of the page, on a phone and on a desk.

A robot in an emulated room is driven along an arc by a finger on the phone's page, while the desk's page watches.
It needs the packages chromium, chromium-driver and imagemagick.
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Sequence

from sim_arduino.world.world_file import load
from tests.waiting import wait_until
from tests.web.browser import DESK, PHONE, Browser
from tests.web.robot_page import RobotPage
from tests.web.served import Served

COLOURS = 128
"""Colours in the palette; this keeps a file below 150 KB."""
TURN_RAD, LENGTH_M = math.radians(75.0), 1.2
"""The drive: an arc to the left, then a straight line, as long as this from the start."""


def take(phone_file: Path, desk_file: Path, folder: Path) -> None:
    """Make the pictures."""
    browser = Browser(folder)
    served = Served(folder, "--listen", "127.0.0.1:0", world=load("room"))
    try:
        desk, phone = RobotPage(browser, served.links[0], DESK), RobotPage(browser, served.links[0], PHONE)
        desk.arrive()
        phone.take()
        plant = served.robot.plant
        start = plant.true_pose
        phone.push(forward=0.9, left=0.35)
        wait_until(lambda: abs(plant.true_pose.yaw_rad - start.yaw_rad) > TURN_RAD)
        phone.tab.touch(phone.stick(0.9))
        wait_until(lambda: math.dist(plant.true_pose[:2], start[:2]) > LENGTH_M)
        for page, file in ((phone, phone_file), (desk, desk_file)):
            page.tab.picture(folder / "picture.png")
            command = ["convert", str(folder / "picture.png"), "-colors", str(COLOURS), f"png8:{file}"]
            subprocess.run(command, check=True)
        phone.tab.lift()
    finally:
        served.close()
        browser.close()


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
