"""Boards: the firmware's behaviour in Python, the 2013 boards, and the real firmware image.  Imports avr, hardware."""

from . import motion_handlers, sensor_handlers, service_handlers  # they register themselves
from .python_board import PythonBoard

__all__ = ["PythonBoard", "motion_handlers", "sensor_handlers", "service_handlers"]
