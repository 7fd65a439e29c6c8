"""Plays recordings as boards, and mirrors real robots.  Imports serve, hardware and world."""
