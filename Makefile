# Irradiance Vector Grid. `make help` lists the targets.

# The Python to use: a version (3.13, 3.11) or a program; the newest found when not given.
PYTHON ?=
# The environment made with it.
VENV ?= .venv
# What `make extension` builds for: linux-x64, windows-x64, macos-arm64, all; this machine's when not given.
PLATFORM ?=
# What `make test` hands to pytest: files, folders, options; every test when not given.
TEST ?=
# Every test runs in several processes at once; a file's tests share scenes and stay together.
WORKERS := --numprocesses auto --maxprocesses 4 --dist loadfile

PY := $(VENV)/bin/python

.PHONY: help demo test lint format extension wheels lock clean debian debian-tests venv venv-dev
.NOTPARALLEL:

help:
	@echo 'make demo       bake a sample scene and compare it with Cycles: cornell.ivg.npz, cornell.png'
	@echo 'make test       what lint does, then the tests (TEST=tests/core/test_x.py for some)'
	@echo 'make lint       ruff, the import contracts, mypy'
	@echo 'make format     let ruff rewrite the code'
	@echo 'make extension  dist/irradiance_vector_grid-VERSION-PLATFORM.zip (PLATFORM=all for every platform)'
	@echo 'make wheels     fetch the wheels that the zip contains (PLATFORM as above)'
	@echo 'make lock       pin the requirements and the wheels anew after a change of requirements*.in'
	@echo 'make clean      remove what the targets above made'
	@echo 'PYTHON=3.11 or PYTHON=/path/to/python chooses the interpreter, VENV=folder the environment'

demo: debian venv
	$(PY) -m ivg_addon bake sample_blend/cornell.blend --out cornell.ivg.npz
	$(PY) -m ivg_addon compare sample_blend/cornell.blend cornell.ivg.npz --out cornell.png

test: debian debian-tests lint
	$(PY) -m pytest $(if $(TEST),$(TEST),$(WORKERS))

lint: venv-dev
	$(PY) -m ruff check
	$(PY) -m ruff format --check
	PYTHONPATH=$(VENV)/link $(VENV)/bin/lint-imports --no-logo
	@if [ -d $(VENV)/lib/python3.11 ]; then \
		echo 'mypy: skipped, numpy 1 (Python 3.11) types its functions too coarsely for it'; \
	else \
		MYPYPATH=$(VENV)/link $(PY) -m mypy -p irradiance_vector_grid.ivg_addon -p irradiance_vector_grid.operators -p scripts; \
	fi

format: venv-dev
	$(PY) -m ruff check --fix
	$(PY) -m ruff format

extension: venv
	$(PY) -m scripts.build_extension $(if $(PLATFORM),--platform $(PLATFORM))

wheels: venv
	$(PY) -m scripts.fetch_wheels $(PLATFORM)

lock: venv-dev
	$(PY) -m pip --disable-pip-version-check install --quiet uv
	for name in requirements requirements-dev; do \
		$(PY) -m uv pip compile --quiet --upgrade --universal --python-version 3.11 --generate-hashes \
			--custom-compile-command "make lock" $$name.in --output-file $$name.txt || exit 1; \
	done
	$(PY) -m scripts.lock_wheels

clean:
	rm -rf .venv* dist wheels cornell.ivg.npz cornell.png cornell.exr .mypy_cache .ruff_cache .pytest_cache .import_linter_cache

debian:
	@scripts/install_debian.sh

# OpenVDB's own reader, against which tests hold the OpenVDB files; they are skipped without.
debian-tests:
	@scripts/install_debian.sh python3-openvdb

venv:
	@scripts/make_venv.sh "$(VENV)" "$(PYTHON)" requirements.txt

venv-dev:
	@scripts/make_venv.sh "$(VENV)" "$(PYTHON)" requirements.txt requirements-dev.txt
