# C tests, for the Makefile to include (paths are from the top of the repository).
#
#   test-c          every tests/unit_c/test_*.c, compiled as the units are
#   test-sanitize   the same, and the whole life of each unit, under AddressSanitizer and UndefinedBehaviorSanitizer
#   test-valgrind   the whole life of each unit as packed, under valgrind's leak checker
#
# A test is one file test_<name>.c with a main() (see check.h); SOURCES_test_<name> below lists what is compiled with
# it. The directories of those sources are searched for headers. $(TOY) stands for the shell with the toy unit.

BUILD  ?= build
UNITS  ?= friction friction_gms controller plant setpoint machine
PY     ?= python3
UNIT_C  := tests/unit_c
C_BUILD := $(BUILD)/tests
TOY    := toy

SOURCES_test_shell_calls     := $(TOY)
SOURCES_test_shell_values    := $(TOY)
SOURCES_test_shell_steps     := $(TOY)
SOURCES_test_shell_states    := $(TOY)
SOURCES_test_shell_forged    := $(TOY)
SOURCES_test_shell_instances := $(TOY)
SOURCES_test_table           := $(TOY)
SOURCES_test_location        := $(TOY)
SOURCES_test_numbers         :=
SOURCES_test_text            := src/fmi2/text.c

SOURCES_test_exchange := src/exchange/exchange.c
SOURCES_test_planner := $(wildcard src/planner/*.c)

SOURCES_test_lugre     := src/friction_fmu/lugre.c
SOURCES_test_tem       := src/friction_fmu/tem.c
SOURCES_test_contact   := $(addprefix src/friction_fmu/,contact.c lugre.c tem.c)
SOURCES_test_response  := $(filter-out %/model.c,$(wildcard src/friction_fmu/*.c))
SOURCES_test_free_axis := $(filter-out %/model.c,$(wildcard src/friction_fmu/*.c))
SOURCES_test_gms       := $(addprefix src/friction_gms_fmu/,gms.c level.c)

SOURCES_test_geometry := src/plant_fmu/geometry.c
SOURCES_test_transmission := src/plant_fmu/transmission.c
SOURCES_test_mount := src/plant_fmu/mount.c
SOURCES_test_guide := $(addprefix src/plant_fmu/,guide.c guide_law.c)
SOURCES_test_modal := src/plant_fmu/modal.c
SOURCES_test_cells := $(addprefix src/plant_fmu/,cells.c modal.c)
SOURCES_test_poses := $(addprefix src/plant_fmu/,modes.c poses.c) $(addprefix src/fmi2/,csv.c numbers.c text.c)
SOURCES_test_modes := $(addprefix src/plant_fmu/,axes.c modes.c) $(addprefix src/fmi2/,csv.c numbers.c text.c)

SOURCES_test_setpoints := src/setpoint_fmu/setpoints.c $(addprefix src/fmi2/,csv.c numbers.c text.c)

SOURCES_test_controller_delay   := $(addprefix src/controller_fmu/,delay.c lag.c measured_speed.c)
SOURCES_test_controller_drive   := $(filter-out %/model.c,$(wildcard src/controller_fmu/*.c))
SOURCES_test_controller_effects := $(filter-out %/model.c,$(wildcard src/controller_fmu/*.c))
SOURCES_test_controller_filters := $(filter-out %/model.c,$(wildcard src/controller_fmu/*.c))
SOURCES_test_controller_loops   := $(filter-out %/model.c,$(wildcard src/controller_fmu/*.c))
SOURCES_test_controller_pmsm    := src/controller_fmu/pmsm.c

# --- how they are built --------------------------------------------------------------------------------------------

C_TESTS   := $(patsubst $(UNIT_C)/%.c,%,$(wildcard $(UNIT_C)/test_*.c))
C_HEADERS := $(wildcard src/planner/*.h src/fmi2/*.h src/fmi2/standard/*.h src/*_fmu/*.h src/*_fmu/*.def $(UNIT_C)/*.h $(UNIT_C)/toy_unit/*)
C_FLAGS   := -std=c99 -pedantic -Wall -Wextra -Wconversion -Wshadow -Werror -ffp-contract=off

FLAGS_plain := -O2
# Nothing where the compiler has no sanitisers: the tests then run without.
FLAGS_sanitized = $(eval FLAGS_sanitized := $(shell mkdir -p $(C_BUILD) && echo 'int main(void) { return 0; }' > $(C_BUILD)/probe.c && \
    $(CC) $(SANITIZERS) $(C_BUILD)/probe.c -o $(C_BUILD)/probe >/dev/null 2>&1 && $(C_BUILD)/probe && echo '$(SANITIZERS)'))$(FLAGS_sanitized)
SANITIZERS := -O1 -g -fno-omit-frame-pointer -fsanitize=address,undefined -fno-sanitize-recover=all

TOY_SOURCES  := $(wildcard src/fmi2/*.c) $(UNIT_C)/toy_unit/model.c $(UNIT_C)/toy.c
TOY_INCLUDES := -I$(UNIT_C) -I$(UNIT_C)/toy_unit -Isrc/fmi2 -Isrc/fmi2/standard

# $(1) variant, $(2) test
define C_TEST
$(C_BUILD)/$(1)/$(2): $(UNIT_C)/$(2).c $(filter-out toy,$(SOURCES_$(2))) $(if $(filter toy,$(SOURCES_$(2))),$(C_BUILD)/$(1)/toy.built) $(C_HEADERS) src/fmi2/numbers.c
	@mkdir -p $$(@D)
	$$(CC) $$(C_FLAGS) $$(FLAGS_$(1)) -I$(UNIT_C) $(addprefix -I,$(sort $(dir $(filter-out toy,$(SOURCES_$(2)))))) $(TOY_INCLUDES) \
	    $$< $(filter-out toy,$(SOURCES_$(2))) $(if $(filter toy,$(SOURCES_$(2))),$(C_BUILD)/$(1)/toy/*.o) -lm -o $$@
endef

# The shell with the toy unit, compiled once per variant.
define C_TOY
$(C_BUILD)/$(1)/toy.built: $(TOY_SOURCES) $(C_HEADERS)
	@rm -rf $(C_BUILD)/$(1)/toy && mkdir -p $(C_BUILD)/$(1)/toy
	@set -e; for source in $(TOY_SOURCES); do \
	    $$(CC) $$(C_FLAGS) $$(FLAGS_$(1)) $(TOY_INCLUDES) -c $$$$source -o $(C_BUILD)/$(1)/toy/$$$$(basename $$$$source .c).o; done
	@touch $$@
endef

$(foreach variant,plain sanitized,$(eval $(call C_TOY,$(variant))))
$(foreach variant,plain sanitized,$(foreach test,$(C_TESTS),$(eval $(call C_TEST,$(variant),$(test)))))

# Run all, then fail where one did. The argument is a directory for files that a test writes.
RUN_C_TESTS = status=0; for test in $(filter $(C_BUILD)/%,$^); do \
    case $$test in */test_*) $$test $(C_BUILD) || status=1;; esac; done; exit $$status

.PHONY: test-c test-sanitize test-valgrind

test-c: $(C_TESTS:%=$(C_BUILD)/plain/%) ## the C tests
	@$(RUN_C_TESTS)

# --- whole units ---------------------------------------------------------------------------------------------------

PACKED := $(foreach unit,$(UNITS),$(C_BUILD)/packed/$(unit).unpacked)

$(C_BUILD)/packed/%.unpacked: fmus/%.fmu
	@rm -rf $(@:.unpacked=) && mkdir -p $(@:.unpacked=)
	@$(PY) -m zipfile -e $< $(@:.unpacked=)
	@touch $@

$(C_BUILD)/%/lifecycle: $(UNIT_C)/lifecycle.c $(UNIT_C)/loaded.h src/fmi2/standard/fmi2FunctionTypes.h
	@mkdir -p $(@D)
	$(CC) $(C_FLAGS) -D_POSIX_C_SOURCE=200809L $(FLAGS_$*) -Isrc/fmi2/standard $< -ldl -lm -o $@

# The archive's sources, all in one folder, as importers compile them.
$(C_BUILD)/sanitized/%.so: $(C_BUILD)/packed/%.unpacked
	@mkdir -p $(@D)
	$(CC) -std=c99 -ffp-contract=off $(FLAGS_sanitized) -fPIC -shared -fvisibility=hidden -I$(<:.unpacked=)/sources -Isrc/fmi2/standard \
	    $(<:.unpacked=)/sources/*.c -lm -o $@

# The same with prefixed functions, all units in one program.
$(C_BUILD)/sanitized/%.objects: $(C_BUILD)/packed/%.unpacked
	@rm -rf $(@:.objects=) && mkdir -p $(@:.objects=)
	@set -e; for source in $(<:.unpacked=)/sources/*.c; do \
	    $(CC) -std=c99 -ffp-contract=off $(FLAGS_sanitized) -DFMI2_FUNCTION_PREFIX=$*_ \
	        -I$(<:.unpacked=)/sources -Isrc/fmi2/standard -c $$source -o $(@:.objects=)/$$(basename $$source .c).o; done
	@touch $@

$(C_BUILD)/sanitized/one_program: $(UNIT_C)/one_program.c $(foreach unit,$(UNITS),$(C_BUILD)/sanitized/$(unit).objects)
	$(CC) $(C_FLAGS) $(FLAGS_sanitized) -Isrc/fmi2/standard $< $(foreach unit,$(UNITS),$(C_BUILD)/sanitized/$(unit)/*.o) -lm -o $@

GUID_OF = $$(sed -n 's/.*guid="\([^"]*\)".*/\1/p' $(C_BUILD)/packed/$(1)/modelDescription.xml | head -n 1)

test-sanitize: $(C_TESTS:%=$(C_BUILD)/sanitized/%) $(foreach unit,$(UNITS),$(C_BUILD)/sanitized/$(unit).so) \
    $(C_BUILD)/sanitized/lifecycle $(C_BUILD)/sanitized/one_program ## the C tests and the units under sanitisers
	@$(if $(FLAGS_sanitized),,echo "the compiler has no sanitisers: running without";) $(RUN_C_TESTS)
	@set -e; for unit in $(UNITS); do \
	    $(C_BUILD)/sanitized/lifecycle $(C_BUILD)/sanitized/$$unit.so "$(call GUID_OF,$$unit)" $(C_BUILD)/packed/$$unit/resources; done
	@$(C_BUILD)/sanitized/one_program $(foreach unit,friction friction_gms controller plant setpoint machine,"$(call GUID_OF,$(unit))" $(C_BUILD)/packed/$(unit)/resources)

# An archive may hold binaries of other platforms as well.
HOST_FOLDER = $(shell $(PY) -c 'from feedsim_packager import targets; print(targets.host_target().folder)')

test-valgrind: $(C_BUILD)/plain/lifecycle $(PACKED) ## leak check of the units as packed
	@if ! command -v valgrind >/dev/null 2>&1; then echo "valgrind is not installed: leak check left out"; exit 0; fi; \
	set -e; for unit in $(UNITS); do \
	    valgrind --quiet --leak-check=full --error-exitcode=1 $< $(C_BUILD)/packed/$$unit/binaries/$(HOST_FOLDER)/$$unit.so \
	        "$(call GUID_OF,$$unit)" $(C_BUILD)/packed/$$unit/resources; done
