"""The papers' experiments that are about ROS, through ROS: `mrl experiment` finds them in `legs`.

Each is a node of its own process: it starts boards and nodes on a master of its own, plays, and ends them all.
"""
