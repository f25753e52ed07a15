# armload: set up, try, test. `make` alone lists the targets.

PYTHON ?= python3
VENV := .venv
VENV_ROS := .venv-ros
VENV_BROKER := .venv-broker
BIN := $(VENV)/bin
WORKERS ?= 2
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet
# The kernels compiled once for the sources as they are, in place of numba in each process that a test starts.
AHEAD = ARMLOAD_KERNELS="$$($(BIN)/python hatch_build.py --here)"
# One worker for each file: what its tests share (a study, a demo) is made once. The order is that of tests/conftest.py.
PYTEST = $(AHEAD) $(BIN)/python -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder

# Where full tests need ports, real time or both cores: these run one after another, when the others are done.
ALONE = tests/app tests/devices tests/lab/test_experiment.py tests/service tests/survey

# What Python compiled is kept, whatever the caller's environment says: the tests start a hundred processes.
unexport PYTHONDONTWRITEBYTECODE

# One thread for each test worker: nested BLAS threads fight over the cores and make a test slower, never faster.
.tests test-all test-full: export OMP_NUM_THREADS = 1
.tests test-all test-full: export OPENBLAS_NUM_THREADS = 1
.tests test-all test-full: export MPLBACKEND = agg

.DEFAULT_GOAL := help
.PHONY: help demo docs test .tests test-all test-full parts lint format lock clean

help: ## list the targets
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/:.*## /\t/' | expand -t 12

demo: $(VENV)/.stamp ## simulate, train small ensembles, identify an unseen payload; writes out/demo
	$(BIN)/armload demo --out out/demo

docs: $(VENV)/.stamp ## the pages as a site, strictly: build/site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --quiet

test: $(VENV)/.stamp ## lint, types and every test that needs nothing but Python, side by side (this is what CI runs)
	@$(MAKE) --no-print-directory --jobs 2 lint .tests

.tests: $(VENV)/.stamp
	$(PYTEST) -m "not full"

test-all: lint parts ## as test, and the tests marked full too (skipped with a reason where their program is missing)
	$(PYTEST) -m ""

test-full: $(VENV)/.stamp parts ## only the tests marked full: the site, the wheel, and clients, ROS 2 and a browser if to be had
	$(PYTEST) -m full $(addprefix --ignore=,$(ALONE)); first=$$?; \
		$(AHEAD) $(BIN)/python -m pytest -m full $(ALONE) && exit $$first

parts: $(VENV)/.stamp
	@$(MAKE) --no-print-directory $(VENV)/.vendors || echo "no makers' clients: their tests will be skipped" >&2
	@$(MAKE) --no-print-directory $(VENV_ROS)/.stamp || echo "no ROS 2 environment: its tests will be skipped" >&2
	@$(MAKE) --no-print-directory $(VENV_BROKER)/.stamp || echo "no MQTT broker: its test will be skipped" >&2

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
	rm -rf $(VENV) $(VENV_ROS) $(VENV_BROKER) build dist out .ruff_cache .pytest_cache .hypothesis
	find src tests -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamp is touched last: a set-up that was interrupted is taken up again by the next make. Most of what is installed
# is never imported: Python compiles what is, when it is. Two gigabytes are unpacked, by two processes, half the names each.
$(VENV)/.stamp: requirements.lock pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "armload needs Python 3.11 or newer, and '$(PYTHON)' is" \
		"$$($(PYTHON) --version 2>&1 || echo missing): name another one with 'make PYTHON=python3.12'" >&2; exit 1; }
	@echo "setting up $(VENV) (once; a few minutes)"
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	@grep '^[a-m]' requirements.lock > $(VENV)/a-m.txt; grep -v '^[a-m]' requirements.lock > $(VENV)/n-z.txt
	@$(PIP) install --no-deps --no-compile --requirement $(VENV)/a-m.txt & first=$$!; \
		$(PIP) install --no-deps --no-compile --requirement $(VENV)/n-z.txt; second=$$?; \
		wait $$first && exit $$second
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

$(VENV)/.vendors: tests/devices/vendors/requirements.txt | $(VENV)/.stamp
	@$(PIP) install --only-binary :all: --requirement tests/devices/vendors/requirements.txt
	@touch $@

$(VENV_BROKER)/.stamp: tests/service/broker/requirements.txt | $(VENV)/.stamp
	@$(BIN)/python -m venv $(VENV_BROKER)
	@$(VENV_BROKER)/bin/python -m pip --disable-pip-version-check --quiet install --no-deps --only-binary :all: \
		--requirement tests/service/broker/requirements.txt
	@touch $@

# ROS 2 has an environment of its own: a start-up hook of these wheels runs every Python of it a second time. The rest of
# what armload needs it finds where the project has it; the name puts the file after the hook.
ROS_MESSAGES := tests/devices/ros/build_messages.py $(wildcard ros2/armload_msgs/*/* tests/devices/ros/messages/*/*/*)
$(VENV_ROS)/.stamp: tests/devices/ros/requirements.txt $(ROS_MESSAGES) | $(VENV)/.stamp
	@echo "setting up $(VENV_ROS) (once; a minute, and two for messages)"
	@rm -rf $(VENV_ROS)
	@$(BIN)/python -m venv $(VENV_ROS)
	@$(VENV_ROS)/bin/python -m pip --disable-pip-version-check --quiet install --no-deps --only-binary :all: \
		--requirement tests/devices/ros/requirements.txt
	@$(BIN)/python -c 'import site; print("import site; site.addsitedir(%r)" % site.getsitepackages()[0])' \
		> "$$($(VENV_ROS)/bin/python -c 'import site; print(site.getsitepackages()[0])')/zz_armload.pth"
	@$(VENV_ROS)/bin/python -c 'import armload.arms, rclpy; rclpy.init(); rclpy.create_node("armload"); rclpy.shutdown()'
	@$(VENV_ROS)/bin/python tests/devices/ros/build_messages.py \
		|| echo "no armload_msgs (C++ compiler and CMake?): the tests of ros2/armload_ros will be skipped" >&2
	@touch $@
