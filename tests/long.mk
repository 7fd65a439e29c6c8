# The long runs.  With FAST=1 each is in its shortest form, in which `make smoke` runs them all; with KEEP=1 a full run
# writes its figures to docs/figures.
MINUTES ?= $(if $(FAST),0.02,10)
BENCHES := firmware host sim radio hold ros small relay fleet web

.PHONY: smoke figures experiments fuzz fuzz-readers reactions soak verify frames mutants review-holdout test-fresh \
  test-tutorials test-pythons explore $(BENCHES:%=bench-%)

bench-firmware: firmware comparison ## Measure the firmware binary on the simulated chip; build/bench/firmware.json
bench-host: ## Measure the decoder, recording and the driver without ROS; build/bench/host.json
bench-sim: firmware ## Measure the emulated boards; build/bench/sim.json
bench-radio: firmware ## Measure texts by radio between emulated boards; build/bench/radio.json
bench-hold: firmware ## Measure how soon a hold by radio stops a robot; build/bench/hold.json
bench-ros: ## Measure the ROS node and, for comparison, a bare rospy loop; build/bench/ros.json
bench-small: ## Measure the node and its page next to busy programs, and as root with a fifth of a core; build/bench/small.json
bench-relay: ## Measure topics that cross between two masters, and a pulled cable; build/bench/relay.json
bench-fleet: ## Measure team.launch with 20 robots and with one; build/bench/fleet.json
bench-web: ## Measure stop times, CPU and first load of the page in Chromium; build/bench/web.json
$(BENCHES:%=bench-%): bench-%: setup
	$(ROS_ENV) $(PY) -m tests.long.bench $*

smoke: setup firmware pc-firmware comparison ## Run whatever measures, verifies or draws in its shortest form and judge the figures; ONLY="soak docs"
	$(PY) -m tests.long.bench.smoke $(ONLY)

figures: setup ## Render the tables of README.md and BENCHMARKS.md from docs/figures
	$(PY) -m tests.long.bench.figures

experiments: setup firmware comparison ## Measure the papers' experiments in simulated time; build/bench/experiments.json
	$(PY) -m tests.long.bench experiments

fuzz-readers: setup pc-firmware ## Change the inputs of each reader at random for SECONDS=n, from SEED=n
	$(PY) -m tests.long.fuzz.inputs --seconds $(or $(SECONDS),$(if $(FAST),0.03,60)) --seed $(or $(SEED),1)

# Besides those of pc-firmware.
$(eval $(call FUZZ_IMAGE,_hbridge_mega,-DMRL_BRIDGE=1 -DMRL_MEGA=1))
$(eval $(call FUZZ_IMAGE,_virtual,-DMRL_BRIDGE=1 -DMRL_VIRTUAL=1))
fuzz: fuzz-readers $(filter $(PC_BUILD)/fuzz%,$(FUZZERS)) ## The same, then damage frames and feed the decoders random bytes for MINUTES=n each; build/bench/reliability.json
	$(PY) -m tests.long.fuzz --minutes $(MINUTES)
	$(PY) -m tests.long.fuzz.greetings
	$(PY) -c 'from tests.long.fuzz import test_firmware; test_firmware.seeds(test_firmware.BUILD / "seeds")'
	for fuzzer in $(filter $(PC_BUILD)/fuzz%,$(FUZZERS)); do \
	  $$fuzzer $(PC_BUILD)/seeds -max_len=256 -artifact_prefix=$(PC_BUILD)/ $(if $(FAST),-runs=1000,-max_total_time=$$(( $(MINUTES) * 60 ))) -print_final_stats=1 || exit 1; done

reactions: setup firmware ## Kill, unplug, stop and close repeatedly, then keep driving for MINUTES=n; build/bench/reliability.json
	$(PY) -m tests.long.fuzz.reactions --minutes $(MINUTES)

SOAK_FAULTS ?= $(if $(FAST),6,10000)
SOAK_MINUTES ?= $(if $(FAST),0.1,60)
soak: setup firmware ## Strike with SOAK_FAULTS=n faults in simulated time, then for SOAK_MINUTES=n in real time; build/bench/soak.json
	$(PY) -m tests.long.soak simulated --faults $(SOAK_FAULTS)
	$(PY) -m tests.long.soak real --minutes $(SOAK_MINUTES)

verify: setup ## Check the model of the stop in all its states; build/verify/model.json
	$(PY) -m tests.long.verify.model

frames: setup ## Visit all states of the firmware's decoder and writer, and interrupt its shared functions; build/verify/frames.json
	$(PY) -m tests.long.verify.frames
	$(PY) -m tests.long.verify.interrupts

mutants: setup $(VENV)/.mutants firmware pc-firmware ## Change the sources one place at a time and count what the tests notice; SOURCES="motion limiter" SAMPLE=100
	$(PY) -m tests.long.mutants $(SOURCES) $(if $(SAMPLE),--sample $(SAMPLE) --seed $(or $(SEED),1))

review-holdout: setup ## Find the faults of drives that the tests do not have, SEEDS=n of each; prints how often the right one comes first
	$(PY) -m tests.review.holdout $(if $(SEEDS),--seeds $(SEEDS))

PACKAGES_test-fresh = $(PACKAGES_quick) mmdebstrap $(if $(findstring image,$(WAYS)),buildah) $(if $(ARCH),arch-test qemu-user-static)
test-fresh: $(VENV)/.ready ## Run the README's commands in minimal Debian systems; build/bench/fresh.json; RELEASES=trixie, WAYS="root user container image", COMMANDS="pip wheel run", ARCH=arm64
	@mkdir -p build/fresh && rm -f build/fresh/*.whl
	@$(if $(findstring wheel,$(COMMANDS)),cp build/dist/*.whl build/fresh || { echo "expected the wheel of: make release" >&2; exit 1; })
	@git bundle create -q build/fresh/head.bundle HEAD
	@$(SUDO) env $(foreach v,RELEASES WAYS COMMANDS ARCH MIRROR TMPDIR,$(if $($(v)),$(v)="$($(v))")) tests/fresh.sh build/fresh/head.bundle
	@$(PY) -m tests.long.bench fresh

test-tutorials: setup ## Carry out the tutorials of docs/tutorials on emulated robots; ONLY="1_first_drive 6_team"
	@$(ROS_ENV) $(PY) -m tests.documents.tutorials $(ONLY)

test-pythons: | apt firmware pc-firmware comparison ## Run the tests that need no ROS on each installed Python from 3.8 to 3.13; PYTHONS="3.8 3.13"
	@$(if $(PYTHONS),PYTHONS="$(PYTHONS)") tests/pythons.sh

explore: setup ## Let all sequences of 6 events happen to driver and firmware, and find the seeded bugs; build/verify/explore.json
	$(PY) -m tests.long.verify.explorer
