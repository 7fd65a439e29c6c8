"""Emulated boards for tests, and the pytest plugin.  Imports serve and the folders below it."""

from .emulated_board import EmulatedBoard

__all__ = ["EmulatedBoard"]
