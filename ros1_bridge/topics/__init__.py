"""Values of the driver as ROS messages and topics.  Imports node."""
