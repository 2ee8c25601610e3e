# Python 3.10 or newer as `python3`, and make; everything else is installed into .venv.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
# Each process begins with a part of the files, and takes tests from the end of another's when it has none left.
PARALLEL := --numprocesses auto --dist worksteal

DEFAULT := "not slow and not bench and not fuzz and not hosts and not paper and not platforms and not real_time"

TYPES := $(BIN)/pyrefly check --python-interpreter-path $(BIN)/python --output-format min-text
# What the oldest Python lacks; NumPy's types are of a newer one, so that others are not checked by it.
OLDEST := --only missing-import --only missing-module-attribute --only missing-attribute --only unknown-name

OF_PACKAGE := pyproject.toml constraints.txt setup.py $(wildcard fmus/runtime/*.[ch] cosim/plan/*.[ch] cosim/isolation/*.[ch])
# Python compiles the modules that it imports: a tenth of those that are installed.
INSTALL := $(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --editable

WHEELS := x86_64-linux aarch64-linux x86_64-windows x86_64-darwin aarch64-darwin

.PHONY: demo test test-changed test-slow mutations fuzz paper real-time platforms hosts lint bench wording docs pictures icons wheels install clean

demo: $(VENV)/.installed
	$(BIN)/handover run helix_handover

install: $(VENV)/.installed

# Linters and types beside the tests, which leave a processor idle here and there; their report is printed last.
test: $(VENV)/.installed-test build/lint/handover
	@$(MAKE) --silent lint > build/lint/report 2>&1 & lint=$$!; \
	$(BIN)/python -m pytest $(PARALLEL) -m $(DEFAULT); tests=$$?; \
	wait $$lint; lint=$$?; cat build/lint/report; exit $$((tests || lint))

# The default tests of what differs from a commit: make test-changed SINCE=main
test-changed: $(VENV)/.installed-test
	$(BIN)/python tests/support/changed.py $(SINCE) | xargs -r $(BIN)/python -m pytest -m $(DEFAULT)

# How many of 60 changed operators the default tests kill, some 30 minutes: make mutations SEED=7
mutations: $(VENV)/.installed-test
	$(BIN)/python tests/support/mutations.py --seed $(or $(SEED),0) $(DEFAULT)

test-slow: $(VENV)/.installed-test
	$(BIN)/python -m pytest $(PARALLEL) -m slow

fuzz: $(VENV)/.installed-test
	$(BIN)/python -m pytest -m fuzz -s

real-time: $(VENV)/.installed-test
	$(BIN)/python -m pytest -m real_time -s

platforms: $(VENV)/.installed-test
	$(BIN)/python -m pytest $(PARALLEL) -m platforms

# docs/hosts.md: every unit in every form and host; a run that was interrupted goes on.
hosts: $(VENV)/.installed-test
	$(BIN)/python -m pytest -m hosts -s tests/exchange

paper: $(VENV)/.installed-test
	$(BIN)/python -m pytest -m paper

lint: $(VENV)/.installed-test build/lint/handover
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	cd build/lint && $(CURDIR)/$(BIN)/lint-imports --no-cache --config $(CURDIR)/pyproject.toml
	$(TYPES)
	$(TYPES) --python-version 3.10 $(OLDEST)

# The package as it is installed, for tools that read modules without importing them.
build/lint/handover:
	mkdir -p $@
	ln -s $(addprefix ../../../,cosim plants controllers fmus scenarios handover/__init__.py handover/py.typed) $@

bench: $(VENV)/.installed-test
	$(BIN)/python -m pytest tests/benchmarks -m "bench and not real_time" --benchmark-enable -s

# The golden file of messages, of the tests that compare with it.
wording: $(VENV)/.installed-test
	HANDOVER_REWRITE_WORDING=1 $(BIN)/python -m pytest -q -m "not hosts" $$(grep -rl "wording: Wording" tests --include="test_*.py")

# The site, which opens offline: docs/build/html/index.html.
docs: $(VENV)/.installed-docs
	PYTHONPATH=tests $(BIN)/python docs/sources.py
	$(BIN)/python -m sphinx --quiet --jobs auto --fail-on-warning --keep-going --builder html docs docs/build/html

# The README's pictures; needs chromium, too.
pictures: $(VENV)/.installed-test
	PYTHONPATH=tests $(BIN)/python docs/pictures.py

# The units' icons as PNG, of their drawings in fmus/icons/.
icons: $(VENV)/.installed-test
	$(BIN)/python tests/support/fmus/rendered_icons.py

wheels: $(VENV)/bin/python
	for platform in $(WHEELS); do \
	    HANDOVER_WHEEL_PLATFORM=$$platform $(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist . || exit; \
	done

$(VENV)/bin/python:
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 10) and 'Python 3.10 or newer is needed; this is ' + sys.version)"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip

$(VENV)/.installed: $(OF_PACKAGE) | $(VENV)/bin/python
	$(INSTALL) ".[all]"
	touch $@
	@echo "installed; begin with: $(BIN)/handover list"

$(VENV)/.installed-test: $(OF_PACKAGE) | $(VENV)/bin/python
	$(INSTALL) ".[test]"
	touch $(VENV)/.installed $@

$(VENV)/.installed-docs: $(OF_PACKAGE) | $(VENV)/bin/python
	$(INSTALL) ".[docs]"
	touch $(VENV)/.installed $@

clean:
	rm -rf $(VENV) build docs/build *.egg-info fmus/runtime/bin cosim/plan/bin cosim/isolation/bin
