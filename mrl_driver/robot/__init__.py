"""The robot, pure: models, kinematics, odometry, sonars, battery.  Imports session and protocol."""
