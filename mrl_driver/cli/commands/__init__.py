"""Sub-commands of `mrl`, one module each; `cli` loads the one that is asked for."""
