"""The driver: one robot on one port, its thread and callbacks; also in simulated time.  Imports the layers below.

`parameters` reads and writes the board's parameters, and saves them in its EEPROM.
"""

from .driver import Board, Driver, Imu, Options, SensorRead, Status, Telemetry

__all__ = ["Board", "Driver", "Imu", "Options", "SensorRead", "Status", "Telemetry"]
