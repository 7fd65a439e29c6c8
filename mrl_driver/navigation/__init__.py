"""Line following, goal seeking, occupancy grid and protective zones.  Pure; imports robot."""
