"""The hardware wired to the Arduino: motors, H-bridges, encoders, motor board, sonars, sensors, body. Imports world."""
