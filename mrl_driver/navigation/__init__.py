"""Line following, goal seeking, the occupancy grid, tours of waypoints, their idleness, and claims of a shared place.

No I/O; imports robot.
"""
