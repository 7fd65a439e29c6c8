"""The command `mrl`: one module per sub-command, and the doctor.  May import all of the driver but the apps."""
