"""The demonstration: `make run`, the node `demo_view`, the rviz picture.  Imports node."""
