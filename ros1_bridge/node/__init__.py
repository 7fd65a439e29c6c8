"""What all nodes share: parameters, the watch on the master, `cmd_vel`, frame names, poses on the floor plane."""
