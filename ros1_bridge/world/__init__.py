"""The simulated world in ROS: `world_node` publishes it, `mirror_node` puts a real robot into it.

Imports topics, node and the emulator.
"""
