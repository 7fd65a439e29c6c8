# Included by the top-level Makefile.
.PHONY: bench-sim bench-radio
bench-sim: setup firmware ## Measure the emulated boards; build/bench/sim.json
	$(PY) -m tests.bench.bench_sim

bench-radio: setup firmware ## Measure texts by radio between emulated boards; build/bench/radio.json
	$(PY) -m tests.bench.bench_radio
