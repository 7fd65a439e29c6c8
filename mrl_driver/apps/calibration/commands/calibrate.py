"""`mrl calibrate`: measure a robot's parameters, by driving it or from recordings, and write them to a file."""

import importlib
from typing import List, Optional

import click

_MODULES = {
    "gains": "gain",
    "imu": "imu",
    "sonar": "sonar",
    **dict.fromkeys(("straight", "turn", "sideways", "umbmark"), "geometry"),
    "wiring": "wiring",
}


class _Procedures(click.Group):
    """The procedures, each imported when it is used: they need numpy."""

    def list_commands(self, ctx: click.Context) -> List[str]:
        return list(_MODULES)

    def get_command(self, ctx: click.Context, cmd_name: str) -> Optional[click.Command]:
        if cmd_name not in _MODULES:
            return None
        module = importlib.import_module(f"mrl_driver.apps.calibration.{_MODULES[cmd_name]}_procedures")
        command: click.Command = getattr(module, cmd_name)
        return command


@click.group(cls=_Procedures)
def calibrate() -> None:
    """Measure a robot's parameters; write them to YAML and EEPROM.

    \b
    In this order, on a hard floor, with a tape measure:
      mrl calibrate wiring      wiring of motors and encoders
      mrl calibrate gains       speed control of the motors
      mrl calibrate straight    counts per metre, left/right offset Cm
      mrl calibrate turn        slip offset Cs of tracks and mecanum wheels, wheelbase of others
      mrl calibrate sideways    slip of mecanum wheels in drives sideways
      mrl calibrate umbmark     squares in both directions: wheel ratio, wheelbase, noise
      mrl calibrate sonar       curve of the sonars, range_cm = a s^b + c
      mrl calibrate imu         mounting angles of an IMU, scale of its gyro
    """
