"""The node `go_to_goal`, and the settings of the navigation stack.  Imports node."""
