# Included by the top-level Makefile.
.PHONY: bench-sim
bench-sim: setup firmware ## Measure the emulated boards; build/bench/sim.json
	$(PY) -m tests.bench.bench_sim
