"""The computer of the robot: udev rules, flashing, firmware images, robots by name.  Imports robot."""
