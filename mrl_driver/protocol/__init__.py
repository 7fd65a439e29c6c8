"""The wire format: the table of commands, and bytes to frames and back.  Pure; imports errors alone."""
