"""Renders the URDF of each robot from its model.  Imports node."""
