# Needs only make and Python 3.11 or later; everything else goes into .venv.
PYTHON ?= python3
BIN := .venv/bin
STAMP := .venv/.installed
BENCH_STAMP := .venv/.bench
BENCH := OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q --override-ini 'python_files=bench_*.py'
DATA := $(or $(ROBID_DATA),../shared/data)

.DEFAULT_GOAL := help
.PHONY: help install run run-log study test test-slow test-hard lint check docs bench bench-quick clean

help: ## show this list
	@sed -n 's/^\([a-z-]*\):.*## /\1|/p' $(MAKEFILE_LIST) | while IFS='|' read -r name text; do printf '  %-10s %s\n' "$$name" "$$text"; done

install: $(STAMP) ## create .venv and install robid with its tools

$(STAMP): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit("robid needs Python 3.11 or later; name one: make PYTHON=python3.12" if sys.version_info < (3, 11) else 0)'
	@$(BIN)/python -m pip --version >/dev/null 2>&1 || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[dev]'
	@touch $@

run: $(STAMP) ## run the default experiment: the springs of a simulated KR300
	$(BIN)/robid run configs/kr300.yaml

run-log: ## run the same chain on a real log, where its data folder is there
	@if [ -d "$(DATA)/motor_bench" ]; then \
		$(MAKE) --no-print-directory install && { $(BIN)/robid run configs/motor_bench.yaml || [ $$? -eq 5 ]; }; \
	else \
		echo "run-log skipped: there is no folder $(DATA)/motor_bench; set ROBID_DATA to the folder that holds motor_bench"; \
	fi

study: $(STAMP) ## run a study, as in make study NAME=frf
	@[ -f "configs/studies/$(NAME).yaml" ] || { echo "name a study, as in make study NAME=frf; there are: $(notdir $(basename $(wildcard configs/studies/*.yaml)))"; exit 2; }
	$(BIN)/robid study configs/studies/$(NAME).yaml

test: $(STAMP) ## run the tests, on all cores
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -m "not slow and not hard" -n auto --dist worksteal

test-slow: $(STAMP) ## run the tests that take minutes, an hour on two cores, and print their figures
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -rP -m slow -n auto --dist worksteal

test-hard: $(STAMP) ## attack it for an hour: mutated settings, damaged files; counts in runs/hard/summary.json
	rm -rf runs/hard
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python -m pytest -q -m hard -n auto; \
	code=$$?; $(BIN)/python tests/hard_summary.py; exit $$code

lint: $(STAMP) ## check format, rules, types and layers
	$(BIN)/ruff format --check robid tests
	$(BIN)/ruff check robid tests
	$(BIN)/mypy --strict robid
	$(BIN)/lint-imports

check: lint test ## what CI runs: lint and test

docs: $(STAMP) ## build the site, into runs/site/index.html
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

bench: $(BENCH_STAMP) ## measure speed as ratios within one run, into runs/bench/bench.json
	$(BENCH) tests/bench

bench-quick: $(STAMP) ## hold the speed of two minutes' worth of tasks against the baseline
	$(BENCH) -m quick --baseline tests/bench/baseline.json tests/bench/bench_cli.py tests/bench/bench_default.py tests/bench/bench_face.py tests/bench/bench_frf.py

$(BENCH_STAMP): $(STAMP)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --editable '.[bench]'
	@touch $@

clean: ## remove caches and build leftovers; .venv and runs stay
	rm -rf build dist robid.egg-info .hypothesis .import_linter_cache .mypy_cache .pytest_cache .ruff_cache
	find robid tests -type d -name __pycache__ -prune -exec rm -rf {} +
