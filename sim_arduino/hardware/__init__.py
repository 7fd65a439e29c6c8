"""The hardware wired to the Arduino: motors, bridges, encoders, motor board, sonars, sensors, body. Imports world."""
