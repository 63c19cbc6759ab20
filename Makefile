# make demo, make test, make docs: all install into .venv first, when they have to.

PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/installed
# Three processes, as many tests wait for servers and commands; each file of tests in one of them, the longest files
# first (tests/conftest.py). make test PYTEST_ARGS= for a single process.
PYTEST_ARGS ?= -n 3 --dist loadfile --no-loadscope-reorder

# Some machines forbid to keep compiled modules. Tests start hundreds of processes, and each would compile them anew.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo test docs install clean

demo: $(INSTALLED)
	$(BIN)/planetpose demo

test: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@# mypy beside the tests, which often wait for servers; what it found is printed after them.
	@began=$$(date +%s); found=$$(mktemp); \
	  { $(BIN)/mypy >$$found 2>&1; typed=$$?; echo "mypy: $$(($$(date +%s) - began)) s" >>$$found; exit $$typed; } & \
	  types=$$!; \
	  echo "$(BIN)/pytest $(PYTEST_ARGS)"; $(BIN)/pytest $(PYTEST_ARGS); tests=$$?; \
	  wait $$types; typed=$$?; echo "$(BIN)/mypy"; cat $$found; rm -f $$found; \
	  echo "tests, mypy beside them: $$(($$(date +%s) - began)) s"; exit $$((tests + typed))

# Strict: a broken link, reference or equation is an error. The tests build it too.
docs: $(INSTALLED)
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build
	@echo "docs/_build/index.html"

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and \
	  "planetpose needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; try make PYTHON=python3.12")'
	@echo "Installing into .venv; this takes some minutes the first time."
	@# constraints.txt lists every package that is needed: three processes of pip share the list, with nothing to resolve,
	@# and modules are compiled when they are first imported. Then planetpose; with its dependencies where the list did
	@# not suffice on this system.
	@began=$$(date +%s); $(PYTHON) -m venv .venv && \
	  if sed 's/#.*//' constraints.txt | xargs -n 16 -P 3 $(BIN)/python -m pip install --quiet --no-deps --no-compile && \
	    $(BIN)/python -m pip install --quiet --no-compile --no-deps --no-build-isolation --editable ".[dev,lab]" && \
	    $(BIN)/python -m pip check; then :; \
	  else \
	    echo "constraints.txt is not enough on this system; pip resolves the rest."; \
	    $(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --editable ".[dev,lab]"; \
	  fi && echo "installation: $$(($$(date +%s) - began)) s"
	@touch $@

clean:
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache .hypothesis
