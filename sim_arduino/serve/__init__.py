"""Serves boards on a pty or a socket in real time; the command `mrl-sim`."""
