# `make repro` runs the pipeline, `make test` the checks; both set up .venv first.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help install repro hidden-effects hidden-effects-few sim2sim test quick format

help:
	@echo "make repro    set up, then run the pipeline (what changed since the last run)"
	@echo "make hidden-effects  draw, diagnose and score the hidden-effect benchmark (hours)"
	@echo "make hidden-effects-few  the same on four small sets (minutes)"
	@echo "make sim2sim  how near each optimizer comes to parameters that are known (hours)"
	@echo "make test     set up, then ruff, pyright and every test"
	@echo "make quick    ruff, pyright and the fast tests"
	@echo "make format   format the code"
	@echo "make install  set up only"

install: $(INSTALLED)

$(INSTALLED): requirements.lock pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	touch $@

repro: $(INSTALLED)
	$(BIN)/dvc repro

hidden-effects: $(INSTALLED)
	$(BIN)/dvc repro benchmarks/hidden_effects/dvc.yaml

hidden-effects-few: $(INSTALLED)
	for stage in draw diagnose rivals oracle score; do \
		$(BIN)/python stages/hidden_$$stage.py hidden_effects=few || exit 1; \
	done

sim2sim: $(INSTALLED)
	$(BIN)/dvc repro benchmarks/sim2sim/dvc.yaml

test: $(INSTALLED)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/pyright
	$(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder

quick: $(INSTALLED)
	$(BIN)/ruff check
	$(BIN)/pyright
	$(BIN)/pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not slow"

format: $(INSTALLED)
	$(BIN)/ruff format
	$(BIN)/ruff check --fix
