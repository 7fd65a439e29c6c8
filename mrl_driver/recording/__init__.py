"""Recordings of the wire: write, read.  Imports robot, session, transport and protocol."""
