"""Boards: the firmware's behaviour in Python, the 2013 boards, and the real firmware image.  Imports avr, hardware."""

from .python_board import PythonBoard

__all__ = ["PythonBoard"]
