"""Serves boards on a pty or a socket in real time; the command `mrl-sim`.

Imports faults, view and the layers below.
"""
