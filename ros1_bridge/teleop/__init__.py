"""The nodes that drive by keyboard and by joystick.  Imports node."""
