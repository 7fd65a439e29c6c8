"""Firmware images (Intel HEX): those in the package, or those that `make firmware` built in a checkout."""

import os
import shlex
from typing import Dict, Tuple

from mrl_driver.errors import ConfigError
from mrl_driver.robot.chips import ATMEGA328P, ATMEGA2560

HBRIDGE = "hbridge"
"""The build for motors on an H-bridge, and encoders on the Arduino's pins: for Uno, Nano and Mega."""
VIRTUAL = "virtual"
"""The build for a bare board, which calculates a robot; for the same boards."""
VIRTUAL_MODEL = "duo"
"""The model of that robot, if nothing says another one."""
BUILDS: Dict[str, str] = {
    "sonar": "mrl_firmware",
    "environment": "mrl_firmware_environment",
    "xbee": "mrl_firmware_xbee",
    HBRIDGE: "mrl_firmware_hbridge",
    VIRTUAL: "mrl_firmware_virtual",
}
"""Firmware builds and the names of their images."""
_OF_CHIP: Dict[str, Tuple[str, Tuple[str, ...]]] = {
    ATMEGA328P.name: ("", tuple(BUILDS)),
    ATMEGA2560.name: ("_mega", (HBRIDGE, VIRTUAL)),
}
"""What is behind the name of an image, and the builds that the chip has."""
IMAGES = tuple(f"{BUILDS[build]}{mark}.hex" for mark, builds in _OF_CHIP.values() for build in builds)
"""Names of all images."""
_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_CHECKOUT = os.path.join(os.path.dirname(_PACKAGE), "build", "firmware")
_PACKAGED = os.path.join(_PACKAGE, "images")


def image_path(build: str = "sonar", chip: str = ATMEGA328P.name) -> str:
    """Return the path of the image of a build in `BUILDS` for a chip; a checkout's own image comes first.

    ConfigError, which names the remedy, if there is no such build, or its image was neither built nor packaged.
    """
    mark, builds = _OF_CHIP[chip]
    if build not in builds:
        raise ConfigError(f"build for the {chip} is {build!r}, expected {', '.join(builds)}")
    name = f"{BUILDS[build]}{mark}.hex"
    for folder in (_CHECKOUT, _PACKAGED):
        path = os.path.join(folder, name)
        if os.path.isfile(path):
            return path
    remedy = (
        "mrl-driver was installed without images: run make firmware in its source folder, then pip install . "
        "again; or give a .hex file"
    )
    checkout = os.path.dirname(_PACKAGE)
    if os.path.isfile(os.path.join(checkout, "Makefile")):
        remedy = f"build it with: make -C {shlex.quote(checkout)} firmware"
    raise ConfigError(f"image {name} is missing; {remedy}")
