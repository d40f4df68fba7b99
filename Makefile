# The folder .venv is remade by a change of pyproject.toml; its stamps say what was installed into it.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
BASE   := $(VENV)/base.stamp
DEV    := $(VENV)/dev.stamp

# Recorded runs that are too large for the repository; tests that need them are skipped without it.
ifneq ($(wildcard ../shared),)
export CARE_SHARED ?= $(abspath ../shared)
endif

.PHONY: demo test long sweep check bench docs profiles screenshots man walk fuzz mutate damage kills matrix offline dist sbom clean

demo: $(BASE)
	@$(BIN)/care demo; code=$$?; if [ $$code -ne 1 ]; then echo "care demo ended with $$code, not with 1 (fault found)" >&2; exit 1; fi

# What is compiled once serves every process that a test starts, also where the environment asks to keep nothing.
test long sweep: export PYTHONDONTWRITEBYTECODE :=

test: $(DEV)
	$(BIN)/pytest -n 3 --dist worksteal -m "not long"

# What goes through every document, every hostile file and every key, and through what is recorded.
long: $(DEV)
	$(BIN)/pytest -n 3 --dist worksteal -m long

# The same with everything that the tests take a sample of, and with new examples of what must hold for any.
sweep: $(DEV)
	CARE_WHOLE=1 CARE_DAMAGE=200 CARE_KILLS=200 $(BIN)/pytest -n 3 --dist worksteal --hypothesis-profile=sweep

check: $(DEV)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# All benchmarks, with what each needs of CARE_SHARED and TABLES (tables of runs), into benchmarks/RESULTS.md.
bench: $(DEV)
	$(BIN)/python -m benchmarks.results $(if $(TABLES),--tables $(TABLES)) $(foreach name,$(ONLY),--only $(name))

docs: $(BASE)
	$(BIN)/python -m care_core.report.extractors docs/extractors.md
	$(BIN)/python -m care_core.report.checks docs/checks.md
	$(BIN)/python -m care_core.report.estimates docs/estimates.md
	$(BIN)/python -m benchmarks.tools.documents

profiles: $(DEV)
	$(BIN)/python -m benchmarks.tools.train_profiles

screenshots: $(BASE)
	$(BIN)/python -m benchmarks.tools.screenshots

# The manual page, from the help of the commands.
man: $(BASE)
	$(BIN)/python -m care_tui.manual docs/care.1

walk: $(BASE)
	$(BIN)/python -m benchmarks.tools.walk

fuzz: $(DEV)
	$(BIN)/python -m benchmarks.tools.fuzzing --seconds 60

# Logs of yours taken apart by their format and put together wrong: make mutate LOGS="a.BIN b.bag".
mutate: $(DEV)
	$(BIN)/python -m benchmarks.tools.mutating $(LOGS)

# Each format cut at 200 places and with 200 flipped bits; the tests do with 25.
damage: $(DEV)
	CARE_DAMAGE=200 $(BIN)/pytest -q tests/integration/test_damage.py

kills: $(DEV)
	CARE_KILLS=200 $(BIN)/pytest -q tests/integration/test_kills.py

matrix:
	$(PYTHON) -m benchmarks.tools.matrix

# The wheel and the source archive, as a package index takes them.
dist: $(DEV)
	$(BIN)/python -m build --outdir dist .
	$(BIN)/twine check --strict dist/*.whl dist/*.tar.gz

# An archive for each Python and machine that installs without a network: make offline PYTHONS=3.12 MACHINES=aarch64.
offline: $(BASE)
	$(BIN)/python -m benchmarks.tools.offline $(if $(PYTHONS),--python $(PYTHONS)) $(if $(MACHINES),--machine $(MACHINES)) $(if $(EXTRAS),--extras $(EXTRAS))

# What a base installation holds, by name, version and license: build/sbom.json (CycloneDX).
sbom:
	rm -rf build/sbom && $(PYTHON) -m venv build/sbom && $(PYTHON) -m venv build/sbom-tool
	build/sbom/bin/python -m pip install --quiet --disable-pip-version-check .
	build/sbom-tool/bin/python -m pip install --quiet --disable-pip-version-check 'cyclonedx-bom>=4'
	build/sbom-tool/bin/cyclonedx-py environment --output-reproducible --pyproject pyproject.toml -o build/sbom.json build/sbom/bin/python

clean:
	rm -rf $(VENV) build dist .mypy_cache .pytest_cache .ruff_cache .hypothesis .import_linter_cache

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(BASE): pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(DEV): pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@ $(BASE)
