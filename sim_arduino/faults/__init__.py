"""Injects faults into the serial line, the frames and the board.  Imports board and hardware."""
