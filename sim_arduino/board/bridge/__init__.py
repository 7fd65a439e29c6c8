"""Control of motors on an H-bridge, in the integer arithmetic of the firmware's files of the same names."""
