"""Decides that the robot must stop or slow down.  No I/O; imports robot.

`speed_limiter` scales and ramps each command, and lowers the limits in manual mode; `protective_zones` slows the robot
towards obstacles and stops it before them, and `wheel_monitor` finds a wheel that does not follow.
`message_age` bounds the age of what another computer sends.  `driver/robot_core.py` applies the others; it also stops
the robot for its battery and for a command that is not finite.  The session below has the command timeout
(`session/motion_command.py`), and stops the robot if telemetry is lost.
`protocol.stop_reason` lists all reasons.  The firmware has a watchdog of its own (`failsafe.cpp`).
"""
