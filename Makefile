# utank-hil: `make bench` sets up and runs the main job, `make test` sets up and passes the tests.
VENV := .venv
PYTHON := python3
READY := $(VENV)/.ready
# of 12,500 files most are never imported: those that are, are compiled then
PIP := $(VENV)/bin/python -m pip install --quiet --disable-pip-version-check --no-compile
# a worker on each core and one more, as some tests wait; one that has nothing left takes half of
# what another still has
PARALLEL := $(VENV)/bin/pytest -n $(shell expr $$(nproc) + 1) --dist worksteal
# extras stay in the lock: pip, as Debian has it, would take the newest release for them and refuse it
COMPILE := $(VENV)/bin/uv pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	--no-header --no-annotate --no-emit-index-url --no-strip-extras

# the matrices here are small: threads of the linear-algebra library only get in each other's way
export OPENBLAS_NUM_THREADS := 1
# bytecode that is not kept is compiled anew by each of the hundreds of processes that tests start
unexport PYTHONDONTWRITEBYTECODE

# kernels of numpy, OpenBLAS and glibc as on a processor without fused products
OLDER := NPY_DISABLE_CPU_FEATURES="X86_V3 X86_V4 AVX512_ICL AVX512_SPR" OPENBLAS_CORETYPE=Nehalem GLIBC_TUNABLES=glibc.cpu.hwcaps=-AVX2,-FMA,-AVX2_Usable,-FMA_Usable

.PHONY: help setup compiled bench test test-bus test-host test-older test-fast test-all mutants coverage evidence thesis search check format benchmark site sbom wheel docs lock clean

help:
	@echo "make setup      virtual environment with everything pinned in requirements.lock; of another"
	@echo "                interpreter: make setup PYTHON=python3.13"
	@echo "make bench      the main job: a controller quiets a rolling ship, table, picture, recording"
	@echo "make test       lint, types and the tests, those on a real CAN bus included: eight to 13 minutes"
	@echo "make test-fast  the quick tests, without CAN: three minutes"
	@echo "make test-all   'make test', then the tests that take minutes each, and ten million damaged"
	@echo "                files: three hours; UTANK_HIL_MUTATIONS is another number of files"
	@echo "make mutants    the tests of the safety code against every small change of it: hours"
	@echo "make coverage   lines and branches of the safety code that no test of it runs"
	@echo "make compiled   simulations in 0.4 of the time, until the source changes; 'make bench' does it,"
	@echo "                too: a minute of processor time, with gcc and python3-dev"
	@echo "make evidence   for a release: the measurements in docs/evidence that it has not, a day;"
	@echo "                $(VENV)/bin/python -m tools.evidence --list shows them"
	@echo "make thesis     figures and printed numbers of the source thesis made anew, out/thesis: four minutes"
	@echo "make search     the property tests with new random examples, until one fails or they end"
	@echo "make check      lint, format, strict types, layers of the packages, generated documents"
	@echo "make benchmark  speed, as ratios to something else in the same run"
	@echo "make site       the documentation as web pages, out/site"
	@echo "make sbom       the list of parts of a deployed controller, out/sbom.json"
	@echo "make wheel      the package for a ship's PC and the lock of what it needs there, dist/"
	@echo "make docs       write the generated documents anew"
	@echo "make lock       resolve the dependencies again"
	@echo "make clean      remove everything that can be made again"

setup: $(READY)

$(READY): requirements.lock pyproject.toml
	@command -v $(PYTHON) >/dev/null || { echo "$(PYTHON) is missing: apt-get install python3 python3-venv" >&2; exit 1; }
	@$(PYTHON) -c 'import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "$(PYTHON): 3.11 or newer with venv is needed: apt-get install python3 python3-venv" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(PIP) --require-hashes -r requirements.lock
	$(PIP) --no-deps --no-build-isolation -e .
	@touch $@

bench: compiled
	$(VENV)/bin/utank-hil bench

# plain Python runs where this fails
compiled: setup
	-@$(VENV)/bin/python -m tools.compiled

check: setup
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/lint-imports --no-logo
	$(VENV)/bin/python -m tools.documents.write --check

# the bus needs a core of its own: what runs beside it gives way to its processes
test: setup
	$(MAKE) --no-print-directory --jobs=2 test-bus check site test-host test-older

# what it says comes in one piece, at its end
test-bus: setup
	@mkdir -p .cache
	@tools/vcan $(VENV)/bin/pytest -m "socketcan and not evidence" tests/socketcan >.cache/bus.txt 2>&1; \
		code=$$?; echo; cat .cache/bus.txt; exit $$code

test-host: setup
	nice -n 19 $(PARALLEL) -m "not socketcan and not evidence"

test-older: setup
	$(OLDER) $(VENV)/bin/pytest -m "not evidence" tests/replay tests/base/test_elementary.py tests/base/test_ordered_sums.py

test-fast: setup
	$(PARALLEL) -m "not socketcan and not slow and not evidence" --hypothesis-profile=few

test-all: test
	$(PARALLEL) -m "evidence and not socketcan"
	tools/vcan $(VENV)/bin/pytest -m evidence tests/socketcan --ignore=tests/socketcan/test_service.py
	tools/vcan --uml $(VENV)/bin/pytest -m evidence tests/socketcan/test_service.py

evidence: setup
	$(VENV)/bin/python -m tools.evidence

thesis: setup
	$(VENV)/bin/python -m tools.thesis

# of which tests those are, [tool.mutmut] says; `mutmut show NAME` prints a mutant that lives
mutants: setup
	$(VENV)/bin/mutmut run >&2
	$(VENV)/bin/mutmut results

SAFETY := utank_hil/safety utank_hil/nodes utank_hil/control utank_hil/canbus
coverage: setup
	$(PARALLEL) -m "not socketcan and not evidence" $(addprefix --cov=,$(SAFETY)) --cov-branch \
		--cov-report=term-missing:skip-covered tests/safety tests/nodes tests/canbus tests/control

# in `make test` they draw the same examples each time
search: setup
	$(PARALLEL) -m "not socketcan and not evidence" --hypothesis-profile search $(shell grep -rl "from hypothesis" tests)

format: setup
	$(VENV)/bin/ruff check --fix .
	$(VENV)/bin/ruff format .

benchmark: setup
	@for name in $(basename $(notdir $(wildcard tools/benchmarks/*.py))); do \
		echo; echo "== $$name"; $(VENV)/bin/python -m tools.benchmarks.$$name || exit 1; done

# the site of README, docs/ and docstrings; a link that leads nowhere is an error
site: setup
	$(VENV)/bin/sphinx-build -q -W --keep-going -d .cache/site -c docs . out/site
	@echo "out/site/docs/index.html"

# the parts of an installation without extras
sbom: setup
	@mkdir -p out
	$(VENV)/bin/python -m tools.sbom > out/sbom.json
	@echo "out/sbom.json"

# for a ship's PC, with the lock of what runs there
wheel: setup
	$(VENV)/bin/python -m pip wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation -w dist .
	$(VENV)/bin/python -m tools.sbom --extra viewer --lock > dist/requirements.txt
	$(VENV)/bin/python -m tools.sbom --extra bench --lock > dist/requirements-bench.txt
	@ls dist/*

docs: setup
	$(VENV)/bin/python -m tools.documents.write

lock: setup
	$(COMPILE) --extra dev pyproject.toml -o requirements.lock

clean:
	rm -rf $(VENV) .cache build dist out .mypy_cache .ruff_cache .pytest_cache .hypothesis mutants *.egg-info
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
