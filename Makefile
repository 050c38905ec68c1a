# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
#
# make setup            create $(VENV) with everything; a second call does nothing
# make demo             the main job in about a minute (RECORDING=path analyzes a recording instead)
# make test             all everyday tests, those over real DDS included
# make test-slow        Monte Carlo, soak and fuzz runs
# make mutation         small faults in the numerics, thousands of them: which does no test see
# make coverage         the everyday tests, with the branches that none of them takes
# make lint             ruff, mypy --strict, ament_flake8 and ament_pep257
# make docs             the documentation as HTML, warnings are errors
# make bench            speed and memory;  make bench-accuracy  coefficients against the bound
# make clean            remove what the other targets made
#
# PYTHON, VENV and CONSTRAINTS choose another interpreter, folder and set of pinned versions:
#   make test VENV=.venv-jazzy PYTHON=python3.11 CONSTRAINTS=.ci/jazzy-constraints.txt

VENV ?= .venv
CONSTRAINTS ?=
EXTRAS ?= ros,fleet,test,lint,docs
PYTEST_ARGS ?=
RECORDING ?=
TOPIC ?=
DEMO_OUTPUT ?= demo_output
MUTANTS ?=

# The wheels of ROS 2 Jazzy exist for Python 3.10 to 3.14.
PYTHON ?= $(shell for python in python3 python3.14 python3.13 python3.12 python3.11 python3.10; do \
	$$python -c 'import sys, venv, ensurepip; sys.exit(not (3, 10) <= sys.version_info < (3, 15))' \
	2>/dev/null && echo $$python && break; done)

LINTED := imu_allan launch test demo bench examples docs/conf.py docs/make_commands.py \
	docs/make_figures.py setup.py

RUN := $(VENV)/bin
STAMP := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-slow mutation coverage lint docs bench bench-accuracy clean

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

demo: $(STAMP)
	@$(RUN)/python demo/run_demo.py --output '$(DEMO_OUTPUT)' \
		$(if $(RECORDING),--recording '$(RECORDING)') $(if $(TOPIC),--topic '$(TOPIC)')

test: $(STAMP)
	$(RUN)/python -m pytest $(PYTEST_ARGS)

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
	@for script in $(filter-out %_accuracy.py,$(wildcard bench/bench_*.py)); do \
		echo "== $$script"; $(RUN)/python $$script || exit 1; done

bench-accuracy: $(STAMP)
	$(RUN)/python bench/bench_accuracy.py

clean:
	rm -rf .venv .venv-* build install log dist *.egg-info demo_output docs/_build \
		.pytest_cache .mypy_cache .ruff_cache .hypothesis .coverage htmlcov mutants
