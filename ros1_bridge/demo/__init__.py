"""The demonstration: `make run`, the node `demo_view`, the picture of rviz.  Imports node."""
