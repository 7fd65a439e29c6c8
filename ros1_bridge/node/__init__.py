"""Code that all nodes share: parameters, master watch, `cmd_vel`, frame names, poses on the floor plane, child
processes and their master.

Imports the driver only.
"""
