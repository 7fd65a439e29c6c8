"""The papers' experiments, each one command: `mrl experiment square`.

They drive robots through the real driver, emulated ones in simulated time or, where that makes sense, a real one on a
port, and end in a picture and a table beside the published figures.
"""
