"""The command `mrl`: one module for each sub-command, and the doctor.  Imports everything else of the driver."""
