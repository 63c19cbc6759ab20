# make demo, make test, make docs: all install into .venv first, when they have to.

PYTHON ?= python3
BIN := .venv/bin
INSTALLED := .venv/installed
# Two processes, each file of tests in one of them; make test PYTEST_ARGS= for a single process.
PYTEST_ARGS ?= -n 2 --dist loadfile

.PHONY: demo test docs install clean

demo: $(INSTALLED)
	$(BIN)/planetpose demo

test: $(INSTALLED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	@# mypy beside the tests, which often wait for servers; what it found is printed after them.
	@found=$$(mktemp); $(BIN)/mypy >$$found 2>&1 & types=$$!; \
	  echo "$(BIN)/pytest $(PYTEST_ARGS)"; $(BIN)/pytest $(PYTEST_ARGS); tests=$$?; \
	  wait $$types; typed=$$?; echo "$(BIN)/mypy"; cat $$found; rm -f $$found; exit $$((tests + typed))

# Strict: a broken link, reference or equation is an error. The tests build it too.
docs: $(INSTALLED)
	$(BIN)/python -m sphinx -W --keep-going -q -b html docs docs/_build
	@echo "docs/_build/index.html"

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and \
	  "planetpose needs Python 3.11 or newer, this is " + sys.version.split()[0] + "; try make PYTHON=python3.12")'
	@echo "Installing into .venv; this takes some minutes the first time."
	$(PYTHON) -m venv .venv
	@# constraints.txt lists every package that is needed: two processes of pip share the list, with nothing to resolve,
	@# and modules are compiled when they are first imported. Then planetpose, and what the list lacks on this system.
	-sed 's/#.*//' constraints.txt | xargs -n 24 -P 2 $(BIN)/python -m pip install --quiet --no-deps --no-compile
	$(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --editable ".[dev,lab]"
	@touch $@

clean:
	rm -rf .venv .mypy_cache .pytest_cache .ruff_cache .hypothesis
