"""Sub-commands of `mrl`, one module each; `cli.main` imports the one that is used.  May import all of the driver."""
