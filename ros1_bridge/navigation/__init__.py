"""The node `go_to_goal`, and the settings for the navigation stack.  Imports node."""
