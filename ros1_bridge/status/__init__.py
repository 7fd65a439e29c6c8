"""Status and diagnostics of the robot node.  Imports control and node."""
