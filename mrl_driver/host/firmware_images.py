"""Firmware images (Intel HEX): those in the package, or those that `make firmware` built in a checkout."""

import os
from typing import Dict

from mrl_driver.errors import ConfigError

BUILDS: Dict[str, str] = {
    "sonar": "mrl_firmware",
    "environment": "mrl_firmware_environment",
    "xbee": "mrl_firmware_xbee",
    "hbridge": "mrl_firmware_hbridge",
}
"""Firmware builds and the names of their images."""
_PACKAGE = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
_CHECKOUT = os.path.join(os.path.dirname(_PACKAGE), "build", "firmware")
_PACKAGED = os.path.join(_PACKAGE, "images")


def image_path(build: str = "sonar") -> str:
    """Return the path of the image of a build in `BUILDS`; a checkout's own image comes first.

    ConfigError, which names the remedy, if there is no such build, or its image was neither built nor packaged.
    """
    if build not in BUILDS:
        raise ConfigError(f"build is {build!r}, expected {', '.join(BUILDS)}")
    for folder in (_CHECKOUT, _PACKAGED):
        path = os.path.join(folder, f"{BUILDS[build]}.hex")
        if os.path.isfile(path):
            return path
    remedy = (
        "mrl-driver was installed without images: run make firmware in its source folder, then pip install . "
        "again; or give a .hex file"
    )
    checkout = os.path.dirname(_PACKAGE)
    if os.path.isfile(os.path.join(checkout, "Makefile")):
        remedy = f"build it with: make -C {checkout} firmware"
    raise ConfigError(f"image {BUILDS[build]}.hex is missing; {remedy}")
