# `make demo` and `make test` are all a newcomer needs; each makes .venv if it is missing.

PYTHON ?= python3
BIN := .venv/bin

.PHONY: demo test test-long stress check docs sbom lock clean

demo: .venv/installed
	$(BIN)/robot-dyn demo --force

# the many processes that tests start share their byte code
test test-long stress: export PYTHONDONTWRITEBYTECODE :=

test: .venv/installed
	$(BIN)/python -m pytest -n auto --dist worksteal

# the cases that tests mark as long: more of the catalog, all methods, more seeds
test-long: .venv/installed
	$(BIN)/python -m pytest -n auto --dist worksteal -m "long and not stress"

# hours: the cases that tests mark as stress and all campaigns, with seeds of the day; the report is build/stress/report.md,
# hard cases and their figures are in build/hard_cases
stress: .venv/installed
	$(BIN)/python -m tests.campaigns

# what CI asks for besides the tests
check: .venv/installed
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports --no-cache
	$(BIN)/python scripts/words.py

# the site, in build/docs/README.html: a warning, a link that leads nowhere or a cell that raises is an error
docs: .venv/installed
	$(BIN)/python -m sphinx -W --keep-going -q -b html -d build/docs_trees docs build/docs

# what a wheel brings along, with versions and licences: a bill of materials in CycloneDX
sbom: .venv/installed
	rm -rf build/sbom && $(PYTHON) -m venv build/sbom
	build/sbom/bin/python -m pip install --quiet --constraint requirements-dev.lock .
	$(BIN)/cyclonedx-py environment --pyproject pyproject.toml --output-file build/sbom.json build/sbom/bin/python
	rm -rf build/sbom

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
	$(BIN)/python -m pip install --quiet --no-compile --editable . --group dev --group docs --group release \
		--constraint requirements-dev.lock
	-$(BIN)/python -W ignore -m compileall -q -j 0 $(BIN)/../lib >/dev/null 2>&1  # pip compiles on one core
	touch $@

clean:
	rm -rf .venv dist .pytest_cache .ruff_cache .hypothesis
