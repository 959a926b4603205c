# `make repro` runs the pipeline, `make test` the checks; both set up .venv first.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
READY := $(INSTALLED) $(if $(wildcard .git),,without-git)
LAST := table
export PATH := $(CURDIR)/$(BIN):$(PATH)

.DEFAULT_GOAL := help
.PHONY: help install without-git repro watch hidden-effects hidden-effects-few sim2sim \
	tune-size tune-size-few real-casts real-casts-few better-model better-model-few test quick format

help:
	@echo "make repro    set up, then run the pipeline (what changed since the last run)"
	@echo "make watch    follow what runs, on a page in the browser"
	@echo "make hidden-effects  draw, diagnose and score the hidden-effect benchmark (hours)"
	@echo "make hidden-effects-few  the same on four small sets (minutes)"
	@echo "make sim2sim  how near each optimizer comes to parameters that are known (hours)"
	@echo "make tune-size  what more casts to tune to are worth (an hour, after a paper-scale run)"
	@echo "make real-casts  what real casts are worth to a policy (hours, after a paper-scale run)"
	@echo "make better-model  what a better model is worth to a policy (hours)"
	@echo "make tune-size-few, real-casts-few, better-model-few  the same at demo scale (minutes)"
	@echo "make test     set up, then ruff, pyright and every test"
	@echo "make quick    ruff, pyright and the fast tests"
	@echo "make format   format the code"
	@echo "make install  set up only"

install: $(READY)

$(INSTALLED): requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info[:2] != (3, 11))' 2>&- || { \
		echo 'robotcast needs Python 3.11, and $(PYTHON) is none: make $(MAKECMDGOALS)' \
			'PYTHON=/path/to/python3.11' >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet -r requirements.lock
	$(BIN)/python -m pip install --quiet --no-deps --no-build-isolation -e .
	touch $@

without-git: $(INSTALLED) # as from an archive: DVC needs none, but must be told
	@grep -qs no_scm .dvc/config.local || dvc config --local core.no_scm true

# Two runs side by side keep two cores busy: cable 1, and beside it the others with the loop. Each
# takes its own stages alone (-s), as a stage that is only looked at locks what it reads. Then what
# is left, which is the report and what failed. A plain `dvc repro` does the same one after another.
BESIDE := data/beside.log
HERE := collect@cable1 track@cable1 collect@cable3 track@cable3 'tune@cable1*' generate@cable1 \
	'train@cable1*' 'evaluate@cable1*' 'baseline@cable1*'
LOOP := collect@cable2 track@cable2 'tune@cable2*' compare diagnose revise generate@cable2 \
	generate_revised 'train@cable2*' train_revised 'evaluate@cable2*' evaluate_revised \
	'tune@cable3*' generate@cable3 'train@cable3*' 'evaluate@cable3*'

repro: $(READY)
	@mkdir -p data
	dvc repro hide candidates
	@echo "beside this run, the loop and the other cables: tail -f $(BESIDE)"
	@dvc --wait-for-lock repro -s --glob $(LOOP) > $(BESIDE) 2>&1 & \
		beside=$$!; trap 'kill $$beside; exit 130' INT TERM; \
		dvc --wait-for-lock repro -s --glob $(HERE); wait $$beside; true
	dvc repro

watch: $(INSTALLED)
	robotcast watch

# A study and its small variant are two ends of one pipeline: studies/<name>/dvc.yaml.
hidden-effects hidden-effects-few: LAST = score
hidden-effects hidden-effects-few: STUDY = hidden_effects
tune-size tune-size-few: STUDY = tune_size
real-casts real-casts-few: STUDY = real_casts
better-model better-model-few: STUDY = better_model

hidden-effects better-model: $(READY)
	dvc repro studies/$(STUDY)/dvc.yaml:$(LAST)@full

tune-size real-casts: $(READY)
	@grep -q '^scale: paper' params.yaml || { \
		echo '$@ goes on from a paper-scale run: set "scale: paper" in params.yaml,' \
			'then make repro' >&2; exit 1; }
	dvc repro studies/$(STUDY)/dvc.yaml:$(LAST)@full

hidden-effects-few tune-size-few real-casts-few better-model-few: $(READY)
	dvc repro studies/$(STUDY)/dvc.yaml:$(LAST)@few

sim2sim: $(READY)
	dvc repro studies/sim2sim/dvc.yaml

test: $(INSTALLED)
	ruff check
	ruff format --check
	pyright
	pytest -n 2 --dist loadfile --no-loadscope-reorder

quick: $(INSTALLED)
	ruff check
	pyright
	pytest -n 2 --dist loadfile --no-loadscope-reorder -m "not slow"

format: $(INSTALLED)
	ruff format
	ruff check --fix
