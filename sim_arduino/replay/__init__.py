"""Recordings as boards again, and mirrors of real robots.  Imports serve, hardware and world."""
