"""The node `world_node` publishes the simulated world.  Imports topics, node and the emulator."""
