"""The papers' experiments; each is one command, such as `mrl experiment square`.

They drive robots through the real driver: emulated robots in simulated time or, if this makes sense, a real robot on a
port.  The result is a picture, and a table beside the published figures.
"""
