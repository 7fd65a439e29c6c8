"""A recorded drive, looked at afterwards: its data, what went wrong in it, a page, a picture.  Imports driver."""
