"""The papers' experiments that are about ROS, run through ROS; `mrl experiment` finds them in `legs`.

Each experiment is a node in its own process.  It starts boards and nodes on its own master, runs, and ends them all.
"""
