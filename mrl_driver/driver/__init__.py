"""The driver: one robot on one port, its thread and callbacks; also in simulated time."""

from .driver import Board, Driver, Options, Telemetry

__all__ = ["Board", "Driver", "Options", "Telemetry"]
