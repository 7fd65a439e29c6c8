"""What a view shows of a robot: state, path, words and numbers, for the terminal and for others.  Imports driver and the
layers below it, and does no I/O.
"""
