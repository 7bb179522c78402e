# make demo: set up, then plan over real terrain, export, fly, log, check, report
# make test: set up, then run the tests, but for the 9 % of tests/slow/cases.txt, which take three quarters of the time
# make slow: set up, then run those
# make lint: set up, then check style, types and the pages of docs/
# make dev: set up what a developer needs, and nothing more
PYTHON ?= python3
VENV := .venv
# Bytecode is kept, whatever the shell says: each of the tests' many processes would compile all it imports anew.
export PYTHONDONTWRITEBYTECODE :=
BIN := $(VENV)/bin
# Three processes test on two cores: threads of NumPy's linear algebra would stand in the other's way.
test slow low newest: export OPENBLAS_NUM_THREADS := 1
# A file's tests run in one of three processes, so that what they share is made once; files in their own order.  Three,
# since a tenth of the tests' time is waiting: for a port, a timeout, a process that ends.
SPREAD := -n 3 --dist loadfile --no-loadscope-reorder
# Temporary files of the tests: in memory where it has 4 GB of room, since some disks wait for each file that is removed.
IN_MEMORY := if [ "$$(df --output=avail /dev/shm 2>/dev/null | tail -n 1)" -gt 4000000 ] 2>/dev/null; then \
	TMPDIR=$$(mktemp -d /dev/shm/planfly-tests-XXXXXX) && export TMPDIR && \
	trap 'rm -rf "$$TMPDIR"' EXIT && trap 'exit 130' INT && trap 'exit 143' TERM; fi
# Rooms that need nothing but planfly itself, and some of its extras; the others test with clients, which have their own
# lower bounds.
LOW := tests/world tests/aircraft tests/planner tests/flight/mission tests/flight/mission_files tests/flight/dynamics \
	tests/flight/live tests/logs/recording tests/logs/verdict tests/planfly/campaigns/statistics \
	tests/planfly/campaigns/test_dispersions.py tests/planfly/campaigns/test_dispersions_draws.py
# What pyproject.toml names.
DIRECT := ^(cryptography|dask|distributed|foxglove-schemas-protobuf|foxglove-sdk|gpxpy|imageio-ffmpeg|jinja2|jsbsim|llvmlite|lz4|matplotlib|mcap|numba|numpy|pandas|pillow|$\
	platformdirs|protobuf|pyarrow|pydantic|pymavlink|pyproj|pyulog|rasterio|scipy|shapely|tqdm|zstandard)[ ]
# uv installs some five times as fast as pip; pip does it where uv cannot (a registry that pip alone is told of).
# Python compiles what is imported, and keeps it: nothing compiles the rest.
define INSTALL
	$(BIN)/python -m pip install --quiet --constraint constraints.txt uv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --constraint constraints.txt --build-constraints constraints.txt \
		--editable '.$(EXTRAS)' || \
		$(BIN)/python -m pip install --quiet --no-compile --constraint constraints.txt --editable '.$(EXTRAS)'
endef
EXTRAS :=
# What is installed: an environment that is made; planfly's base, which the demo takes; what the pages take, too; all
# extras and what the tests take, too.
MADE := $(VENV)/.made
READY := $(VENV)/.ready
PAGES := $(VENV)/.ready-docs
TESTED := $(VENV)/.ready-test
BUILD_PAGES := $(BIN)/python -m sphinx -W -q -b html -d build/docs-trees docs build/docs

# make low, make newest: the tests with the lowest versions supported, and with the newest there are
.PHONY: demo test slow lint bench soak wheels low newest dev docs tables setup clients clean

demo: setup
	$(BIN)/planfly run jacksboro --seed 1

# Kernels are compiled once, before the tests: each of pytest's processes would compile for itself.
test: CASES := not slow
slow: CASES := slow
test slow:
	@$(MAKE) --no-print-directory --jobs=2 $(TESTED) clients
	@$(BIN)/python -m tests.kernels >/dev/null; \
	echo "tested with the versions of constraints.txt:"; \
	{ $(BIN)/uv pip list --python $(BIN)/python || $(BIN)/python -m pip list; } 2>/dev/null | grep -i -E "$(DIRECT)"; \
	$(IN_MEMORY); $(BIN)/python -m pytest -m "$(CASES)" $(SPREAD)

# The tables of docs/ that the code knows, written into the pages.
tables: $(TESTED)
	cd docs && ../$(BIN)/python -m making

# What is seen without running anything: style, types, and the pages of docs/.
lint: $(TESTED)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BUILD_PAGES)

bench: $(TESTED)
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[test,bench]' || true
	$(BIN)/python -m benchmarks

# Full counts.  The figures of all tests go into build/soak.json; PLANFLY_SOAK_SHARE=0.1 takes a tenth of most.
# make soak GO_ON=1: go on with one that was stopped, of the same sources.
SOAKED := PLANFLY_SOAK=1 PLANFLY_SOAK_WHOLE=1
soak: $(TESTED) clients docs
	$(BIN)/python -m tests.kernels >/dev/null
	@$(SOAKED) $(BIN)/python -m tests.soak $(if $(GO_ON),--go-on)
# Pytest ends with 5 where every file has passed before.  What a command takes to end is measured with nothing beside it.
	$(SOAKED) $(BIN)/python -m pytest -m "soak and alone" -n 0 || test $$? = 5
	$(SOAKED) $(BIN)/python -m pytest -m "soak and not alone" $(SPREAD) || test $$? = 5
	$(BIN)/python -m tests.mutations --count 200 $(if $(GO_ON),--go-on)

# The wheel, installed anew and flown with on every Python that is there.
wheels: $(TESTED)
	PLANFLY_WHEELS=1 $(BIN)/python -m pytest -n0 tests/packaging -k installs

# The tests with the lowest versions that pyproject.toml allows, and with the newest that the registry has, each in an
# environment of its own.  The lowest numba needs Python 3.11 or 3.12: make low PYTHON=python3.11
LOWEST := --constraint constraints-low.txt
low: SET := $(LOWEST)
newest: SET := --upgrade
# Third-party clients are no part of these environments: what needs one is left out, under .ci/run too.
low newest: export PLANFLY_NEED_CLIENTS :=
low newest:
	$(PYTHON) -m venv build/$@
	build/$@/bin/python -m pip install --quiet $(SET) --editable '.[campaigns,forecast,grib,live,tables]' hypothesis pytest pytest-xdist trimesh
	@echo "tested with the $(if $(filter low,$@),lowest,newest) versions:"
	@build/$@/bin/python -m pip list 2>/dev/null | grep -i -E "$(DIRECT)"
	NUMBA_CACHE_DIR=$(CURDIR)/build/$@/kernels build/$@/bin/python -m pytest $(SPREAD) $(LOW)

dev: $(TESTED)

# The pages of docs/ as HTML, in build/docs; nothing is fetched while they are built, and every warning is an error.
docs: $(PAGES)
	$(BUILD_PAGES)

setup: $(READY)

$(MADE): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "planfly needs Python 3.11 or newer: make PYTHON=python3.11")'
	$(PYTHON) -m venv --clear $(VENV)
	touch $@

$(READY): $(MADE)
	$(INSTALL)
	touch $@

$(PAGES): EXTRAS := [docs]
$(PAGES): $(MADE)
	$(INSTALL)
	touch $(READY) $@

# The tests' own tools and clients, MAVSDK and MAVProxy among them, are far larger than planfly itself.
$(TESTED): EXTRAS := [test,docs]
$(TESTED): $(MADE)
	$(INSTALL)
	touch $(READY) $(PAGES) $@

# Other people's MCAP readers for Node and the judge of accessible pages, for the tests alone; without npm their tests say so.
clients: .node/.ready

.node/.ready: Makefile
	@if command -v npm >/dev/null; then \
	npm install --silent --no-audit --no-fund --no-package-lock --no-save --prefix .node @mcap/core@2.2.2 @mcap/support@1.1.0 \
	axe-core@4.14.1 \
	&& touch $@; else echo "npm is not installed: the tests with Node's MCAP reader and with axe will be skipped"; fi

clean:
	rm -rf $(VENV) .node runs build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
