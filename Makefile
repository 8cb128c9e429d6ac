# `make demo` and `make test` are all a newcomer needs; each makes .venv if it is missing.

PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test test-long stress check lock clean

demo: .venv/installed
	$(BIN)/robot-dyn demo --force

# the many processes that tests start share their byte code
test test-long: export PYTHONDONTWRITEBYTECODE :=

test: .venv/installed
	$(BIN)/python -m pytest -n auto --dist worksteal

# the cases that tests mark as long: the whole catalog, all methods, more seeds
test-long: .venv/installed
	$(BIN)/python -m pytest -n auto --dist worksteal -m long

# hours: all hard cases and their figures in build/hard_cases; error estimates on 600 random scenes. With a fixed seed and
# with that of the day, which each prints.
stress: .venv/installed
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m tests.hard --full --write --seed $$(date +%Y%m%d)
	$(BIN)/python -m tests.estimates --scenes 600 --seed 1
	$(BIN)/python -m tests.estimates --scenes 600 --seed $$(date +%Y%m%d)

# what CI asks for besides the tests
check: .venv/installed
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports --no-cache

# versions that pass, written anew: those of a fresh environment with the latest of everything
lock:
	rm -rf .venv requirements-dev.lock
	touch requirements-dev.lock
	$(MAKE) .venv/installed
	$(BIN)/python -m pip freeze --exclude-editable | sed 's/$$/ ; python_version == "3.11"/' > requirements-dev.lock
	touch .venv/installed

.venv/installed: pyproject.toml requirements-dev.lock
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade "pip>=25.1"
	$(BIN)/python -m pip install --quiet --editable . --group dev --constraint requirements-dev.lock
	touch $@

clean:
	rm -rf .venv dist .pytest_cache .ruff_cache .hypothesis
