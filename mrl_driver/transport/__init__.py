"""Transports of bytes: serial ports, sockets, URLs, and the search for a port.  Imports protocol and errors."""
