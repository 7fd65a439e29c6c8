"""Tip-over margin of a vehicle.  Imports the robot models; the driver does not import this package."""
