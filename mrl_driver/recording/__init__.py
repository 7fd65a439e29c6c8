"""Recordings of the wire: write, read, summarise, plot.  Imports robot, session, transport and protocol."""
