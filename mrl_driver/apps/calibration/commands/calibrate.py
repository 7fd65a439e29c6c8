"""`mrl calibrate`: measure a robot's parameters, by driving it or from recordings, and write them to a file."""

import click

from . import calibrate_geometry, calibrate_imu, calibrate_parts, calibrate_wiring


@click.group()
def calibrate() -> None:
    """Measure a robot's parameters; write them to YAML and EEPROM.

    \b
    In this order, on a hard floor, with a tape measure:
      mrl calibrate wiring      wiring of motors and encoders
      mrl calibrate gains       speed control of the motors
      mrl calibrate straight    counts per metre, left/right offset Cm
      mrl calibrate turn        slip offset Cs of tracks, wheelbase of wheels
      mrl calibrate umbmark     squares in both directions: wheel ratio, wheelbase, noise
      mrl calibrate sonar       curve of the sonars, range_cm = a s^b + c
      mrl calibrate imu         mounting angles of an IMU, scale of its gyro
    """


for _command in (
    *calibrate_geometry.COMMANDS,
    *calibrate_parts.COMMANDS,
    calibrate_wiring.wiring,
    calibrate_imu.imu,
):
    calibrate.add_command(_command)
