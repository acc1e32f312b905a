# omote: `make demo` shows it, `make test` checks it. Both set everything up by themselves.
# Setting up needs the network once; afterwards nothing is fetched.

VENV  := .venv
BIN   := $(VENV)/bin
PY    := $(BIN)/python
UV    := $(shell command -v uv 2>/dev/null)
# The first interpreter found that is new enough.
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	command -v $$p >/dev/null 2>&1 && $$p -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null && echo $$p && break; done)

export PIP_DISABLE_PIP_VERSION_CHECK := 1

.DEFAULT_GOAL := help
.PHONY: help demo test test-all check clients mutate fuzz bench soak setup api lock clean

help: ## print this list
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 10

demo: setup ## set up, then drive the face and the simulated servo head
	@$(BIN)/omote demo

# Without bytecode, where a user has switched it off, every process of a test would compile all modules again.
PYTEST := PYTHONDONTWRITEBYTECODE= $(PY) -m pytest
BESIDE := -n auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder
# Hundreds of tests wait for clocks and processes, which a busy machine keeps waiting: what failed beside other tests
# is run once more with nothing beside it, and named by that run. What fails alone too has failed.
ALONE = { [ $$? = 1 ] && echo 'What failed beside other tests runs once more, alone:' && \
	$(PYTEST) --last-failed --last-failed-no-failures none -v $(1); }

test: setup ## set up, then run the quick tests (no display, graphics processor or servo needed)
	@$(PYTEST) $(BESIDE) -m 'not slow' || $(call ALONE,-m 'not slow')

test-all: setup ## set up, then run every test, as CI does
	@$(PYTEST) $(BESIDE) || $(call ALONE)

check: setup ## check style and types
	@$(BIN)/ruff check . && $(BIN)/ruff format --check . && $(BIN)/mypy

# Other people's libraries, each in an environment of its own; needs a package index. CLIENT=rustypot runs one.
clients: setup ## run other people's programs against simulated servos: make clients CLIENT=rustypot
	@$(PY) -m tests.clients $(CLIENT)

# Not in requirements.lock: only this target needs it, and it depends on a dozen packages.
mutate: setup ## mutation testing of a room, 50 changed lines: make mutate ROOM=drivers SEED=1
	@$(PY) -c 'import cosmic_ray' 2>/dev/null || $(if $(UV),$(UV) pip install --python $(PY),$(PY) -m pip install) --quiet 'cosmic-ray>=8.4'
	@$(PY) -m tests.mutate $(ROOM) --seed $(or $(SEED),1) $(if $(UNDER),--under $(UNDER))

# COUNT files of each kind and lines; the same seed damages them in the same way.
fuzz: setup ## read damaged files of every kind, lines and messages: make fuzz COUNT=1000 SEED=1 MINUTES=60 JOBS=2
	@$(PY) -m tests.fuzz.files --count $(or $(COUNT),1000) --seed $(or $(SEED),1) \
		--minutes $(or $(MINUTES),60) $(if $(JOBS),--jobs $(JOBS))
	@$(PY) -m tests.fuzz.lines
	@$(PY) -m tests.fuzz.messages --count $(or $(MESSAGES),1000000) --seed $(or $(SEED),1)
	@$(PY) -m tests.fuzz.requests --count $(or $(MESSAGES),1000000) --seed $(or $(SEED),1)

bench: setup ## measure the engine on this machine
	@$(BIN)/omote bench

soak: setup ## inject faults for long: pairs and triples on simulated buses, and killed processes (SECONDS=3600)
	@$(PY) benchmarks/fault_soak.py $(or $(SECONDS),3600)
	@test ! -e benchmarks/process_kill.py || $(PY) benchmarks/process_kill.py

setup: $(VENV)/.installed $(VENV)/.opengl $(VENV)/.compiled ## install and compile everything

$(VENV)/.installed: requirements.lock pyproject.toml
	@test -n "$(UV)$(PYTHON)" || { echo "omote needs Python 3.11 or newer. Debian, Ubuntu: sudo apt-get install python3 python3-venv"; exit 1; }
	@echo "Setting up $(VENV) (a minute, once) ..."
ifneq ($(UV),)
	@test -x $(PY) || $(UV) venv --quiet --python '>=3.11' $(VENV)
	@$(UV) pip install --quiet --python $(PY) --require-hashes -r requirements.lock
	@$(UV) pip install --quiet --python $(PY) --no-build-isolation --no-deps --editable .
else
	@test -x $(PY) || $(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
		echo "Python's venv module is missing. Debian, Ubuntu: sudo apt-get install python3-venv"; exit 1; }
	@$(PY) -m pip install --quiet --require-hashes -r requirements.lock
	@$(PY) -m pip install --quiet --no-build-isolation --no-deps --editable .
endif
	@touch $@

# Drawing without a display needs EGL and, without a graphics processor, Mesa's software renderer (Linux).
OPENGL_PROBE := $(PY) -c 'import moderngl; moderngl.create_context(standalone=True, backend="egl", require=310)'
OPENGL_INSTALL := apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri

$(VENV)/.opengl: $(VENV)/.installed
	@if [ "$$(uname)" = Linux ] && ! $(OPENGL_PROBE) >/dev/null 2>&1; then \
		if [ "$$(id -u)" = 0 ] && command -v apt-get >/dev/null; then \
			echo "Installing Mesa's software renderer ..."; \
			{ $(OPENGL_INSTALL) || { apt-get update && $(OPENGL_INSTALL); }; } >$(VENV)/opengl.log 2>&1 \
				|| { tail -n 5 $(VENV)/opengl.log; exit 1; }; \
		else \
			echo "OpenGL is missing. Type: sudo $(OPENGL_INSTALL)"; exit 1; \
		fi; \
		$(OPENGL_PROBE) || { echo "OpenGL still does not start; see docs/troubleshooting.md"; exit 1; }; \
	fi
	@touch $@

# The kernels are compiled for this processor and kept beside the code; checking the head uses most of them. Beside it
# a second process begins with those that the check needs last; no kernel is compiled twice (surface/base/jit.py).
SECOND := import drivers.core.kernels, controller.motion.braking; from surface.bench.bench import sheet; \
	from surface.deform.deformation import Deformation; Deformation(*sheet(500))
$(VENV)/.compiled: $(VENV)/.installed
	@echo "Compiling the surface engine (half a minute, once) ..."
	@$(PY) -c '$(SECOND)' >/dev/null 2>&1 & $(BIN)/omote check ict; checked=$$?; wait; exit $$checked
	@$(BIN)/omote run everything --headless --seconds 1 >$(VENV)/first-run.log 2>&1 || true # pictures, links and mirror
	@touch $@

api: setup ## update the snapshot of the public API after an intended change
	@$(PY) -m tests.public_api > tests/public_api.new && mv tests/public_api.new tests/public_api.txt

lock: ## update requirements.lock (needs uv)
	@uv pip compile pyproject.toml --extra all --group dev --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-header --no-annotate --quiet --upgrade -o requirements.lock

clean: ## remove the files that setting up and running created
	@rm -rf $(VENV) out dist .pytest_cache .ruff_cache .mypy_cache .hypothesis
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +
