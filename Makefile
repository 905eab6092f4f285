# Every target is one line that calls the project's own tools; .ci/run calls the same targets.
VENV := .venv
BIN := $(VENV)/bin
CONFIG ?= thesis
SIM ?= verilator
WAVES ?=
RECORDINGS ?= ../shared/recordings
VALIDATION ?= ../shared/validation
ONLY ?=
BASE ?= HEAD
PART ?= 1
COUNT ?= 10000
LINES ?= 1000000
SEED ?= 1
PYTEST := $(BIN)/python -m pytest -n 2 --dist worksteal

.DEFAULT_GOAL := help
.PHONY: help setup icarus demo verilog ip bitstream test test-ip sim report families compare peers formal exhaustive spots mutants faults accuracy lint docs clean

help: ## Show this list.
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-10s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(VENV)/ready ## Prepare .venv with pinned dependencies and the strapdown command.

$(VENV)/ready: pyproject.toml scripts/pyproject.toml constraints.txt
	python3 -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --use-pep517 --constraint constraints.txt \
		--editable '.[dev]' --editable scripts
	touch $@

$(VENV)/ready-%: $(VENV)/ready
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --use-pep517 --constraint constraints.txt --editable 'scripts[$*]'
	touch $@

icarus: # Installs Icarus Verilog from Debian if it is missing and the user may install it.
	@scripts/install_icarus.sh

demo: setup ## Replay a real recording through generated Verilog; results under build/demo.
	$(BIN)/python scripts/fetch_recording.py build/recordings
	$(BIN)/strapdown replay build/recordings/00033_CalInertialAndMag.csv --config mahony --html \
		--output build/demo

verilog: setup ## Generate all modules of CONFIG into build/verilog/CONFIG.
	$(BIN)/strapdown generate --config $(CONFIG)

ip: setup ## Write the core of CONFIG behind AXI4-Lite and AXI4-Stream as a package for Vivado, ISE and FuseSoC into build/ip/CONFIG.
	$(BIN)/strapdown ip $(CONFIG)

bitstream: $(VENV)/ready-report ## Make the bitstream of docs/bitstream, for an ECP5, by open tools.
	scripts/bitstream.sh build/bitstream $(BIN)

test: setup icarus ## Run all tests, except those that only `make sim` and `make test-ip` run.
	@$(BIN)/python scripts/fetch_recording.py build/recordings
	$(PYTEST) -m 'not sim_only and not ip'

test-ip: setup icarus $(VENV)/ready-report $(VENV)-pynq/ready $(VENV)-fusesoc/ready $(VENV)-litex/ready $(VENV)-rerun/ready ## Run the tests that need tools of their own: ARM, PYNQ, FuseSoC, LiteX, Rerun, a browser.
	@scripts/install_debian.sh arm-linux-gnueabihf-gcc=gcc-arm-linux-gnueabihf \
		arm-linux-gnueabihf-ld=libc6-dev-armhf-cross qemu-arm=qemu-user dtc=device-tree-compiler
	@scripts/install_debian.sh chromium=chromium chromedriver=chromium-driver tclsh=tcl yosys=yosys
	@$(BIN)/python scripts/fetch_recording.py build/recordings
	$(PYTEST) -m ip

$(VENV)-fusesoc/ready:
	python3 -m venv $(VENV)-fusesoc
	$(VENV)-fusesoc/bin/python -m pip install --quiet --disable-pip-version-check --use-pep517 edalize==0.6.8 fusesoc==2.4.7
	touch $@

$(VENV)-litex/ready:
	python3 -m venv $(VENV)-litex
	$(VENV)-litex/bin/python -m pip install --quiet --disable-pip-version-check --use-pep517 litex==2024.12
	touch $@

$(VENV)-pynq/ready: pyproject.toml
	python3 -m venv $(VENV)-pynq
	$(VENV)-pynq/bin/python -m pip install --quiet --disable-pip-version-check --use-pep517 pynq==4.0.0
	$(VENV)-pynq/bin/python -m pip install --quiet --disable-pip-version-check --use-pep517 --no-deps --editable .
	touch $@

$(VENV)-rerun/ready: pyproject.toml constraints.txt
	python3 -m venv $(VENV)-rerun
	$(VENV)-rerun/bin/python -m pip install --quiet --disable-pip-version-check --use-pep517 --constraint constraints.txt \
		--editable '.[rerun]'
	touch $@

sim: setup ## Run every module's cocotb bench in SIM=icarus or verilator; WAVES=1 keeps waveforms.
	WAVES=$(WAVES) $(PYTEST) tests/sim/test_benches.py -k $(SIM)

report: $(VENV)/ready-report families ## Synthesise, place and route operators and cores; figures for `make docs` in docs/report.
	$(BIN)/strapdown report --output build/report
	mkdir -p docs/report && cp build/report/*.json build/report/*.png docs/report

families: $(VENV)/ready-report ## Synthesise, place and route configurations for several FPGA families; part of `make report`.
	$(BIN)/strapdown families --output build/families
	mkdir -p docs/report && cp build/families/families.json docs/report

compare: $(VENV)/ready-report ## Compare the cores with those of the commit BASE: cycles, resources, clock frequency.
	$(BIN)/strapdown compare $(BASE) --output build/compare

peers: setup ## Time attitude filters in C on a core of this machine, for `make docs`; see docs/report.md.
	$(BIN)/python scripts/fetch_recording.py build/recordings
	$(BIN)/python -m strapdown_lab.studies.peers

formal: $(VENV)/ready-formal ## Prove properties of operators and engines; ONLY=REGEX selects some. See docs/proof.md.
	$(BIN)/python -m strapdown_lab.proof formal --only '$(ONLY)'

exhaustive: setup ## Try all 2^32 operands of the one-operand operators; ONLY=sqrt, PART=1/256 select some.
	$(BIN)/python -m strapdown_lab.proof exhaustive $(addprefix --only ,$(ONLY)) --fraction $(PART)

spots: setup ## Try LINES random lines of each line sensor in the spot finder; ONLY=tcd1304 selects one.
	$(BIN)/python -m strapdown_lab.proof spots $(addprefix --only ,$(ONLY)) --lines $(LINES)

mutants: $(VENV)/ready-formal ## Put single faults into operators and engines; tests must detect them. ONLY=REGEX selects files.
	$(BIN)/python -m strapdown_lab.proof mutants --only '$(ONLY)'

faults: setup ## Flip COUNT bits of a core during a recording; CONFIG, SEED, ONLY=REGEX, RECORDINGS. See docs/faults.md.
	$(BIN)/python -m strapdown_lab.faults --config $(CONFIG) --count $(COUNT) --seed $(SEED) --only '$(ONLY)' \
		--recordings $(RECORDINGS) --output build/faults
	$(if $(ONLY),,mkdir -p docs/faults && cp build/faults/$(CONFIG).json docs/faults)

accuracy: $(VENV)/ready-accuracy ## Errors of attitude filters on real recordings, and of the optical sensor, for `make docs`; RECORDINGS, VALIDATION: folders.
	$(BIN)/python -m strapdown_lab.studies.optical
	$(BIN)/python -m strapdown_lab.studies.optical_pins
	$(BIN)/strapdown accuracy $(RECORDINGS) $(VALIDATION) --output build/accuracy
	$(BIN)/python -m strapdown_lab.studies.flight_cases $(RECORDINGS) $(VALIDATION)
	$(BIN)/python -m strapdown_lab.studies.flight_magnet $(RECORDINGS) $(VALIDATION)
	$(BIN)/python -m strapdown_lab.studies.flight_cross $(RECORDINGS) $(VALIDATION)
	mkdir -p docs/report && cp build/accuracy/accuracy.json build/accuracy/accuracy.png docs/report

lint: setup ## Check style, types, spelling and the direction of imports.
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell

docs: demo ## Write the generated figures and the demo's picture into README.md and docs/.
	$(BIN)/python -m strapdown_lab.docs
	$(BIN)/python -m strapdown_lab.proof document

clean: ## Remove generated files, but not .venv.
	rm -rf build
