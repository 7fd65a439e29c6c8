"""The node `robot_node`: one robot on a serial port.  Imports all folders except those of other nodes."""
