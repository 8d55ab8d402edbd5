# Two commands on a fresh machine with Python >= 3.11 and make:
#   make demo    environment, installation, the paper's results remade on the bundled Atlas rig
#   make test    the same environment with the test extras, then the test-suite
#   make test-all    the same with the long studies, the measured machines and repeats at full size
# PYTHON=python3.12 chooses the interpreter, VENV=folder the environment, WORKERS=4 the test processes.

PYTHON ?= python3
VENV ?= .venv
WORKERS ?= 2
BIN := $(VENV)/bin
# a module is compiled when it is first imported: most of what comes with the packages never is
INSTALL := $(BIN)/python -m pip install -q --no-compile -e
SUITE := $(BIN)/python -m pytest -q -n $(WORKERS) --dist loadfile --no-loadscope-reorder --durations=20

.PHONY: demo test test-all clean

demo: $(VENV)/.installed
	$(BIN)/omnijax reproduce --out demo
	@echo "The page: $(CURDIR)/demo/index.html"

test: $(VENV)/.test-installed
	$(SUITE)

test-all: $(VENV)/.test-installed
	$(SUITE) -m ""

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) .
	@touch $@

$(VENV)/.test-installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(INSTALL) ".[test]"
	@touch $@ $(VENV)/.installed

clean:
	rm -rf $(VENV) demo build dist docs/_build
