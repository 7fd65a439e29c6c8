# mrl-driver.  `make help` lists the targets.  Set-up is idempotent: what is there is not installed again.
SHELL := /bin/bash
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help
# Programs behave as on other machines: with compiled modules (hundreds start in a test run) and buffered output.
unexport PYTHONDONTWRITEBYTECODE PYTHONUNBUFFERED

VENV := .venv
PY := $(VENV)/bin/python
ROBOT ?=
ENGINE ?=
PORT ?=
DURATION ?=
SUDO := $(shell [ "$$(id -u)" = 0 ] || command -v sudo)

# Debian packages by goal; a goal that is not named here gets those of `test-all`.
PACKAGES_firmware := gcc-avr avr-libc binutils-avr arduino-core-avr
PACKAGES_flash := $(PACKAGES_firmware) avrdude
PACKAGES_quick := python3-venv
PACKAGES_check := $(PACKAGES_quick)
PACKAGES_generate := $(PACKAGES_quick)
# The compilers make the firmware's image and run it on a simulated chip; without them the board is emulated in Python.
CHIP := $(PACKAGES_firmware) gcc libc6-dev libsimavr-dev libelf-dev
PACKAGES_run := python3-venv python3-serial python3-yaml $(if $(filter avr,$(ENGINE)),$(CHIP))
PACKAGES_test = $(PACKAGES_flash) $(PACKAGES_run) $(CHIP) g++ iproute2
PACKAGES_test-all = $(PACKAGES_test) clang spin rviz liburdfdom-tools xvfb x11-utils imagemagick libgl1-mesa-dri systemd

# A Noetic under /opt/ros comes with all of ROS; Debian's own packages are the real thing elsewhere.
ifneq ($(wildcard /opt/ros/noetic/setup.bash),)
ROS_ENV := source /opt/ros/noetic/setup.bash &&
else
ROS_ENV :=
# Ubuntu has Chromium as a snap alone, which needs a running system; Debian's is a package.
PACKAGES_test += chromium chromium-driver python3-tf2-ros tf2-tools
# Master and roslaunch; rospy and what robot_node imports; rostopic, with rosbag; actions; the robot's description.
PACKAGES_run += python3-roslaunch rosout \
  python3-rospy python3-diagnostic-updater python3-dynamic-reconfigure python3-diagnostic-msgs python3-geometry-msgs python3-nav-msgs \
  python3-sensor-msgs python3-std-srvs python3-tf2-msgs python3-visualization-msgs \
  python3-rostopic python3-rosnode python3-rosbag python3-actionlib python3-move-base-msgs ros-robot-state-publisher
PACKAGES_test-all += ros-base python3-rostest rosbash python3-tf2-geometry-msgs python3-roswtf \
  libdynamic-reconfigure-config-init-mutex-dev joint-state-publisher rosdiagnostic catkin \
  catkin-lint ros-environment ros-std-msgs libstd-msgs-dev librostest-dev libdiagnostic-aggregator-tools libdiagnostic-aggregator-dev libclang-rt-dev
# Debian 13's rviz, which is built with Qt 6, only recommends what reads its icons; Debian 12's depends on it.
PACKAGES_test-all += $(shell . /etc/os-release; [ "$$VERSION_ID" -ge 13 ] 2>/dev/null && echo qt6-svg-plugins)
endif

.PHONY: help setup quick check test test-rest test-all run clean

help: ## List the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | awk -F':.*## ' '{printf "  make %-16s %s\n", $$1, $$2}'

TIER ?= test-all
PACKAGES_setup = $(PACKAGES_$(TIER))
setup: $(VENV)/.tested ## Install what is missing: Debian packages, then a virtual environment in .venv; TIER=quick installs less

PIP := $(PY) -m pip install --disable-pip-version-check --no-compile --progress-bar off
# Of what pip says, a line for each package and step.
SHOWN := | sed -un 's/^ *Collecting \([^ ]*\).*/  \1/p; s/: started$$//p; /^ERROR/p'

# The virtual environment is made from Debian's own python3: its rospy lives there.
$(VENV)/.ready: setup.py pyproject.toml package.xml | apt
	@echo "Python packages into $(VENV):"
	@[ -x $(VENV)/bin/pip ] || /usr/bin/python3 -m venv --system-site-packages $(VENV)
	@set -o pipefail; $(PIP) -e . $(SHOWN)
	@touch $@

# What the tests need beyond it.
$(VENV)/.tested: $(VENV)/.ready
	@echo "Python packages of the tests into $(VENV):"
	@set -o pipefail; $(PIP) 'mrl-driver[dev]' $(SHOWN)
	@touch $@

# What `make mutants` needs beyond them.
$(VENV)/.mutants: $(VENV)/.tested
	@set -o pipefail; $(PIP) 'mrl-driver[mutants]' $(SHOWN)
	@touch $@

# What the documentation site needs beyond them.
$(VENV)/.site: $(VENV)/.tested
	@$(PY) -c 'import sys; v = sys.version_info[:2]; v >= (3, 11) or sys.exit("make docs: got Python %d.%d, expected 3.11 or newer; README.md leads to the same documents" % v)'
	@echo "Python packages of the documentation site into $(VENV):"
	@set -o pipefail; $(PIP) 'mrl-driver[docs]' $(SHOWN)
	@touch $@

include firmware/firmware.mk firmware/comparison.mk $(wildcard ros1_bridge/ros.mk tests/long.mk)

# What is missing is asked each time, so that a package removed later is noticed; where all is there, `apt` does nothing.
# So it does where there is no dpkg, on a system whose owner installs a compiler and ROS by himself.
NEEDED := $(sort $(foreach goal,$(MAKECMDGOALS),$(or $(PACKAGES_$(goal)),$(PACKAGES_test-all))))
INSTALLED := $(shell dpkg-query -W -f='$${db:Status-Abbrev}$${Package}\n' $(NEEDED) 2>/dev/null | sed -n 's/^ii //p')
MISSING := $(if $(shell command -v dpkg-query),$(filter-out $(INSTALLED),$(NEEDED)))
APT_GET := $(SUDO) env DEBIAN_FRONTEND=noninteractive LC_ALL=C apt-get -yq -o DPkg::Lock::Timeout=120
APT_LOG := build/apt.log
# Of what apt says, one line that counts on in a terminal, also after Ctrl-C, which does not end dpkg; the rest goes to APT_LOG.  With Dpkg::Use-Pty=0 next to it, packages'
# scripts would have no output, and fontconfig's fails without.
PROGRESS = -o APT::Status-Fd=1 2>&1 | { trap 'echo "make: apt first completes what it has begun; that can take a minute" >&2' INT; \
  while IFS= read -r line; do IFS=: read -r kind _ percent text <<<"$$line"; case $$kind in \
  dlstatus|pmstatus) [ ! -t 1 ] || printf '\r\033[K%3d %% %.60s' "$${percent%%.*}" "$$text" ;; \
  *) echo "$$line" >>$(APT_LOG) ;; esac; done; [ ! -t 1 ] || printf '\r\033[K'; }
APT_FAILED = { grep -E '^(E: |dpkg: error)' $(APT_LOG) | tail -n 3 >&2; echo "make: $(1); run the same command again; all that apt said: $(APT_LOG)" >&2; exit 1; }
REFUSE = { echo "make: got $(1), expected $(2)" >&2; exit 1; }
.PHONY: apt
apt:
ifeq ($(wildcard $(VENV)/.ready),)
	@[ -w . ] || $(call REFUSE,a folder that $$(id -un) may not write,the owner's: $$PWD)
	@[[ "$$PWD" != *:* ]] || $(call REFUSE,a path with a colon,one that a virtual environment can have; move the folder: $$PWD)
	@free=$$(df -Pk . | awk 'NR == 2 { print $$4 }'); [ "$$free" -ge 500000 ] || \
	  $(call REFUSE,$$((free / 1000)) MB of free disk,500 MB for $(VENV): $$PWD)
	@[ ! -x /usr/bin/python3 ] || /usr/bin/python3 -c 'import sys; sys.exit(sys.version_info < (3, 8))' || \
	  $(call REFUSE,$$(/usr/bin/python3 --version) in /usr/bin,3.8 or newer; Debian 12 and 13 have one)
endif
ifneq ($(MISSING),)
	@[ "$$(id -u)" = 0 ] || [ -n "$(SUDO)" ] || $(call REFUSE,neither root nor sudo,one of them for: apt-get install $(MISSING))
	@echo "Debian packages that are missing: $(MISSING)"
	@mkdir -p build && rm -f $(APT_LOG)
	@$(APT_GET) update 2>&1 | tee $(APT_LOG) | grep -E '^(Get|Hit)' >/dev/null || $(call APT_FAILED,apt reached no server: a network is needed)
	@# An installation that was interrupted is completed.
	@{ [ -z "$$(dpkg --audit)" ] && $(APT_GET) check || { $(SUDO) dpkg --configure -a; $(APT_GET) -f install; }; } >>$(APT_LOG) 2>&1 || \
	  $(call APT_FAILED,an interrupted installation could not be completed)
	@sizes=$$($(APT_GET) install --print-uris --no-install-recommends $(MISSING) 2>>$(APT_LOG)) || \
	  $(call APT_FAILED,apt cannot install these packages; Debian 12 and 13 have them); \
	grep -E 'newly installed|^Need to get|^After this' <<<"$$sizes"; free=$$(df -Pk /usr | awk 'NR == 2 { print $$4 }'); \
	awk -v free="$$free" 'BEGIN { kB["kB"] = 1; kB["MB"] = 1e3; kB["GB"] = 1e6 } /^Need to get|^After this/ { sub("/.*", "", $$5); \
	  needed += $$4 * kB[$$5] } END { exit needed > free }' <<<"$$sizes" || $(call REFUSE,$$((free / 1000)) MB of free disk in /usr,room for both sizes)
	@set -o pipefail; $(APT_GET) install --no-install-recommends $(MISSING) $(PROGRESS) || $(call APT_FAILED,apt could not install all packages)
endif

check: setup ## Format, lint, types, generated files, import rules, plain English, spelling
	$(VENV)/bin/ruff format --check -q .
	$(VENV)/bin/ruff check -q .
	$(VENV)/bin/mypy
	@mkdir -p build
	$(VENV)/bin/lint-imports --no-logo >build/imports.log || { cat build/imports.log >&2; exit 1; }
	$(PY) -m tests.import_cycles
	$(PY) -m mrl_driver.generate --check
	$(PY) -m ros1_bridge.description --check
	$(PY) -m sim_arduino.world --check
	$(PY) -m tests.long.verify.model.constants --check
	$(PY) -m tests.long.bench.figures --check
	$(PY) -m tests.documents.plain_english
	$(VENV)/bin/codespell

quick: $(VENV)/.tested $(if $(shell command -v g++),$(PC_LIBRARIES)) ## Run the tests that need neither ROS nor processes: a minute
	$(PY) -m pytest --tier quick -n 2 --dist loadfile

# Pieces of a run that follow each other even if one fails; the last line names those that did.
PYTEST = $(ROS_ENV) $(PY) -m pytest $(if $(SEED),--hypothesis-seed=$(SEED))
RUN = $(1) || failed="$$failed, $(2)"
VERDICT = [ -z "$$failed" ] || { echo "$@ failed:$${failed\#,}" >&2; exit 1; }; echo "$@ passed"

test: apt ## Set up what is missing, then run checks and tests, but for those of `make test-rest`
	@$(MAKE) --no-print-directory -j3 -Otarget NEEDED= $(VENV)/.tested firmware comparison $(PC_LIBRARIES)
	@failed=; $(call RUN,$(MAKE) --no-print-directory check,checks); \
	$(call RUN,$(PYTEST) --tier test -m 'not realtime' -n 4 --dist loadfile,tests); \
	$(call RUN,$(PYTEST) --tier test -m realtime -n 0 tests/web,tests in real time); \
	$(VERDICT)

test-rest: apt ## Run what `make test` leaves out: all of ROS, image and browser, limits in real time, a short form of each long run
	@$(MAKE) --no-print-directory -j3 -Otarget NEEDED= $(VENV)/.tested firmware comparison pc-firmware
	@export MRL_TEST_SEED=$(SEED); failed=; \
	$(call RUN,$(PYTEST) --tier rest -m 'not realtime' -n 5 --dist loadfile,tests); \
	$(call RUN,$(PYTEST) --tier rest -m realtime -n 0 $$(grep -rl --include='test_*.py' mark.realtime tests),tests in real time); \
	$(call RUN,$(MAKE) --no-print-directory smoke,short forms of long runs); \
	$(VERDICT)

test-all: ## Run everything; SEED=n looks at inputs that the fixed ones do not have
	@failed=; for part in test test-rest; do $(MAKE) --no-print-directory $$part || failed=1; done; [ -z "$$failed" ]

# The emulated board runs the firmware where compilers are; ENGINE=avr installs them.
CORE := $(and $(shell command -v avr-g++),$(wildcard $(ARDUINO_AVR)/cores))
run: $(VENV)/.ready $(if $(PORT),,$(if $(or $(filter avr,$(ENGINE)),$(CORE)),firmware)) ## Drive an emulated robot through ROS with a live view; PORT=/dev/ttyACM0 for a real one
	@$(ROS_ENV) exec $(PY) -m ros1_bridge.demo.launcher $(if $(ROBOT),--robot '$(ROBOT)') $(if $(ENGINE),--engine $(ENGINE)) \
	  $(if $(PORT),--port '$(PORT)') $(if $(DURATION),--duration $(DURATION))

.PHONY: docs generate
generate: setup ## Render protocol.h, PROTOCOL.md and the schemas of YAML files from their tables, and the URDFs from the models
	$(PY) -m mrl_driver.generate
	$(PY) -m ros1_bridge.description
	$(PY) -m sim_arduino.world
	$(PY) -m tests.long.verify.model.constants

docs: setup $(VENV)/.site ## Check the spelling and build the documentation site in build/docs; a warning is an error; needs Python 3.11
	$(if $(FAST),,$(VENV)/bin/codespell)
	@NO_MKDOCS_2_WARNING=1 $(VENV)/bin/mkdocs build --strict --config-file docs/site/mkdocs.yml
	@echo "build/docs/index.html opens in a browser, without a server"

.PHONY: release
release: setup ## Wheel and sdist of this commit in build/dist, with the firmware's images; CONTRIBUTING.md has the steps
	@$(PY) -m tests.packaging.release

clean: ## Remove what was built; the virtual environment stays
	rm -rf build dist *.egg-info
