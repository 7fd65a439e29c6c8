"""The long runs: bench, fuzz, soak, verify, mutants and navigation; `make smoke` runs each in its shortest form."""
