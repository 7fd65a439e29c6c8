"""Line following, goal seeking, occupancy grid and protective zones.  No I/O; imports robot."""
