# `make demo` and `make test` are all a newcomer needs; each makes .venv if it is missing.

PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test check clean

demo: .venv/installed
	$(BIN)/robot-dyn demo --force

test: .venv/installed
	$(BIN)/python -m pytest -n auto

# what CI asks for besides the tests
check: .venv/installed
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports --no-cache

.venv/installed: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable . --group dev
	touch $@

clean:
	rm -rf .venv dist .pytest_cache .ruff_cache .hypothesis
