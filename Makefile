# The few words that work on this needs; each expects the environment of README's test command in .venv.
BIN := .venv/bin
SUBJECT ?= contact

.PHONY: test quick slow lint library docs chart all

test: # all but the slow ones
	$(BIN)/pytest -n 2 --dist worksteal

quick: # what matters most of a subject: make quick SUBJECT=plate
	$(BIN)/pytest -m $(SUBJECT)

slow:
	$(BIN)/pytest -n 2 --dist worksteal -m slow

lint:
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	for system in win32 darwin; do $(BIN)/mypy --platform $$system --cache-dir .mypy_cache/$$system feeder_sim || exit 1; done
	$(BIN)/lint-imports
	$(BIN)/python benchmarks/size.py --most
	$(BIN)/tombi lint --offline scenarios models docs/tutorial conformance

library: # one of the libraries of machine code, another one from commit to commit, comes out as the same bytes
	$(BIN)/python -m feeder_sim.machine_code.build --check $$((0x$$(git rev-parse --short=7 HEAD)))

docs:
	$(BIN)/sphinx-build -W -q docs docs/_build/html

all: # as before a release
	.ci/run

chart: # every number and picture of docs/choosing.md, and other simulators beside: an hour
	$(BIN)/python benchmarks/chart.py
