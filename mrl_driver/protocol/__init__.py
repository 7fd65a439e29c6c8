"""The wire format: the table of commands, and bytes to frames and back.  No I/O; imports only errors."""
