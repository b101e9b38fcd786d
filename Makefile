# `make validate` runs the main job, `make test` the quick tests, `make test-all` all of
# them; each sets itself up first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
LONG := kills package oldest prereleases machines engines simulators problems
LONG += benchmark oracles faults fuzz accuracy suites

.PHONY: validate test test-all check long-test $(LONG:%=long-%) models docs setup clean


validate: setup
	@echo "validate: scenes in MuJoCo and Pinocchio, half a minute;" \
		"the report is results/report.html"
	$(BIN)/python -m validation run
	@echo "validate: what six digits of torque and pin forces cost MuJoCo, some seconds"
	$(BIN)/python -m validation advise models/crank_rocker.toml --error 1e-6

# the contributor's loop: two to three minutes on two idle cores. Three processes, as a test
# waits now and then for what it started
test: check
	@echo "test: the quick tests, two to three minutes"
	$(BIN)/python -m pytest -n 3 --dist worksteal -m "not slow"

# every test that is not of a night
test-all: check
	$(BIN)/python -m pytest -n 3 --dist worksteal

check: setup
	@echo "check: style"
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@echo "check: types"
	$(BIN)/mypy
	$(BIN)/python -m tests.support.public_types

# everything that `make test-all` samples, in full; each part ends within one hour on
# two cores. Minutes of two idle cores: kills at most 16, suites 6, package 3, oldest
# and prereleases 8 each; from the processor's time of a share: machines 7 for each
# kernel that the processor has, fuzz 14, accuracy 12, faults 6,
# oracles 7; the others below 5
long-test: $(LONG:%=long-%)
$(LONG:%=long-%): setup

long-kills:
	KILLS=50 $(BIN)/python -m pytest tests/whole/test_kills.py \
		tests/whole/test_ending.py
	MUTATIONS=1000 $(BIN)/python -m pytest tests/whole/test_surroundings.py
long-package:
	PACKAGE=all $(BIN)/python -m pytest tests/whole/test_package.py
# every test with the lowest versions that pyproject.toml declares, and with the newest
# that are not released yet
long-oldest long-prereleases: long-%:
	$(BIN)/python -m pip install --quiet uv
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python build/$*
	$(BIN)/uv pip install --quiet --python build/$* $(VERSIONS_$*) \
		--editable ".[test]" --editable lab
	build/$*/bin/python -m pytest -n 2 --dist worksteal
VERSIONS_oldest := --resolution lowest-direct
VERSIONS_prereleases := --prerelease allow
long-machines:
	MACHINES=all $(BIN)/python -m pytest tests/whole/test_machines.py
long-engines:
	$(BIN)/python -m pytest tests/validation/engines/test_engines.py
long-simulators:
	$(BIN)/python -m pytest -m nightly
long-problems:
	PROBLEMS=all $(BIN)/python -m pytest tests/lab/simulators/test_problems.py
long-benchmark:
	$(BIN)/python -m fourbar_lab benchmark
	$(BIN)/python -m fourbar_lab findings
long-oracles:
	ORACLE_SHARE=1 $(BIN)/python -m pytest -n 2 tests/oracle
long-faults:
	$(BIN)/python -m fourbar_lab faults
long-fuzz:
	DRAWINGS=10000 $(BIN)/python -m pytest tests/fourbar/files/test_drawn_pins.py \
		tests/fourbar/formulas/test_formulas.py
	$(BIN)/python -m fourbar_lab fuzz-files --count 100000
	$(BIN)/python -m fourbar_lab fuzz --scenes 50000
long-accuracy:
	$(BIN)/python -m fourbar_lab stability
	$(BIN)/python -m validation published
long-suites:
	$(BIN)/python -m validation run --suite hard --out results/hard
	$(BIN)/python -m validation run --random 1000 --out results/random

# the site of docs/, in site/
docs: setup
	$(BIN)/python -m pip install --quiet --editable ".[docs]"
	$(BIN)/sphinx-build -W -q docs site

models: setup
	$(BIN)/python -m fourbar_lab write

setup: $(STAMP)

$(STAMP): pyproject.toml lab/pyproject.toml
	@echo "setup, 1 of 3: an environment in $(VENV)"
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@echo "setup, 2 of 3: the newest pip"
	$(BIN)/python -m pip install --quiet --upgrade pip
	@echo "setup, 3 of 3: MuJoCo, Pinocchio and the other libraries, some three minutes"
	$(BIN)/python -m pip install --editable ".[test]" --editable lab
	touch $(STAMP)
	@echo "setup: done"

clean:
	rm -rf $(VENV) results site
