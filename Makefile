# Every command a person needs; `make help` lists them. Two do everything on a fresh machine: `make run` and `make test`.
#
#   PYTHON    interpreter that makes the virtual environment (3.11 or newer)        default python3
#   CC        C compiler; without one on the machine, zig from PyPI is fetched      default cc, gcc or clang
#   ZIG       zig's C compiler for `make fmus-all` and `make test-platforms`         default from PyPI, into .venv
#   RESULTS   where `make run` leaves its results                                    default results

PYTHON  ?= python3
RESULTS ?= results
BUILD   ?= build
VENV    := .venv
PY      := $(VENV)/bin/python
PIP     := $(PY) -m pip --disable-pip-version-check --quiet

UNITS   := plant controller friction friction_gms setpoint machine
FMUS    := $(UNITS:%=fmus/%.fmu)
SCENARIOS := z_positioning xz_circle

# make's own default for CC is not a compiler that must exist.
ifeq ($(origin CC),default)
CC := $(firstword $(foreach name,cc gcc clang,$(if $(shell command -v $(name) 2>/dev/null),$(name))))
endif
ifeq ($(strip $(CC)),)
CC := "$(CURDIR)/$(PY)" -m ziglang cc
COMPILER := $(VENV)/.compiler
endif
export CC
ZIG ?= "$(CURDIR)/$(PY)" -m ziglang cc
ZIG_HERE := $(if $(filter file,$(origin ZIG)),$(VENV)/.compiler)
# Small matrices by the thousand: threads for linear algebra only wait for one another.
export OPENBLAS_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.SUFFIXES:
MAKEFLAGS += --no-builtin-rules
.PHONY: help run axe ends check test test-all test-c test-python test-processors test-importers fuzz test-sanitize test-sanitize-scenario test-valgrind test-platforms fmus fmus-all wasm-compiler page-module release lint format schemas reference check-reference bench bench-release worst-case docs docs-test pictures pose-study identification-study drive-study friction-laws circle-study compensation-study band-coverage identification-accuracy lock ansys clean

help: ## list the commands
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-22s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

# --- environment ---------------------------------------------------------------------------------------------------

$(VENV)/.created:
	$(PYTHON) -c 'import sys; sys.exit("Python 3.11 or newer is needed, this is " + sys.version.split()[0] if sys.version_info < (3, 11) else 0)'
	$(PYTHON) -m venv $(VENV)
	@touch $@

$(VENV)/.run: $(VENV)/.created requirements.lock pyproject.toml
	@echo "installing the locked packages (requirements.lock)"
	$(PIP) install -r requirements.lock
	@# setuptools warns of what holds for every installation that is linked to its sources
	PYTHONWARNINGS=ignore::UserWarning $(PIP) install --no-build-isolation --no-deps -e .
	@touch $@

$(VENV)/.dev: $(VENV)/.run requirements-dev.lock
	@echo "installing the locked development packages (requirements-dev.lock)"
	$(PIP) install -r requirements-dev.lock
	@touch $@

# Not every platform has a wheel of each of them: tests of what is missing are skipped, with the reason. Tried once.
$(VENV)/.importers: $(VENV)/.dev requirements-importers.lock
	@echo "installing other simulators to try the units in (requirements-importers.lock)"
	@$(PIP) install -r requirements-importers.lock || echo "they cannot all be installed here: tests of what is missing are left out"
	@touch $@

$(VENV)/.compiler: $(VENV)/.run requirements-zig.lock
	@echo "installing zig from PyPI, a C compiler for every platform (requirements-zig.lock)"
	$(PIP) install -r requirements-zig.lock
	@touch $@

$(VENV)/.ansys: $(VENV)/.run requirements-ansys.lock
	@echo "installing the reader of ANSYS files (requirements-ansys.lock)"
	$(PIP) install --no-deps -r requirements-ansys.lock
	@touch $@

ansys: $(VENV)/.ansys ## install the optional reader of ANSYS .full files

# --- the units -----------------------------------------------------------------------------------------------------

fmus: $(FMUS) ## build the six FMUs, the native cycle loop and the path planner into fmus/

PACKAGER := $(wildcard src/packager/feedsim_packager/*.py src/fmi2/terminals/*)
SHELL_SOURCES := $(wildcard src/fmi2/*.[ch] src/fmi2/standard/*.h)

fmus/%.fmu: $(VENV)/.run $(COMPILER) $(PACKAGER) $(SHELL_SOURCES) pyproject.toml LICENSE
	$(PY) -m feedsim_packager build $* --out $@ --build-dir $(BUILD)/fmus

# What the master knows of the units' variables.
VARIABLES := master/feedsim/foundation/variables.json
fmus: $(VARIABLES)
$(VARIABLES): $(VENV)/.run $(COMPILER) $(PACKAGER) src/fmi2/table.h src/machine_fmu/cycle.h $(foreach unit,$(UNITS),$(wildcard src/$(unit)_fmu/*.def src/$(unit)_fmu/identity.h))
	$(PY) -m feedsim_packager variables --out $@

# The native cycle loop and the path planner lie beside the archives.
LIBRARY := $(if $(filter Windows_NT,$(OS)),.dll,$(if $(filter Darwin,$(shell uname -s)),.dylib,$(if $(filter aarch64,$(shell uname -m)),-aarch64).so))
LIBRARIES := exchange$(LIBRARY) planner$(LIBRARY)

fmus: $(LIBRARIES:%=fmus/%)
fmus/%$(LIBRARY): $(VENV)/.run $(COMPILER) $(addprefix src/packager/feedsim_packager/,native.py checkout.py compile.py toolchain.py)
	$(PY) -m feedsim_packager $* --out $(@D)
fmus/exchange$(LIBRARY): $(wildcard src/exchange/*.[ch])
fmus/planner$(LIBRARY): $(wildcard src/planner/*.[ch])

fmus/friction.fmu: $(wildcard src/friction_fmu/*.*)
# It has the torque over speed and the functions over whole records of friction.
fmus/friction_gms.fmu $(BUILD)/fmus-all/friction_gms.fmu: $(wildcard src/friction_gms_fmu/*.* src/friction_fmu/*.*)
fmus/controller.fmu: $(wildcard src/controller_fmu/*.*)
fmus/setpoint.fmu: $(wildcard src/setpoint_fmu/*.* src/setpoint_fmu/resources/*)
fmus/plant.fmu: $(wildcard src/plant_fmu/*.* src/plant_fmu/resources/*) scenarios/machines/test_centre/modes.csv
# Its parts are the other units.
MACHINE_SOURCES := $(foreach unit,$(UNITS),$(wildcard src/$(unit)_fmu/*.* src/$(unit)_fmu/resources/*)) scenarios/machines/test_centre/modes.csv
fmus/machine.fmu: $(MACHINE_SOURCES)
# Built aside and copied into fmus/ last: `make fmus` leaves them there while they are newer than their sources, and
# builds for this machine alone when they are not; `make fmus-all` puts those of all platforms back.
ALL_FMUS := $(UNITS:%=$(BUILD)/fmus-all/%.fmu)

fmus-all: $(ALL_FMUS) ## build the FMUs for Linux, Windows and macOS into fmus/, with zig (minutes at the first time)
	@set -e; mkdir -p fmus; for built in $(ALL_FMUS); do fmu=fmus/$${built##*/}; \
	    if [ $$built -nt $$fmu ] || ! cmp -s $$built $$fmu; then cp $$built $$fmu.part && mv $$fmu.part $$fmu; fi; echo "$$fmu holds all platforms"; done

$(BUILD)/fmus-all/%.fmu: $(VENV)/.run $(ZIG_HERE) $(PACKAGER) $(SHELL_SOURCES) pyproject.toml LICENSE
	$(PY) -m feedsim_packager build $* --platforms all --cc '$(ZIG)' --out $@ --build-dir $(BUILD)/fmus-all

$(foreach unit,$(UNITS),$(eval $(BUILD)/fmus-all/$(unit).fmu: $(wildcard src/$(unit)_fmu/*.* src/$(unit)_fmu/resources/*)))
$(BUILD)/fmus-all/machine.fmu: $(MACHINE_SOURCES)
$(BUILD)/fmus-all/plant.fmu: scenarios/machines/test_centre/modes.csv

# The unit machine for pages: clang with wasi-libc where they are there, else zig from PyPI.
page-module: fmus/machine.wasm ## build the machine as WebAssembly for feedsim export, with clang or zig

fmus/machine.wasm: $(VENV)/.run $(COMPILER) $(PACKAGER) $(SHELL_SOURCES) $(MACHINE_SOURCES) $(wildcard src/page/*.c) | wasm-compiler
	$(PY) -m feedsim_packager web --out $@

# Fails where there is none to be had. That alone leaves out pages: sources which do not compile end `make run` and `make test`.
wasm-compiler: $(VENV)/.run
	@$(PY) -c 'from feedsim_packager import web; web.find_compiler()' 2> /dev/null || { \
	    echo "installing zig from PyPI (requirements-zig.lock)"; $(PIP) install -r requirements-zig.lock; }

# Archives carry the reference results of their unit.
$(FMUS) $(ALL_FMUS): tests/reference/integrators.md
$(foreach unit,$(UNITS),$(eval fmus/$(unit).fmu $(BUILD)/fmus-all/$(unit).fmu: \
    $(wildcard tests/reference/$(unit)/*.* tests/reference/$(unit)/held/*.*)))

# Made anew they are the same, byte for byte.
DIST := dist
release: docs $(ALL_FMUS) $(VENV)/.run $(ZIG_HERE) ## wheel, source archive, archives in one file, bill of materials and sums, into dist/
	$(if $(SLOWER),@echo "slower, and why: $(SLOWER)",$(PY) benchmarks/release.py --check)
	PYTHONPATH=src/distribution $(PY) -m feedsim_distribution.release --archives $(BUILD)/fmus-all --site $(BUILD)/site --out $(DIST)

# --- run -----------------------------------------------------------------------------------------------------------

run: fmus $(VENV)/.run ## build, run both scenarios, leave results, figures and reports in results/
	@set -e; if $(MAKE) -s wasm-compiler; then $(MAKE) -s page-module; page=--page; \
	else echo "no compiler for WebAssembly here: no pages"; fi; \
	for scenario in $(SCENARIOS); do \
	    $(VENV)/bin/feedsim run scenarios/$$scenario.yaml $$page --out $(RESULTS)/$$scenario; done
	@echo "open $(RESULTS)/*/report.html"

# --- test ----------------------------------------------------------------------------------------------------------

-include tests/unit_c/tests.mk

# Enough to see at once that nothing is broken: layers, public functions and commands, motions, the units in C, and one
# scenario up to its report.
CHECKED := tests/test_layers.py tests/cli/test_jobs_and_options.py tests/motions tests/report/test_formatting.py
check: fmus $(VENV)/.dev ## the quick set, below two minutes: layers, units of C, one scenario, one report
	@$(MAKE) -s test-c
	$(PY) -m pytest -q $(CHECKED)
	$(VENV)/bin/feedsim run scenarios/z_positioning.yaml --out $(BUILD)/check --quiet
	@test -s $(BUILD)/check/report.html && echo "$(BUILD)/check/report.html is there"

test: fmus $(VENV)/.importers ## C tests, sanitisers, leak check, Python tests but those for test-all
	@$(MAKE) -s -j2 $(if $(filter output-sync,$(.FEATURES)),--output-sync) test-c test-sanitize test-sanitize-scenario test-valgrind
	@$(MAKE) -s test-python

# What does not fit beside every change: many draws, pairs of everything with everything, other processors' arithmetic.
test-all: ## test, the tests marked extensive or statistics, other processors' arithmetic: what a release needs (an hour)
	@$(MAKE) -s test CHOSEN=
	@$(MAKE) -s test-processors

# One scenario on units built with AddressSanitizer and UndefinedBehaviorSanitizer. Python itself is not built with them, so their
# runtime is loaded ahead of it, and leaks (Python's own included) are left to test-valgrind.
ASAN_RUNTIME = $(shell $(CC) -print-file-name=libasan.so 2>/dev/null | grep /)
SANITIZED := $(BUILD)/sanitized-fmus

$(SANITIZED)/%.fmu: fmus/%.fmu
	FEEDSIM_CFLAGS="-fsanitize=address,undefined -fno-sanitize-recover=all -g" $(PY) -m feedsim_packager build $* --out $@ --build-dir $(SANITIZED)

$(SANITIZED)/%$(LIBRARY): fmus/%$(LIBRARY)
	FEEDSIM_CFLAGS="-fsanitize=address,undefined -fno-sanitize-recover=all -g" $(PY) -m feedsim_packager $* --out $(@D)

test-sanitize-scenario: $(VARIABLES) $(if $(ASAN_RUNTIME),$(UNITS:%=$(SANITIZED)/%.fmu) $(LIBRARIES:%=$(SANITIZED)/%)) ## a scenario on units with sanitisers
	@if [ -z "$(ASAN_RUNTIME)" ]; then echo "the compiler has no AddressSanitizer runtime: scenario under sanitisers left out"; else \
	    LD_PRELOAD=$(ASAN_RUNTIME) ASAN_OPTIONS=detect_leaks=0 FEEDSIM_FMUS=$(SANITIZED) \
	    $(PY) -c 'import feedsim, sys; result = feedsim.run(feedsim.load_scenario(sys.argv[1])); print(sys.argv[1], "under sanitisers: clean,", len(result.trace), "rows")' \
	    scenarios/z_positioning.yaml; fi

# A file of tests stays together on one core: its fixtures are made once. Programs that packages bring (cmake) are found.
# What tests start by the hundred finds feedsim compiled, even where the shell lets Python write no bytecode.
CHOSEN := -m 'not extensive and not statistics'
test-python: fmus $(VENV)/.importers
	@set -e; if $(MAKE) -s wasm-compiler; then $(MAKE) -s page-module; \
	else echo "no compiler for WebAssembly here: tests of pages are left out"; fi
	PYTHONDONTWRITEBYTECODE= PATH="$(CURDIR)/$(VENV)/bin:$$PATH" $(PY) -m pytest -n auto --dist loadfile --durations=40 --durations-min=5 $(CHOSEN)

# Calls of the units made of bytes, and what reads files with files that are changed at random (ARGS="--seconds 3600 --seed 7").
fuzz: fmus $(VENV)/.importers ## bytes as calls of the units, changed files into every reader (ARGS="--seconds N --seed S")
	$(PY) tests/fuzz/units.py $(ARGS)
	PYTHONPATH=tests $(PY) -m fuzz.readers $(ARGS)

ends: fmus $(VENV)/.dev ## SIGTERM at random instants to commands on one core: nothing is left behind (ARGS="--count N --seed S")
	PYTHONPATH=tests $(PY) tests/cli/ends.py $(ARGS)

test-processors: fmus $(VENV)/.dev ## references, physics, identification as other processors round (ARGS=--all: all of them)
	$(PY) tests/processors/run.py $(ARGS)

test-platforms: $(ALL_FMUS) $(VARIABLES) $(VENV)/.dev ## the FMUs of all platforms: Windows under Wine, ARM under qemu, files for macOS
	ZIG='$(ZIG)' FEEDSIM_PLATFORM_FMUS=$(BUILD)/fmus-all $(PY) -m pytest -s tests/platforms

# axe-core, of the version and with the sums that tests/axe/package-lock.json has.
AXE := $(BUILD)/axe/node_modules/axe-core/axe.min.js
axe: $(AXE) ## fetch axe-core by npm, which tests reports and pages for accessibility (FEEDSIM_AXE names it)
$(AXE): $(wildcard tests/axe/*.json)
	mkdir -p $(BUILD)/axe
	cp $^ $(BUILD)/axe
	cd $(BUILD)/axe && npm ci --silent --ignore-scripts --no-audit --no-fund
	touch $@

# Other people's simulators and validators. What cannot be installed is skipped; the summary at the end says what and why.
# Java and Maven are the machine's: nothing is installed outside this folder here (CONTRIBUTING.md says how).
test-importers: fmus $(VENV)/.importers ## the units in other simulators, three validators (Java, Maven, cargo: CONTRIBUTING)
	$(PY) tests/importers/install.py --rust $(BUILD)/importers
	FEEDSIM_IMPORTERS=$(BUILD)/importers $(PY) -m pytest tests/importers

schemas: $(VENV)/.run $(VARIABLES) ## write the JSON Schemas of scenarios/schemas anew, for editors
	@set -e; for file in scenarios/schemas/*.schema.json; do \
	    kind=$${file##*/}; $(VENV)/bin/feedsim tools schema $${kind%%.*} > $(BUILD)/schema.json; mv $(BUILD)/schema.json $$file; done

reference: $(VENV)/.dev $(VARIABLES) ## make the pinned reference CSVs anew, from scipy and the monolithic implementation
	$(PY) tests/reference/make_reference.py

check-reference: fmus $(VENV)/.run ## compare all units and both scenarios, wired and as one unit, with the pinned reference CSVs
	$(PY) tests/reference/check_reference.py --junit $(BUILD)/check-reference.xml

bench: fmus $(VENV)/.importers ## measure everything, other simulators too; writes docs/benchmarks and the pages' figures (half an hour)
	$(PY) benchmarks/all.py --images docs/images
	$(PY) benchmarks/page.py

# What a release is refused for: a command that is slower by 3 % beyond the quartiles, or figures of another commit.
bench-release: fmus $(VENV)/.importers ## commands in pairs with those of another version: AGAINST=TAG (twenty minutes)
	$(PY) benchmarks/release.py --against $(AGAINST)

worst-case: fmus $(VENV)/.run ## worst-case time of a unit's doStep, for real-time targets
	$(PY) benchmarks/worst_case.py

docs: fmus $(VENV)/.dev ## build the documentation as a site that opens from disk, into build/site
	rm -rf $(BUILD)/site
	@if $(MAKE) -s wasm-compiler; then $(MAKE) -s page-module; else echo "no compiler for WebAssembly here: a picture in place of the machine"; fi
	$(PY) docs/site/stage.py $(BUILD)/site-source
	$(PY) -m sphinx -q -W --keep-going -b html -c docs/site -d $(BUILD)/site-trees $(BUILD)/site-source $(BUILD)/site
	@echo "open $(BUILD)/site/index.html"

docs-test: fmus $(VENV)/.dev ## execute every command of the pages and compare what they print (ten minutes)
	$(PY) docs/site/commands.py

pictures: fmus $(VENV)/.run ## draw README's and docs' pictures anew (docs/images; ARGS=--all: that of the large study too)
	$(PY) docs/pictures.py $(ARGS)
	$(PY) docs/diagrams.py

causes: fmus $(VENV)/.run ## put causes into the machine, diagnose its circles, write docs/trust.md and its picture (minutes)
	$(PY) docs/causes.py

pose-study: fmus $(VENV)/.run ## how a grid of poses converges, against the full model (some minutes; docs/position-dependence.md)
	$(PY) benchmarks/pose_grid.py

identification-study: fmus $(VENV)/.run ## whether intervals hold the truth: 320 logs of known axes, good and flawed (half an hour; docs/trust.md)
	$(PY) benchmarks/identification_study.py

drive-study: fmus $(VENV)/.run ## whether intervals of drives hold the truth, by kind of log: 20 logs of each of twenty (an hour of one core; docs/trust.md)
	$(PY) benchmarks/drive_study.py

circle-study: fmus $(VENV)/.run ## whether causes come out of circles that no rule was set on (a minute; ARGS='--seed 7': others; docs/trust.md)
	$(PY) benchmarks/circle_study.py $(ARGS)

compensation-study: fmus $(VENV)/.run ## what friction compensations take off on three machines (some five minutes; docs/trust.md)
	$(PY) benchmarks/compensation_study.py

band-coverage: fmus $(VENV)/.run ## whether bands from sets identified at 5 % noise hold the truth (some ten minutes; docs/trust.md)
	$(PY) benchmarks/coverage.py

friction-laws: fmus $(VENV)/.run ## compare Coulomb, Stribeck, LuGre and Maxwell slip in and out of sample (two minutes; ARGS='--intervals 60': whether intervals of Maxwell slip hold; docs/trust.md)
	$(PY) benchmarks/friction_laws.py --write $(ARGS)

identification-accuracy: fmus $(VENV)/.run ## how accurate parameters from good logs are, Monte Carlo (some ten minutes; docs/trust.md)
	$(PY) benchmarks/identification.py

# --- keep ----------------------------------------------------------------------------------------------------------

C_FILES := $(foreach folder,src/fmi2 src/exchange src/planner src/page $(UNITS:%=src/%_fmu) tests/unit_c tests/unit_c/toy_unit tests/fuzz tests/platforms \
    tests/reference/monolithic benchmarks benchmarks/floor,$(wildcard $(folder)/*.[ch]))

lint: $(VENV)/.dev ## style, types, formatting
	$(PY) -m ruff check
	$(PY) -m ruff format --check
	$(PY) -m mypy
	@echo clang-format --dry-run
	@$(VENV)/bin/clang-format --dry-run --Werror $(C_FILES)

format: $(VENV)/.dev ## bring all sources into the one format
	$(PY) -m ruff check --fix --exit-zero
	$(PY) -m ruff format
	@echo clang-format -i
	@$(VENV)/bin/clang-format -i $(C_FILES)

lock: ## resolve the dependencies of pyproject.toml anew
	uv pip compile -q --universal --generate-hashes --no-header --no-emit-index-url --python-version 3.11 pyproject.toml --extra all --group build -o requirements.lock
	uv pip compile -q --universal --generate-hashes --no-header --no-emit-index-url --python-version 3.11 pyproject.toml -c requirements.lock -o ci/requirements.lock
	uv pip compile -q --universal --generate-hashes --no-header --no-emit-index-url --python-version 3.11 pyproject.toml --extra all --group dev -c requirements.lock -o requirements-dev.lock
	uv pip compile -q --universal --generate-hashes --no-header --no-emit-index-url --python-version 3.11 --group zig -o requirements-zig.lock
	uv pip compile -q --universal --generate-hashes --no-header --no-emit-index-url --python-version 3.11 pyproject.toml --group importers -c requirements-dev.lock -o requirements-importers.lock
	uv pip compile -q --universal --generate-hashes --no-header --no-emit-index-url --python-version 3.11 --no-deps pyproject.toml --extra ansys -c requirements.lock -o requirements-ansys.lock

clean: ## remove what was built, keep the environment
	rm -rf $(BUILD) $(FMUS) fmus/exchange.* fmus/planner.* fmus/machine.wasm $(VARIABLES) $(RESULTS) $(DIST)
