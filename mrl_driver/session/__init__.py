"""The conversation with a board, without I/O: handshake, commands in force, board clock, polling.  Imports protocol."""
