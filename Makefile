# `make repro` runs the pipeline, `make test` the checks; both set up .venv first.
PYTHON ?= python3.11
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed

.DEFAULT_GOAL := help
.PHONY: help install repro hidden-effects hidden-effects-few sim2sim \
	tune-size tune-size-few real-casts real-casts-few better-model better-model-few test quick format

help:
	@echo "make repro    set up, then run the pipeline (what changed since the last run)"
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
	for stage in draw diagnose rivals score; do \
		$(BIN)/python stages/hidden_$$stage.py hidden_effects=few || exit 1; \
	done

sim2sim: $(INSTALLED)
	$(BIN)/dvc repro benchmarks/sim2sim/dvc.yaml

PAPER_SCALE = @grep -q '^scale: paper' params.yaml || { \
	echo '$@ goes on from a paper-scale run: set "scale: paper" in params.yaml,' \
		'then make repro' >&2; exit 1; }

tune-size: $(INSTALLED)
	$(PAPER_SCALE)
	$(BIN)/dvc repro benchmarks/tune_size/dvc.yaml

tune-size-few: $(INSTALLED)
	for casts in 5 15; do \
		$(BIN)/python stages/tune.py scale.tune.tune_casts=15 scale.tune.segmented.casts=$$casts \
			optimizer.budget_casts=$$((280 * casts)) \
			paths.tuned=data/tune_size_few/segmented-$$casts || exit 1; \
	done
	$(BIN)/python stages/tune_size_table.py studies=few

real-casts: $(INSTALLED)
	$(PAPER_SCALE)
	$(BIN)/dvc repro benchmarks/real_casts/dvc.yaml

real-casts-few: $(INSTALLED)
	$(BIN)/python stages/candidates.py
	for cell in real-20 real-35 mixed-20 mixed-35; do \
		set -- dataset=$${cell%-*} paths.policy=data/real_casts_few/policies/$$cell \
			paths.evaluation=data/real_casts_few/evaluation/$$cell \
			paths.evaluation_sessions=data/real_casts_few/sessions/$$cell; \
		$(BIN)/python stages/train.py $$@ dataset.casts=$${cell#*-} || exit 1; \
		$(BIN)/python stages/evaluate.py $$@ || exit 1; \
	done
	$(BIN)/python stages/real_casts_table.py studies=few

better-model: $(INSTALLED)
	$(BIN)/dvc repro benchmarks/better_model/dvc.yaml

FEW := data/better_model_few
better-model-few: $(INSTALLED)
	$(BIN)/python stages/candidates.py
	$(BIN)/python stages/collect.py rig=tilted paths.sessions=$(FEW)/sessions
	$(BIN)/python stages/track.py paths.sessions=$(FEW)/sessions \
		paths.measurements=$(FEW)/measurements
	$(BIN)/python stages/diagnose.py measurements=$(FEW)/measurements output=$(FEW)/diagnosis
	for model in base diagnosed; do \
		set -- optimizer=gn paths.measurements=$(FEW)/measurements \
			paths.tuned=$(FEW)/tuned/$$model paths.simulated=$(FEW)/simulated/$$model \
			paths.targets=$(FEW)/simulated/base paths.policy=$(FEW)/policies/$$model-mixed \
			paths.evaluation=$(FEW)/evaluation/$$model-mixed \
			paths.evaluation_sessions=$(FEW)/evaluation_sessions/$$model-mixed; \
		named=$$($(BIN)/python stages/verdict.py output=$(FEW)/diagnosis \
			studies.better_model.model=$$model); \
		$(BIN)/python stages/tune.py $$@ "effects=[$$named]" || exit 1; \
		$(BIN)/python stages/generate.py $$@ || exit 1; \
		$(BIN)/python stages/train.py $$@ || exit 1; \
		$(BIN)/python stages/evaluate.py rig=tilted $$@ || exit 1; \
	done
	$(BIN)/python stages/better_model_table.py studies=few

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
