# Everything here runs on a bare machine with Python 3.11 or newer, git and make.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
RUN := $(BIN)/shadowbench
WORKERS ?= 2

.PHONY: help demo figures figures-quick test test-slow test-browser check bench lint docs clean
help:
	@echo "make demo          install, then run the citadel scene"
	@echo "make figures       install, then reproduce every figure, table and claim into results/ (figures-quick: small, in minutes)"
	@echo "make test          install, then run the tests"
	@echo "make test-slow     the exhaustive tests"
	@echo "make test-browser  the report in headless Chromium, where there is one"
	@echo "make check         operation counts against results/counts.lock"
	@echo "make bench         the performance bars, printed as ratios"
	@echo "make docs          the generated pages of the manual"
	@echo "make lint          style, types and import rules"

.venv/installed: pyproject.toml
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

.venv/installed-dev: .venv/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,peers]'
	@touch $@

demo: .venv/installed
	$(RUN) run configs/citadel.yaml
	@echo
	@echo "Open report.html in the folder above. What to try next:"
	@echo "  $(RUN) list algorithms"
	@echo "  $(RUN) run gate -a reference -a 'shadow_map[resolution=512]'"
	@echo "  $(RUN) init my_scene      then edit my_scene.yaml and run it"

# Hours at full size; what was measured is kept, so an interrupted run goes on.
figures: .venv/installed
	$(RUN) reproduce all

figures-quick: .venv/installed
	$(RUN) reproduce all --quick --out results/runs/quick

# Files are dealt out whole: what they compile is then compiled once, mostly.
test: .venv/installed-dev
	$(BIN)/python -m pytest -n $(WORKERS) --dist loadfile

test-slow: .venv/installed-dev
	$(BIN)/python -m pytest -m slow

test-browser: .venv/installed-dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[browser]'
	$(BIN)/python -m pytest -m browser -rs

check: .venv/installed
	$(RUN) check

bench: .venv/installed-dev
	$(BIN)/python -m pytest -m bench -s

lint: .venv/installed-dev
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: .venv/installed-dev
	$(BIN)/python docs/make_pages.py

clean:
	rm -rf .venv .pytest_cache .mypy_cache .ruff_cache .hypothesis
