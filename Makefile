# `make validate` runs the main job, `make test` the tests; each sets itself up in .venv first.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: validate test long-test models docs setup clean

validate: setup
	$(BIN)/python -m validation run

test: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/python -m pytest -n 2 --dist worksteal

# hours: everything that `make test` samples, in full
long-test: setup
	KILLS=50 $(BIN)/python -m pytest tests/whole/test_kills.py tests/validation/run/test_machines.py
	PACKAGE=all $(BIN)/python -m pytest tests/whole/test_package.py
	MACHINES=all $(BIN)/python -m pytest tests/whole/test_machines.py
	$(BIN)/python -m pytest tests/validation/engines/test_engines.py
	$(BIN)/python -m pytest tests/fourbar/mjcf/test_simulators.py tests/validation/lab/subjects/test_subjects.py
	PROBLEMS=all $(BIN)/python -m pytest tests/validation/lab/subjects/test_problems.py
	RELEASES=pip $(BIN)/python -m pytest tests/validation/lab/subjects/test_versions.py
	$(BIN)/python -m validation standing --history mujoco --history pinocchio
	FREE_MOTIONS=30 $(BIN)/python -m pytest -n 2 tests/fourbar/evaluation/test_free_motion_reference.py
	$(BIN)/python -m validation fuzz --files --count 100000
	$(BIN)/python -m validation fuzz
	$(BIN)/python -m validation stability
	$(BIN)/python -m validation published
	$(BIN)/python -m validation run --suite hard --out results/hard
	$(BIN)/python -m validation run --random 1000 --out results/random

# the site of docs/, in site/
docs: setup
	$(BIN)/python -m pip install --quiet --editable ".[docs]"
	$(BIN)/sphinx-build -W -q docs site

models: setup
	$(BIN)/python -m validation write

setup: $(STAMP)

$(STAMP): pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --editable ".[test]"
	touch $(STAMP)

clean:
	rm -rf $(VENV) results site
