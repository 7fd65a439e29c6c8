"""What a view shows of a robot: state, path, words and numbers, for the terminal and for others.  It does no I/O, and
imports driver and the layers below it.
"""
