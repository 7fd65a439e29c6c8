# Included by the top-level Makefile.
.PHONY: bench-sim bench-radio bench-hold
bench-sim: setup firmware ## Measure the emulated boards; build/bench/sim.json
	$(PY) -m tests.long.bench sim

bench-radio: setup firmware ## Measure texts by radio between emulated boards; build/bench/radio.json
	$(PY) -m tests.long.bench radio

bench-hold: setup firmware ## Measure how soon a hold by radio stops a robot; build/bench/hold.json
	$(PY) -m tests.long.bench hold
