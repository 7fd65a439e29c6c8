"""The experiments of the papers; each is one command, such as `mrl experiment square`.

They drive robots through the real driver: emulated robots in simulated time or, where that is useful, a real robot on a
port.  The result is a picture, and a table with the published figures next to ours.
"""
