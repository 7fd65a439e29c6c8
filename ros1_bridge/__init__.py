"""ROS 1 package: the robot node, the other nodes, the demonstration view, and the code that starts them."""
