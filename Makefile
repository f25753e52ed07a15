# armload: set up, try, test. `make` alone lists the targets.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 2
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

# One thread for each test worker: nested BLAS threads fight over the cores and make a test slower, never faster.
test test-all: export OMP_NUM_THREADS = 1
test test-all: export OPENBLAS_NUM_THREADS = 1
test test-all: export MPLBACKEND = agg

.DEFAULT_GOAL := help
.PHONY: help demo test test-all lint format lock clean

help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: $(VENV)/.stamp ## simulate, train small ensembles, identify an unseen payload; writes out/demo
	$(BIN)/armload demo --out out/demo

test: lint ## lint, types and every test that needs nothing but Python (this is what CI runs)
	$(BIN)/python -m pytest -n $(WORKERS) -m "not full"

test-all: lint ## as test, and the tests marked full too (skipped with a reason where their program is missing)
	$(BIN)/python -m pytest -n $(WORKERS) -m ""

lint: $(VENV)/.stamp ## ruff (rules and format) and pyright
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/pyright

format: $(VENV)/.stamp ## let ruff fix and format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

lock: ## resolve requirements.lock anew from pyproject.toml (newest versions, Linux, Python 3.11 and later)
	$(PYTHON) -m venv build/lock
	build/lock/bin/python -m pip --disable-pip-version-check --quiet install uv
	build/lock/bin/uv pip compile --quiet --upgrade --universal --python-version 3.11 --extra dev --no-annotate \
		--no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" \
		--output-file requirements.lock pyproject.toml
	rm -rf build/lock

clean: ## remove everything that can be made again, the virtual environment included
	rm -rf $(VENV) build dist out .ruff_cache .pytest_cache .hypothesis
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamp is touched last: a set-up that was interrupted is taken up again by the next make.
$(VENV)/.stamp: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "armload needs Python 3.11 or newer, and '$(PYTHON)' is" \
		"$$($(PYTHON) --version 2>&1 || echo missing): name another one with 'make PYTHON=python3.12'" >&2; exit 1; }
	@echo "setting up $(VENV) (once; a few minutes)"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@$(PIP) install --no-deps --requirement requirements.lock
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@
