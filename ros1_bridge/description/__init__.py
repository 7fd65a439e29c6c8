"""Renders the URDF of each robot from its model, and launch files from the parameters.  Imports node."""
