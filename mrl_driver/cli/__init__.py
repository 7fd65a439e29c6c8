"""The command `mrl`: one module per sub-command, and the doctor.  May import every other folder of the driver."""
