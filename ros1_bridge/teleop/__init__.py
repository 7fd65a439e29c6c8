"""The nodes that drive by keyboard and by joystick, and the multiplexer of velocity commands.

Imports control, topics, node.
"""
