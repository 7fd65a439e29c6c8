"""Faults of the line, of frames and of the board, injected on purpose.  Imports board and hardware."""
