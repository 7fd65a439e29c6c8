"""ROS 1 package: the robot node, the demonstration view and what starts them."""
