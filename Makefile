# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
#
# make setup            create $(VENV) with everything; a second call does nothing
# make demo             the main job in about a minute (RECORDING=path analyzes a recording instead)
# make test             all everyday tests, those over real DDS included
# make test-fast        numerics, timeline, decoding, writers: after every edit, in a minute
# make test-slow        Monte Carlo, soak and fuzz runs
# make mutation         small faults in the numerics, thousands of them: which does no test see
# make coverage         the everyday tests, with the branches that none of them takes
# make lint             ruff, mypy --strict, ament_flake8 and ament_pep257
# make docs             the documentation as HTML, warnings are errors
# make bench            speed and memory, BASE=checkout beside it; make bench-accuracy  coefficients
# make bench-filter     what a filter with these numbers is worth on data nobody fitted
# make bench-peers      other Allan tools beside ours: writes docs/peers.md, in an hour or two
# make battery          what is said of a frozen set of sensors (BASE=checkout tells where it differs)
# make clean            remove what the other targets made
#
# PYTHON, VENV and CONSTRAINTS choose another interpreter, folder and set of pinned versions:
#   make test VENV=.venv-jazzy PYTHON=python3.11 CONSTRAINTS=.ci/jazzy-constraints.txt

VENV ?= .venv
CONSTRAINTS ?=
EXTRAS ?= ros,fleet,test,lint,docs
PYTEST_ARGS ?=
# Processes that share the everyday tests, a module at a time; three keep two cores at work, for
# the tests of node and command wait more than they work. Those stay in the middle: at the end one
# process would wait alone.
JOBS ?= 3
SHARED := -n $(JOBS) --dist loadfile --no-loadscope-reorder
RECORDING ?=
TOPIC ?=
DEMO_OUTPUT ?= demo_output
MUTANTS ?=
BASE ?=
BATTERY_ARGS ?=

# The wheels of ROS 2 Jazzy exist for Python 3.10 to 3.14.
PYTHON ?= $(shell for python in python3 python3.14 python3.13 python3.12 python3.11 python3.10; do \
	$$python -c 'import sys, venv, ensurepip; sys.exit(not (3, 10) <= sys.version_info < (3, 15))' \
	2>/dev/null && echo $$python && break; done)

# Pictures, browsers, messages taken all the way to a result, and what takes longest, are left to
# `make test`.
FAST := test/test_floors.py test/test_cdr.py test/noise test/sensor test/timeline test/test_datasheet.py \
	test/writers test/test_finding_messages.py \
	-m 'not slow and not browser and not thorough' $(foreach slower,plot comparison, \
	--ignore test/writers/test_$(slower).py) --ignore test/timeline/test_nothing_silent.py

LINTED := imu_allan launch test demo bench examples docs/conf.py docs/make_commands.py docs/make_findings.py \
	docs/make_figures.py docs/make_first_minutes.py setup.py

RUN := $(VENV)/bin
STAMP := $(VENV)/.installed
# The demo needs no linters, no documentation tools and no second library to compare with.
DEMO_EXTRAS := ros
DEMO_STAMP := $(if $(STAMP),$(VENV)/.installed-demo)

# What is timed; what is drawn by the hundred has other targets, or is run by name.
SPEED := reading messages timeline fit report node

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-fast test-slow mutation coverage lint docs bench bench-accuracy bench-filter \
	battery clean

help:
	@sed -n 's/^# make/  make/p' Makefile

setup: $(STAMP)

$(STAMP): setup.py pyproject.toml $(CONSTRAINTS)
	@if [ -z '$(PYTHON)' ]; then \
		echo 'make: no Python 3.10 to 3.14 with the venv module found; on Debian and Ubuntu:' \
			'apt install python3-venv; or name one: make setup PYTHON=/path/to/python3' >&2; \
		exit 1; fi
	@test -x $(RUN)/python || $(PYTHON) -m venv $(VENV)
	@echo 'Installing into $(VENV), once ...'
	@$(RUN)/python -m pip install --quiet --disable-pip-version-check \
		$(if $(CONSTRAINTS),--constraint $(CONSTRAINTS)) --editable '.[$(EXTRAS)]'
	@touch $@

$(DEMO_STAMP): setup.py pyproject.toml $(CONSTRAINTS)
	@if [ -z '$(PYTHON)' ]; then \
		echo 'make: no Python 3.10 to 3.14 with the venv module found; on Debian and Ubuntu:' \
			'apt install python3-venv; or name one: make demo PYTHON=/path/to/python3' >&2; \
		exit 1; fi
	@test -x $(RUN)/python || $(PYTHON) -m venv $(VENV)
	@echo "Installing what the demo needs into $(VENV), once: ROS 2's Python packages, numpy, scipy," \
		'matplotlib ...'
	@{ $(RUN)/python -m pip install --disable-pip-version-check \
		$(if $(CONSTRAINTS),--constraint $(CONSTRAINTS)) --editable '.[$(DEMO_EXTRAS)]'; \
		echo $$? > $(VENV)/.pip-status; } | \
		sed -u -n 's/^Collecting \([A-Za-z0-9_.-]*\).*/  \1/p'; \
		exit "$$(cat $(VENV)/.pip-status)"
	@touch $@

# Where everything is installed already, that serves the demo, too.
demo: $(if $(wildcard $(STAMP)),$(STAMP),$(DEMO_STAMP))
	@$(RUN)/python demo/run_demo.py --output '$(DEMO_OUTPUT)' \
		$(if $(RECORDING),--recording '$(RECORDING)') $(if $(TOPIC),--topic '$(TOPIC)')

test: $(STAMP)
	$(RUN)/python -m pytest $(SHARED) $(PYTEST_ARGS)

test-fast: $(STAMP)
	$(RUN)/python -m pytest -q $(SHARED) $(FAST) $(PYTEST_ARGS)

test-slow: $(STAMP)
	$(RUN)/python -m pytest -m slow -o faulthandler_timeout=0 $(PYTEST_ARGS)

# All take hours; MUTANTS='imu_allan.noise.fit*' those of a module. `mutmut show NAME` shows one.
mutation: $(STAMP)
	@$(RUN)/python -m pip install --quiet --disable-pip-version-check 'mutmut>=3.8'
	$(RUN)/python -m mutmut run $(MUTANTS)

coverage: $(STAMP)
	$(RUN)/python -m pytest --cov --cov-report=term-missing:skip-covered $(PYTEST_ARGS)

lint: $(STAMP)
	$(RUN)/ruff check .
	$(RUN)/mypy
	$(RUN)/ament_flake8 $(LINTED)
	$(RUN)/ament_pep257 $(LINTED)

docs: $(STAMP)
	$(RUN)/python -m sphinx --fail-on-warning --keep-going -n -q docs docs/_build/html

bench: $(STAMP)
	$(RUN)/python bench/bench_analyze.py $(if $(BASE),--base '$(BASE)')
	@for script in $(SPEED:%=bench/bench_%.py); do \
		echo "== $$script"; $(RUN)/python $$script || exit 1; done

bench-filter: $(STAMP)
	$(RUN)/python bench/bench_filter.py

battery: $(STAMP)
	@PYTHONPATH=bench $(RUN)/python -m battery $(if $(BASE),--base '$(BASE)') $(BATTERY_ARGS)

bench-accuracy: $(STAMP)
	@PYTHONPATH=bench $(RUN)/python -m battery --only standard
	@PYTHONPATH=bench $(RUN)/python -m battery --parts recordings

# The peers, pinned, beside this package as it stands.
.venv-peers/.installed: setup.py bench/peers/requirements.txt
	@test -x .venv-peers/bin/python || $(PYTHON) -m venv .venv-peers
	@.venv-peers/bin/python -m pip install --quiet --disable-pip-version-check \
		--requirement bench/peers/requirements.txt --editable .
	@touch $@

bench-peers: .venv-peers/.installed
	.venv-peers/bin/python bench/peers/run.py

clean:
	rm -rf .venv .venv-* build install log dist *.egg-info demo_output docs/_build \
		.pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage htmlcov mutants
