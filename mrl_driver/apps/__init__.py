"""Tools around a robot: calibration, review, the page, tip-over.  Nothing outside imports them.

Each registers its commands as entry points, so that the rest works without it and without what it needs.
"""
