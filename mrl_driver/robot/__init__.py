"""The robot, without I/O: models, kinematics, odometry, sonars, battery.  Imports session and protocol."""
