"""What happens to a command before the driver gets it: limits, poses, zones.  Imports node."""
