"""`mrl calibrate`: one module per group of procedures."""
