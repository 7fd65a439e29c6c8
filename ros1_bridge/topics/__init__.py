"""Publishes the driver's values as ROS messages.  Imports node."""
