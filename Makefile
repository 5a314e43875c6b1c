# make demo       set up the core (no torch) and run the main job on a scripted policy
# make test       set up everything and run the tests
# make help       the other targets
SHELL := /bin/sh
.DELETE_ON_ERROR:
.DEFAULT_GOAL := help

VENV ?= .venv
LATEST := .venv-latest
OPENPI_VENV := .venv-openpi
TOUR := build/gaitkeeper
BIN := $(VENV)/bin
PYTEST = -m pytest -q
PLUGIN = lerobot_robot_wholebody
# Extra arguments: make test ARGS="-k controller"
ARGS ?=
# Folder of recorded motions (.csv) for the long studies: make regression MOTIONS=~/motions
MOTIONS ?=
# What is taught, and where everything about it goes: make loop TASK=pick
TASK ?= reach
LOOP ?= build/loop-$(TASK)
# Checkout of LeRobot, with which the plugin is tested: make test-lerobot LEROBOT=~/lerobot
LEROBOT ?=
# Where the studies that take hours write: make studies OUT=~/studies ARGS="--only variants"
OUT ?= build/studies
# Checkout of openpi, whose own server is then met: make test-openpi OPENPI=~/openpi
OPENPI ?=
QUICK = not regression and not latest and not openpi and not browser
# Files with tests that run without others beside them: looking through all files takes longer than many a test.
ALONE = $(if $(ARGS),,$(shell grep -rl --include="test_*.py" "mark\.alone" tests))
# What pytest answers where ARGS leave no test to run.
NONE_CHOSEN = 5
REGRESSION = G1_MOTIONS="$(MOTIONS)" $(BIN)/python $(PYTEST) -m regression

# Modules are compiled once, not in each of the processes that tests start; container images often switch that off.
export PYTHONDONTWRITEBYTECODE =

.PHONY: configs help demo setup setup-core lint format test regression regression-update studies loop test-lerobot test-latest test-openpi test-browser test-tour fuzz-readers bench lock clean

help: ## List the targets
	@grep -hE '^[a-z-]+:.*## ' Makefile | sed 's/:.*## /\t/' | expand -t 20

demo: setup-core ## Run the main job on a scripted policy (core packages only)
	@$(BIN)/wholebody warmup
	$(BIN)/wholebody run reach $(ARGS)

setup-core: $(VENV)/.core-installed ## Make .venv with the core packages

setup: $(VENV)/.all-installed ## Make .venv with everything: lerobot, torch and the development tools

lint: $(VENV)/.all-installed ## Check style, formatting and the types of the public API
	$(BIN)/ruff check $(ARGS)
	$(BIN)/ruff format --check
	$(BIN)/python -m tests.support.public_api | xargs $(BIN)/mypy

format: $(VENV)/.all-installed ## Fix style and formatting
	$(BIN)/ruff check --fix $(ARGS)
	$(BIN)/ruff format

test: $(VENV)/.all-installed ## Run the tests
	@$(BIN)/wholebody warmup
	OMP_NUM_THREADS=1 $(BIN)/python $(PYTEST) -n 2 --dist worksteal -m "$(QUICK) and not alone" $(ARGS)
	$(BIN)/python $(PYTEST) -m "$(QUICK) and alone" $(ALONE) $(ARGS) || [ $$? -eq $(NONE_CHOSEN) ]

regression: $(VENV)/.all-installed ## Run the long studies against their stored values
	$(REGRESSION) $(ARGS)

regression-update: $(VENV)/.all-installed ## Run the long studies and store their values, stamped with the versions used
	$(REGRESSION) --regression-update $(ARGS)
	$(BIN)/python tests/support/stored.py

studies: $(VENV)/.all-installed ## Run the studies that take hours into the folder OUT, going on where they ended
	G1_MOTIONS="$(MOTIONS)" $(BIN)/python -m tests.studies $(OUT) $(ARGS)

test-latest: $(LATEST)/.installed ## Run the core tests on the newest placo and pin, in their own environment
	@$(LATEST)/bin/wholebody warmup
	OMP_NUM_THREADS=1 $(LATEST)/bin/python $(PYTEST) -n 2 --dist worksteal -m "not regression and not openpi and not browser and not alone" $(ARGS)
	$(LATEST)/bin/python $(PYTEST) -m "not regression and not openpi and not browser and alone" $(ARGS) || [ $$? -eq $(NONE_CHOSEN) ]

test-openpi: $(VENV)/.all-installed $(OPENPI_VENV)/.installed ## Meet openpi's own client and server, in their own environment
	OPENPI_PYTHON=$(OPENPI_VENV)/bin/python OPENPI_CHECKOUT="$(OPENPI)" $(BIN)/python $(PYTEST) -m openpi $(ARGS)

test-browser: $(VENV)/.all-installed ## Look at the live page in Chromium, from the system's packages
	$(BIN)/python $(PYTEST) -m browser $(ARGS)

test-tour: $(VENV)/.all-installed $(TOUR)/.installed ## Walk the waypoint tour of gaitkeeper: make test-tour ARGS="--seeds 0 20"
	PYTHONPATH="$(TOUR)" OMP_NUM_THREADS=1 $(BIN)/python -m tests.studies.tour --out build/tour.jsonl $(ARGS)

loop: $(VENV)/.all-installed ## Record, train and evaluate a policy with LeRobot's commands: make loop TASK=pick
	@$(BIN)/wholebody warmup
	$(BIN)/python -m training.loop --task $(TASK) --out $(LOOP) $(ARGS)

test-lerobot: $(VENV)/.all-installed ## Test the plugin with a checkout of LeRobot: make test-lerobot LEROBOT=FOLDER
	@test -d "$(LEROBOT)/src/lerobot" || { echo "say where LeRobot is checked out: make test-lerobot LEROBOT=FOLDER" >&2; exit 2; }
	PYTHONPATH="$(LEROBOT)/src" OMP_NUM_THREADS=1 $(BIN)/python $(PYTEST) tests/lerobot_robot_wholebody $(ARGS)

fuzz-readers: $(VENV)/.all-installed ## Read 16,000 broken and hostile files under limits of memory and time
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.studies.fuzz_readers $(ARGS)

bench: $(VENV)/.all-installed ## Time one controller tick
	$(BIN)/wholebody bench tick $(ARGS)

configs: $(VENV)/.core-installed ## Write configs/default.yaml anew from the defaults in wholebody/config/controller.py
	$(BIN)/wholebody config > configs/.default.yaml && mv configs/.default.yaml configs/default.yaml

lock: $(VENV)/.core-installed ## Resolve the two locks again (make lock ARGS=--upgrade for newer versions)
	$(call compile,--all-extras --constraint requirements/pins.txt,all)
	$(call compile,--extra live --constraint requirements/all.txt,core)
	@! grep -nE '://|^-' requirements/all.txt requirements/core.txt || { echo "a lock names a host or a path" >&2; exit 1; }

# The core lock is constrained by the other one: a package has the same version in both.
define compile
$(BIN)/uv pip compile --quiet --generate-hashes --universal --python-version 3.12 --no-header --no-annotate \
	$(1) $(ARGS) pyproject.toml requirements/setup.in --output-file requirements/$(2).txt
endef

clean: ## Remove the environments and caches
	rm -rf $(VENV) $(LATEST) $(OPENPI_VENV) build dist .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

# Environments. A stamp is older than its lock when the lock changed: set-up runs again.
$(VENV)/bin/python:
	@python=$$(requirements/find-python) && echo "making $(VENV) with $$python" && "$$python" -m venv $(VENV)

$(VENV)/.core-installed: requirements/core.txt pyproject.toml | $(VENV)/bin/python
	requirements/install $(VENV) requirements/core.txt
	@touch $@

$(VENV)/.all-installed: requirements/all.txt pyproject.toml $(PLUGIN)/pyproject.toml | $(VENV)/bin/python
	requirements/install $(VENV) requirements/all.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable ./$(PLUGIN)
	@touch $@ $(VENV)/.core-installed

# Unlocked on purpose: the newest placo, and the pin it asks for.
$(LATEST)/.installed: pyproject.toml requirements/setup.in
	@python=$$(requirements/find-python) && "$$python" -m venv --clear $(LATEST)
	$(LATEST)/bin/python -m pip install --quiet --disable-pip-version-check -r requirements/setup.in
	$(LATEST)/bin/uv pip install --quiet --python $(LATEST)/bin/python --upgrade --editable '.[dev]' 'placo>=0.10.2'
	@touch $@

# openpi-client wants numpy < 2, and typing_extensions without saying so.
$(OPENPI_VENV)/.installed:
	@python=$$(requirements/find-python) && "$$python" -m venv --clear $(OPENPI_VENV)
	$(OPENPI_VENV)/bin/python -m pip install --quiet --disable-pip-version-check openpi-client==0.1.2 typing_extensions
	@touch $@

# Without its dependencies, which are here, but for a MuJoCo before 4, which its draws do not need.
$(TOUR)/.installed: | $(VENV)/.all-installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --target $(TOUR) gaitkeeper==0.5.4
	@touch $@
