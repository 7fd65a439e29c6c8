"""The node `world_node`: topics of the simulated world.  Imports topics, node and the emulator."""
