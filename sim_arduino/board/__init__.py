"""The firmware's behaviour in Python, the boards of 2013, and the real image as a board.  Imports avr and hardware."""

from .python_board import PythonBoard

__all__ = ["PythonBoard"]
