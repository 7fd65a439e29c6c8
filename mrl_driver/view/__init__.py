"""What a view shows of a robot, whoever draws it: state, path, words and numbers.  Imports driver and the layers below
it, and does no I/O.
"""
