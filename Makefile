# Everything a person does with this repository, by name. `make help` lists it.
PYTHON ?= python3
VENV   := .venv
GAP    := $(VENV)/bin/gap
RUN    ?=
TASK   ?= fulfill-grocery
SAY    ?= Pick the alphabet soup and place it in the basket
N      ?= 10
STAMP  := $(VENV)/.setup-done

.PHONY: help setup demo plan generate validate rehearse report test check format clean
.DEFAULT_GOAL := help

help:  ## this list
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 12

setup: $(STAMP)  ## make .venv with everything in it, and see that rendering works

$(STAMP): pyproject.toml gap_runtime/pyproject.toml .ci/setup
	@PYTHON="$(PYTHON)" VENV="$(VENV)" .ci/setup
	@touch $@

demo: setup  ## plan, generate, validate, rehearse 10 instances, report
	@$(GAP) demo -n $(N)

plan: setup  ## make plan TASK=... SAY="..."
	@$(GAP) plan --task "$(TASK)" --say "$(SAY)"

generate validate report: setup  ## make generate|validate|report [RUN=...]
	@$(GAP) $@ $(RUN)

rehearse: setup  ## make rehearse [RUN=...] [N=...]
	@$(GAP) rehearse $(RUN) -n $(N)

test: setup  ## the whole test suite, on all cores
	@$(VENV)/bin/python -m pytest -n auto --dist loadgroup

check: setup  ## ruff, formatting and mypy
	@$(VENV)/bin/ruff check .
	@$(VENV)/bin/ruff format --check .
	@$(VENV)/bin/mypy

format: setup  ## let ruff rewrite what it can
	@$(VENV)/bin/ruff check --fix --quiet . || true
	@$(VENV)/bin/ruff format .

clean:  ## remove what make made; runs/ stays
	rm -rf $(VENV) build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
