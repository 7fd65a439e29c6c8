"""The nodes `go_to_goal`, `follow_waypoints` and `map_to_odom`, and the settings for navigation and mapping.  Imports
topics, node."""
