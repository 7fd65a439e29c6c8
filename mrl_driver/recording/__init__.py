"""Recordings of the wire: write, read, summarise.  Imports robot, session, transport and protocol."""
