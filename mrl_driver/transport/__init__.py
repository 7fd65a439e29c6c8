"""Everything that moves bytes: serial ports, sockets, URLs, the search for a port.  Imports protocol and errors."""
