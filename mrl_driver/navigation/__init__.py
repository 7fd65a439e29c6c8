"""Line following, goal seeking and the occupancy grid.  No I/O; imports robot."""
