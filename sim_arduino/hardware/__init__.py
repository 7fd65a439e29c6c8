"""The hardware wired to the Arduino: motors, motor board, sonars, sensors, the robot's body.  Imports world."""
