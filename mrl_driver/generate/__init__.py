"""Renders the firmware's header and the command reference from the table and the robot models.  Imports robot."""
