"""The host computer: udev rules, flashing, firmware images, robots by name.  Imports robot."""
