"""A recorded drive, looked at afterwards: its data, what went wrong in it, and a page with both.  Imports driver."""
