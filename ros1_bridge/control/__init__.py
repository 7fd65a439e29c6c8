"""Processes a command before it reaches the driver: speed limits, pose goals, zones.  Imports node."""
