# Two commands for a newcomer: make demo, make test. Nothing is installed outside .venv.
#   make test SLOW=1          with the slow tests
#   make test ARGS="-k servo" with further arguments for pytest
#   make demo PYTHON=python3.13

PYTHON ?= python3
OUT ?= out
SLOW ?= 0
ARGS ?=
BIN := .venv/bin
CORES := $(shell getconf _NPROCESSORS_ONLN 2>/dev/null || echo 1)

# The processes of a comparison or a test run fill the cores. Linear algebra that takes them 1 s with one
# thread each took 34 s with four threads each on four cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# Kept bytecode, whatever the environment says: hundreds of processes of a test run would each compile up to
# 800 modules anew.
export PYTHONDONTWRITEBYTECODE :=
# Pyright comes at a pinned version from the package index and need not ask elsewhere for a newer one.
export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1

PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check

.PHONY: demo test docs detector lint lint-rules lint-format lint-types lint-floors bench clean

demo: .venv/installed
	$(BIN)/truetip compare --out $(OUT)
	@echo "The report: $(OUT)/report.html"

# Whole modules stay on one core as far as possible, since the tests of a module share a simulation.
test: .venv/installed-dev
	$(BIN)/python -m pytest $(if $(filter-out 1,$(CORES)),-n $(CORES) --dist worksteal) \
	    $(if $(filter 1,$(SLOW)),-m "slow or not slow") $(ARGS)

# The manual in site/; a link that leads nowhere or a page that cannot be made ends it.
docs: .venv/installed-dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --strict
	@echo "The manual: site/index.html"

# A network that finds people in single images, for `truetip watch --network`; its licence is printed.
detector: .venv/installed-dev
	$(BIN)/python -m experiments.watch.fetch_detector

# make --keep-going lint shows the findings of all four.
lint: lint-rules lint-format lint-types lint-floors

lint-rules: .venv/installed-dev
	$(BIN)/ruff check .

lint-format: .venv/installed-dev
	$(BIN)/ruff format --check .

lint-types: .venv/installed-dev .venv/typings/made
	$(BIN)/pyright --pythonpath $(BIN)/python

lint-floors: .venv/installed-dev
	$(BIN)/lint-imports

# With what the tests need: some yardsticks are clients and libraries of others.
bench: .venv/installed-dev
	$(BIN)/python -m experiments.bench

clean:
	rm -rf .venv build dist *.egg-info out site bench.json
	rm -rf .hypothesis .import_linter_cache .pytest_cache .ruff_cache
	find robots systems diagrams experiments tests -name __pycache__ -type d -prune -exec rm -rf {} +

# The stamps are newer than pyproject.toml when everything in it is installed.
.venv/installed: pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	    { echo "truetip needs Python 3.11 or newer; name one with: make PYTHON=python3.12"; exit 1; }
	@echo "Installing truetip and Drake into .venv; the first time takes a minute or two."
	$(PYTHON) -m venv .venv
	$(PIP) install --editable .
	@touch $@

.venv/installed-dev: .venv/installed
	$(PIP) install --editable ".[dev]"
	@touch $@

# Drake's type stubs, with what their generator got wrong put right, so that pyright checks our use of
# Drake: array shapes in place of types, `object` where anything goes, `int` where any index goes, names
# of templates and results that it could not see, and base classes for what is handed back as it was put in.
ARRAY := numpy\.ndarray\[[a-z0-9_.]+\[[^]]*\](, [a-z_., ]+)?\]
TEMPLATES := ^from pydrake\.common\.cpp_template import
FIX_STUBS := \
    -e 's/-> $(ARRAY)/-> numpy.ndarray/g' \
    -e 's/$(ARRAY)/numpy.typing.ArrayLike/g' \
    -e 's/^import numpy$$/import numpy, numpy.typing, typing/' \
    -e 's/([[( ])object([], )]|:|$$)/\1Any\2/g' \
    -e 's/(index|arg0): int/\1: typing.SupportsIndex/g' \
    -e 's/(def (Add|Get)(System|NamedSystem|SubsystemByName|Joint|JointByName|ForceElement)\(.*) -> .*:/\1 -> Any:/' \
    -e '/__init__/!s/(\*args, \*\*kwargs\)) -> None/\1 -> Any/' \
    -e '/$(TEMPLATES)/s/ as [A-Za-z0-9_]+/: Any/g' \
    -e '/$(TEMPLATES)/s/, /; /g' \
    -e 's/$(TEMPLATES) //'

.venv/typings/made: .venv/installed-dev Makefile
	@drake=$$($(BIN)/python -c 'import pydrake; print(pydrake.__path__[0])') && \
	(cd "$$drake" && find . -name '*.pyi') | while read -r stub; do \
	    mkdir -p ".venv/typings/pydrake/$$(dirname "$$stub")" && \
	    LC_ALL=C sed -E $(FIX_STUBS) "$$drake/$$stub" >".venv/typings/pydrake/$$stub" || exit 1; \
	done
	@touch $@
