"""The session with a board, without I/O: handshake, command in force, board clock, polling.  Imports protocol."""
