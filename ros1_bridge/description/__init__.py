"""The robots' URDF from their models.  Imports node."""
