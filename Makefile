# make demo        fit the example boom into build/demo
# make test        lint, types and the quick tests (under 10 minutes on 2 cores)
# make test-full   wheel in an empty environment, notebooks, the long tests (under 50 minutes)
# make hosts       the exported file in other simulators, each in an environment of its own; HOSTS="mjx warp" for more
# make bench       print the timings that README and CHANGELOG quote
# make bench-peers  the README's study beside Exudyn and Basilisk, in an environment of its own under build/peers
# make notebooks   run the notebooks in place, outputs kept small
# make docs-pictures  draw the pictures that README shows
# make wheel       build the distribution into dist/

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
WORKERS ?= 2

.PHONY: demo test test-full hosts bench bench-peers notebooks docs-pictures wheel wheel-test lint clean

$(VENV)/.installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,notebooks]'
	touch $@

demo: $(VENV)/.installed
	$(BIN)/beamchain fit generator/beamchain/examples/seed_boom.toml -o build/demo --force

lint: $(VENV)/.installed
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/basedpyright

test: lint
	$(BIN)/pytest -n $(WORKERS) -m "not slow and not host"

HOSTS ?= oldest newest dm_control basilisk

hosts:
	for host in $(HOSTS); do $(PYTHON) tests/hosts/run.py $$host || exit 1; done

test-full: $(VENV)/.installed wheel-test hosts
	$(BIN)/pytest -n $(WORKERS) -m "slow or host"

bench: $(VENV)/.installed
	$(BIN)/python tests/benchmarks/fit_time.py
	$(BIN)/python tests/benchmarks/sweep_time.py

bench-peers: $(VENV)/.installed
	$(PYTHON) -m venv build/peers/venv
	build/peers/venv/bin/python -m pip install --quiet --disable-pip-version-check '.[peers]'
	build/peers/venv/bin/beamchain study generator/beamchain/examples/seed_boom.toml -o build/peers/study --force
	build/peers/venv/bin/python -W ignore tests/benchmarks/peers/exudyn_peers.py build/peers/exudyn.json
	build/peers/venv/bin/python -W ignore tests/benchmarks/peers/basilisk_peer.py build/peers/basilisk.json
	build/peers/venv/bin/python tests/benchmarks/peers/compare.py build/peers/study/study.json build/peers/exudyn.json build/peers/basilisk.json

notebooks: $(VENV)/.installed
	$(BIN)/python notebooks/execute.py

docs-pictures: $(VENV)/.installed
	$(BIN)/python docs/pictures.py

wheel: $(VENV)/.installed
	rm -rf dist
	$(BIN)/python -m build --outdir dist .

# the wheel in an environment that has never seen the checkout, tested from outside it
wheel-test: wheel
	rm -rf build/wheel && mkdir -p build/wheel
	$(PYTHON) -m venv build/wheel/venv
	build/wheel/venv/bin/python -m pip install --quiet --disable-pip-version-check dist/*.whl pytest pytest-xdist hypothesis sympy nbclient nbformat ipykernel
	cp -r tests notebooks pyproject.toml build/wheel/
	cd build/wheel && venv/bin/pytest -n $(WORKERS) -m "not slow and not host"

clean:
	rm -rf build dist .pytest_cache .ruff_cache
