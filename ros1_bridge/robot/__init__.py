"""The node `robot_node`: one robot on a serial port.  Imports all folders but those of other nodes."""
