# SPDX-License-Identifier: Apache-2.0
# `make help` lists what there is.

PYTHON ?= python3
SCENARIO ?= paper
ARGS ?=

VENV := .venv
BIN := $(VENV)/bin
METADATA := setup.py setup.cfg pyproject.toml
PIP_INSTALL = $(BIN)/python -m pip install --quiet --disable-pip-version-check
# Otherwise the first controller does it, while others wait for it.
COMPILE = $(BIN)/python -m noninteract_ros.control.fast.compile_ahead

# Discovery never leaves this machine, and small matrices gain nothing from more threads.
export ROS_AUTOMATIC_DISCOVERY_RANGE ?= LOCALHOST
export OPENBLAS_NUM_THREADS ?= 1
# The environment brings its own ROS: another one, if sourced, must not mix in.
unexport PYTHONPATH AMENT_PREFIX_PATH RMW_IMPLEMENTATION

SUPPORTED = import sys; print(sys.version_info[:2] in ((3, 11), (3, 12)))

.DEFAULT_GOAL := help
.PHONY: help venv demo test lint format bench docs console console-check clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## /\1\t/p' $(MAKEFILE_LIST) | expand -t 15

$(BIN)/python:
	$(if $(filter True,$(shell $(PYTHON) -c '$(SUPPORTED)' 2>&1 || :)),,$(error Python 3.11 or 3.12 \
	is needed, but PYTHON=$(PYTHON) says: $(shell $(PYTHON) --version 2>&1 || :)))
	$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); exit 1; }

# A stamp per kind of install; the one for development holds everything of the others.
$(VENV)/installed: $(METADATA) | $(BIN)/python
	@echo "Installing into $(VENV): about a minute and 1 GB the first time"
	$(PIP_INSTALL) --editable .
	@$(COMPILE)
	@touch $@

$(VENV)/installed-robots: $(VENV)/installed
	@echo "Installing models of robots into $(VENV): about a minute and 0.5 GB the first time"
	$(PIP_INSTALL) --editable '.[robots]'
	@touch $@

$(VENV)/installed-docs: $(VENV)/installed
	@echo "Installing the tools of the documentation into $(VENV): half a minute the first time"
	$(PIP_INSTALL) --editable '.[docs]'
	@touch $@

$(VENV)/installed-dev: $(METADATA) | $(BIN)/python
	@echo "Installing into $(VENV): about a minute and 1.5 GB the first time"
	$(PIP_INSTALL) --editable '.[dev]'
	@$(COMPILE)
	@touch $(VENV)/installed $(VENV)/installed-robots $(VENV)/installed-docs $@

venv: $(VENV)/installed-dev ## make .venv with the package (editable) and the developers' tools

# A scenario that names the models of example-robot-data needs the extra that brings them.
SCENARIO_FILE = $(firstword $(wildcard $(SCENARIO) config/$(SCENARIO).yaml))
NEEDS_ROBOTS = $(if $(SCENARIO_FILE),$(shell grep -l example-robot-data $(SCENARIO_FILE)))

demo: $(VENV)/installed$(if $(NEEDS_ROBOTS),-robots) ## run a scenario: make demo SCENARIO=paper ARGS='--duration 6'
	$(BIN)/noninteract demo $(SCENARIO) $(ARGS)

# A browser that draws without a graphics card takes the cores from whatever runs beside it, in wall
# time; what fails once is tried once more.
BROWSER_TESTS := test/console/test_browser.py test/console/test_browser_demo.py

test: lint ## format check, lint, types and all tests
	$(BIN)/python -m pytest -n 2 $(BROWSER_TESTS:%=--ignore=%) $(ARGS)
	$(BIN)/python -m pytest $(BROWSER_TESTS) || $(BIN)/python -m pytest --last-failed $(BROWSER_TESTS)

lint: $(VENV)/installed-dev ## format check, lint and types
	$(BIN)/ruff format --check
	$(BIN)/ruff check
	$(BIN)/mypy

format: $(VENV)/installed-dev ## rewrite the sources in the project's format
	$(BIN)/ruff check --fix-only
	$(BIN)/ruff format

bench: $(VENV)/installed ## measure the law, the controller and the lockstep
	$(BIN)/noninteract bench $(ARGS)

# The theme warns of MkDocs 2 at every build; setup.py holds MkDocs 1.
docs: export NO_MKDOCS_2_WARNING = 1
docs: $(VENV)/installed-docs ## build the documentation site: build/site/index.html
	$(BIN)/python -m mkdocs build --strict

CONSOLE := web/console
STATIC := noninteract_ros/console/static

$(CONSOLE)/node_modules/installed: $(CONSOLE)/package-lock.json
	cd $(CONSOLE) && npm ci --silent
	@touch $@

console: $(CONSOLE)/node_modules/installed ## build the console's page from web/console; needs node and npm
	cd $(CONSOLE) && npm run --silent build

console-check: $(CONSOLE)/node_modules/installed ## whether the page in the package is the one that is built, byte for byte
	rm -rf build/console-page
	cd $(CONSOLE) && npm run --silent build -- $(CURDIR)/build/console-page
	diff --recursive --brief build/console-page $(STATIC)

clean: ## remove all that make has made; recorded runs stay
	rm -rf $(CONSOLE)/node_modules
	rm -rf $(VENV) build install log dist *.egg-info .mypy_cache .ruff_cache .pytest_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
