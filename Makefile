# The project's commands: quickstart, test, coverage, docs, verification, bench; each makes .venv first.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: quickstart test coverage nojit lint docs verification bench hooks clean help
help:            ## list the commands
	@grep -E '^[a-z]+: .*##' $(MAKEFILE_LIST) | sed 's/:.*##/ -/'

$(STAMP): pyproject.toml constraints.txt
	$(PYTHON) -m venv $(VENV)
	PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet --progress-bar off -e '.[dev]'
	touch $(STAMP)

quickstart: $(STAMP) ## from two settled beds to a trained, exported, running closure
	$(BIN)/greybed quickstart --out runs/quickstart

test: $(STAMP)   ## lint, types, import contracts, tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -n 2 --dist worksteal --durations=10

# Compiled lines cannot be seen: kernels are left out of the one, and are all there is of the other.
KERNELS := greybed/*/_[a-z]*.py,greybed/*/*/_[a-z]*.py,greybed/*/*/*/_[a-z]*.py
coverage: $(STAMP) ## branches that the tests reach outside kernels, at least 90 %
	$(BIN)/coverage erase
	OPENBLAS_NUM_THREADS=1 $(BIN)/coverage run -m pytest -n 2 --dist worksteal
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report --omit='$(KERNELS)' --fail-under=90

TINY := tests/*/test_tiny_*.py \
	'tests/raytrace/test_cuda.py::test_single_rays_give_the_same_counts[unbounded_random]'
nojit: export COVERAGE_FILE := .coverage.nojit
nojit: $(STAMP)  ## kernels as plain Python: small cases, and the lines of kernels that they reach
	$(BIN)/coverage erase
	NUMBA_DISABLE_JIT=1 $(BIN)/coverage run -m pytest $(TINY)
	$(BIN)/coverage combine --quiet
	$(BIN)/coverage report --include='$(KERNELS)' --fail-under=90

lint: $(STAMP)   ## mend what can be mended, show the rest
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .
	$(BIN)/mypy
	$(BIN)/lint-imports

$(VENV)/.installed-docs: $(STAMP)
	PIP_CONSTRAINT=constraints.txt $(BIN)/python -m pip install --quiet --progress-bar off -e '.[docs]'
	touch $@

docs: $(VENV)/.installed-docs ## pages and module reference as HTML in build/docs; a dead link fails
	$(BIN)/python -m sphinx --fail-on-warning --keep-going --quiet -c docs . build/docs
	@echo open build/docs/index.html

verification: $(STAMP) ## every figure of docs/verification.md anew, pass or fail; six minutes
	$(BIN)/python examples/verification/run.py

bench: $(STAMP)  ## benchmarks against peers; not part of the tests
	$(BIN)/python benchmarks/raytrace.py
	$(BIN)/python benchmarks/dem.py

hooks: $(STAMP)  ## install the pre-commit hooks
	$(BIN)/pre-commit install

clean:           ## remove what the commands above made
	rm -rf $(VENV) runs build dist *.egg-info
