# make help lists what there is

PYTHON ?= python3
VENV := .venv
# tests and pages start many processes, which would compile the package again each time
export PYTHONDONTWRITEBYTECODE :=
BIN := $(VENV)/bin
WORKERS ?= 2
# a worker begins with tests that stand together, whose fixtures it makes once, and takes over others' at the end
PYTEST := pytest --timeout 900 -n $(WORKERS) --dist worksteal

.PHONY: help demo test tests quick mutants test-full hosts bench bench-peers notebooks docs docs-pictures wheel wheel-test wheel-newest lint clean fuzz extremes ledger test-kernels

PIP := $(BIN)/python -m pip install --quiet --disable-pip-version-check

# what a user installs, and then what the tests and notebooks need
$(VENV)/.package: pyproject.toml
	@echo "installing into $(VENV), which takes half a minute the first time"
	$(PYTHON) -m venv $(VENV)
	$(PIP) --editable .
	touch $@

$(VENV)/.installed: $(VENV)/.package
	@echo "installing what the tests need, another half a minute"
	$(PIP) --editable '.[dev,notebooks]'
	touch $@

help:
	@echo "make demo       fit a boom and film a satellite whose arrays bend, into build/demo"
	@echo "make quick      the brief tests, in one process: half a minute"
	@echo "make test       lint, types and the quick tests: three minutes"
	@echo "make test-full  the wheel in an empty environment, other simulators, notebooks, long tests: half an hour"
	@echo "make docs       the documentation into build/site"
	@echo "make bench      the timings that the documentation quotes; bench-peers: beside Exudyn and Basilisk"
	@echo "make hosts      the exported file in other simulators; HOSTS=\"mjx warp newton\" for more"
	@echo "make wheel      the distribution into dist/"
	@echo
	@echo "by hand: ledger (STORE=1, CRAFT=\"a b\"), mutants (SEED=1), test-kernels, fuzz (EXAMPLES=2000), extremes,"
	@echo "         notebooks, docs-pictures, wheel-newest, clean"

demo: $(VENV)/.package
	$(BIN)/python docs/demo.py build/demo

lint: $(VENV)/.installed
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/basedpyright

# the type checker, which has one thread, beside the tests; what each says stays together, and either failing fails both
test: $(VENV)/.installed
	@echo "lint and tests run side by side; what each says is shown when it ends"
	@$(MAKE) --jobs 2 --output-sync=recurse --no-print-directory lint tests

tests: $(VENV)/.installed
	$(BIN)/$(PYTEST) -m "not slow and not host"

quick: $(VENV)/.installed
	$(BIN)/pytest -m "not slow and not host" --brief

SEED ?= 1

mutants: $(VENV)/.installed
	$(BIN)/python tests/mutants.py --seed $(SEED) --workers $(WORKERS)

KERNELS ?= Nehalem Sandybridge Haswell SkylakeX
THREADS ?= 1 2

test-kernels: $(VENV)/.installed
	for kernel in $(KERNELS); do for threads in $(THREADS); do \
		echo "$$kernel, threads: $$threads"; \
		OPENBLAS_CORETYPE=$$kernel OPENBLAS_NUM_THREADS=$$threads $(MAKE) --no-print-directory tests || exit 1; \
	done; done

HOSTS ?= oldest newest dm_control basilisk nastran sections opensees cluster worlds

hosts:
	for host in $(HOSTS); do $(PYTHON) tests/hosts/run.py $$host || exit 1; done

# the notebooks have run with the wheel by then
test-full: $(VENV)/.docs wheel-test hosts
	$(BIN)/$(PYTEST) -m "slow or host" --ignore=tests/test_notebooks.py

bench: $(VENV)/.installed
	$(BIN)/python tests/benchmarks/fit_time.py
	$(BIN)/python tests/benchmarks/sweep_time.py
	$(BIN)/python tests/benchmarks/savings.py

bench-peers: $(VENV)/.installed
	$(PYTHON) -m venv build/peers/venv
	build/peers/venv/bin/python -m pip install --quiet --disable-pip-version-check '.[peers]'
	build/peers/venv/bin/beamchain study generator/beamchain/examples/seed_boom.toml -o build/peers/study --force
	build/peers/venv/bin/python -W ignore tests/benchmarks/peers/exudyn_peers.py build/peers/exudyn.json
	build/peers/venv/bin/python -W ignore tests/benchmarks/peers/basilisk_peer.py build/peers/basilisk.json
	build/peers/venv/bin/python tests/benchmarks/peers/compare.py build/peers/study/study.json build/peers/exudyn.json build/peers/basilisk.json
	build/peers/venv/bin/python -W ignore tests/benchmarks/peers/exudyn_arm.py build/peers/arm.json
	build/peers/venv/bin/python -W ignore tests/benchmarks/time_exact.py
	build/peers/venv/bin/python -W ignore tests/benchmarks/peers/cantilever.py

EXAMPLES ?= 2000
FUZZ_SECONDS ?= 60

fuzz: $(VENV)/.installed
	BEAMCHAIN_FUZZ=$(EXAMPLES) $(BIN)/pytest -n $(WORKERS) tests/cli/test_hostile.py tests/cli/test_hostile_numbers.py \
		tests/cli/test_hostile_words.py tests/craft/test_craft_promise.py tests/mjcf/test_bytes_kept.py
	$(BIN)/python -m pip install --quiet --disable-pip-version-check atheris || echo "atheris does not install here"
	for reader in spec print "modes, TOML" "modes, JSON" spacecraft profile; do \
		$(BIN)/python tests/support/fuzz.py "$$reader" $(FUZZ_SECONDS) || exit 1; done

extremes: $(VENV)/.installed
	PYTHONPATH=tests:tests/support $(BIN)/python -m extremes build/extremes

ledger: $(VENV)/.installed
	PYTHONPATH=tests/support $(BIN)/python tests/ledger/ledger.py --workers $(WORKERS) $(if $(STORE),--store) $(CRAFT)

notebooks: $(VENV)/.installed
	$(BIN)/python notebooks/execute.py

$(VENV)/.docs: $(VENV)/.installed
	$(PIP) --editable '.[docs]'
	touch $@

docs: $(VENV)/.docs
	$(BIN)/python -m sphinx -q -W --keep-going -d build/doctrees docs build/site

docs-pictures: $(VENV)/.installed
	PYTHONPATH=tests/support $(BIN)/python docs/pictures.py
	$(BIN)/python docs/house.py

wheel: $(VENV)/.installed
	rm -rf dist
	$(BIN)/python -m build --outdir dist .

IN_WHEEL := pytest pytest-timeout pytest-xdist hypothesis sympy gymnasium nbclient nbformat ipykernel ipywidgets basedpyright hatchling twine

# the wheel, built from the sdist, with its extra for bounds, in an environment that has never seen the checkout,
# tested from outside it: brief tests, notebooks, its contents, its types
wheel-test: wheel
	rm -rf build/wheel && mkdir -p build/wheel
	$(PYTHON) -m venv build/wheel/venv
	build/wheel/venv/bin/python -m pip install --quiet --disable-pip-version-check "$$(ls dist/*.whl)[robust,sysid]" $(IN_WHEEL)
	cp -r tests notebooks dist pyproject.toml build/wheel/
	cd build/wheel && venv/bin/$(PYTEST) -m "not slow and not host" --brief
	cd build/wheel && venv/bin/$(PYTEST) tests/test_notebooks.py tests/test_release.py

# the same wheel on the newest Python that is installed, on the PATH or by pyenv
NEWEST ?= $(shell { for v in 3.12 3.13 3.14 3.15; do python$$v -c 'import sys; print(sys.executable)'; done; \
  ls -d $${PYENV_ROOT:-$$HOME/.pyenv}/versions/3.1[2-9].*/bin/python; } 2>/dev/null | \
  while read p; do echo "$$($$p -c 'import platform; print(platform.python_version())') $$p"; done | \
  sort -V | tail -1 | cut -d' ' -f2)

wheel-newest: wheel
ifeq ($(NEWEST),)
	@echo "no Python newer than 3.11 is installed: skipped"
else
	rm -rf build/newest && mkdir -p build/newest
	$(NEWEST) -m venv build/newest/venv
	build/newest/venv/bin/python -m pip install --quiet --disable-pip-version-check "$$(ls dist/*.whl)[robust,sysid]" $(IN_WHEEL)
	cp -r tests notebooks dist pyproject.toml build/newest/
	cd build/newest && venv/bin/python --version && venv/bin/$(PYTEST) -m "not slow and not host"
endif

clean:
	rm -rf build dist .pytest_cache .ruff_cache
