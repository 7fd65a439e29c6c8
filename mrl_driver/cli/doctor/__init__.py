"""Checks of the computer, the port, the board and the robot, each with plain advice.  May import all of the driver."""
