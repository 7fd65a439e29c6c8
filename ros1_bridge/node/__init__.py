"""Code that all nodes share: parameters, master watch, `cmd_vel`, frame names, poses on the floor plane.

Imports the driver only.
"""
