#include "values.h"

#include <math.h>
#include <string.h>

#include "numbers.h"

static const char *const kind_names[] = {"Real", "Integer", "Boolean", "String"};

RARE const Variable *values_missing(Unit *unit, fmi2ValueReference reference, Kind kind) {
    if (reference >= unit->variable_count) {
        unit_fail(unit, "value reference %u does not exist; those of this unit run from 0 to %u", reference,
                  (unsigned)unit->variable_count - 1);
        return NULL;
    }
    const Variable *variable = &unit->variables[reference];
    char name[VARIABLE_NAME_SIZE];
    unit_fail(unit, "value reference %u is the %s %s '%s'; expected here is type %s", reference,
              kind_names[variable->info->kind], table_causality(variable->info->causality),
              table_name(unit, variable, name), kind_names[kind]);
    return NULL;
}

RARE bool values_no_arrays(Unit *unit, size_t count) {
    if (count > MOST_ELEMENTS) {
        return unit_fail(unit, "no array has %.0f elements: was a negative number taken for a size?", (double)count);
    }
    return unit_fail(unit, "an array of %.0f elements is expected, not NULL", (double)count);
}

/* --- get */

static bool late_ready(Unit *unit, size_t count, const fmi2ValueReference references[]) {
    return !unit->late || values_all(unit, count, references, READY_REAL) || run_show_late(unit);
}

/* In initialisation mode calculated variables follow what was set; afterwards they belong to the end of the last step.
 */
static bool ready(Unit *unit, size_t count, const fmi2ValueReference references[]) {
    const Header *header = unit_header(unit);
    if (header->phase != PHASE_INITIALIZATION || !header->stale) {
        return late_ready(unit, count, references);
    }
    for (size_t i = 0; i < count; i++) {
        if (references[i] < unit->variable_count) {
            Causality causality = unit->variables[references[i]].info->causality;
            if (causality == CAUSALITY_output || causality == CAUSALITY_local) {
                return run_refresh(unit);
            }
        }
    }
    return true;
}

static inline bool all_exist(Unit *unit, Kind kind, size_t count, const fmi2ValueReference references[]) {
    for (size_t i = 0; i < count; i++) {
        if (values_find(unit, references[i], kind) == NULL) {
            return false;
        }
    }
    return true;
}

static inline bool readable(Unit *unit, Kind kind, size_t count, const fmi2ValueReference references[],
                            const void *values) {
    return values_arrays(unit, count, references, values) && all_exist(unit, kind, count, references) &&
           ready(unit, count, references);
}

bool values_get_real(Unit *unit, size_t count, const fmi2ValueReference references[], fmi2Real values[]) {
    if (!readable(unit, KIND_REAL, count, references, values)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = *unit_real(unit, references[i]);
    }
    return true;
}

bool values_get_whole(Unit *unit, Kind kind, size_t count, const fmi2ValueReference references[], int values[]) {
    if (!readable(unit, kind, count, references, values)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = *(const int *)unit_address(unit, &unit->variables[references[i]]);
    }
    return true;
}

bool values_get_string(Unit *unit, size_t count, const fmi2ValueReference references[], fmi2String values[]) {
    if (!readable(unit, KIND_STRING, count, references, values)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = unit_address(unit, &unit->variables[references[i]]);
    }
    return true;
}

/* --- set: check the whole call first, then write */

RARE static bool settable_now(Unit *unit, const Variable *variable) {
    const VariableInfo *info = variable->info;
    char name[VARIABLE_NAME_SIZE];
    if (info->causality != CAUSALITY_parameter) {
        return unit_fail(unit, "the %s '%s' is calculated and cannot be set", table_causality(info->causality),
                         table_name(unit, variable, name));
    }
    if (unit_header(unit)->phase == PHASE_STEPPING && info->variability != VARIABILITY_tunable) {
        return unit_fail(unit, "the fixed parameter '%s' cannot be set once initialisation is complete",
                         table_name(unit, variable, name));
    }
    return true;
}

static inline bool settable(Unit *unit, const Variable *variable) {
    return variable->info->causality == CAUSALITY_input || settable_now(unit, variable);
}

RARE static bool out_of_range(Unit *unit, const Variable *variable, double value) {
    const VariableInfo *info = variable->info;
    char name[VARIABLE_NAME_SIZE], text[3][NUMBER_TEXT_SIZE];
    const char *gap = *info->unit ? " " : "";
    table_name(unit, variable, name);
    number_text(text[0], value);
    number_text(text[1], info->min);
    number_text(text[2], info->max);
    if (!isfinite(value)) {
        return unit_fail(unit, "the value of %s '%s' is not finite: %s", table_causality(info->causality), name,
                         text[0]);
    }
    if (isinf(info->max)) {
        return unit_fail(unit, "the value of %s '%s' is out of range: %s%s%s, allowed is at least %s",
                         table_causality(info->causality), name, text[0], gap, info->unit, text[1]);
    }
    if (isinf(info->min)) {
        return unit_fail(unit, "the value of %s '%s' is out of range: %s%s%s, allowed is at most %s",
                         table_causality(info->causality), name, text[0], gap, info->unit, text[2]);
    }
    return unit_fail(unit, "the value of %s '%s' is out of range: %s%s%s, allowed is %s to %s",
                     table_causality(info->causality), name, text[0], gap, info->unit, text[1], text[2]);
}

static inline bool in_range(Unit *unit, const Variable *variable, double value) {
    const VariableInfo *info = variable->info;
    return (isfinite(value) && value >= info->min && value <= info->max) || out_of_range(unit, variable, value);
}

/* What follows from variables having been set. */
static inline void note_set(Unit *unit, const Variable *variable) {
    if (variable->info->causality == CAUSALITY_parameter) {
        unit->parameters_touched = true;
    }
    if (unit_header(unit)->phase != PHASE_STEPPING) {
        unit_header(unit)->stale = 1;
    } else {
        unit->late = unit->late || MODEL.late_reads_inputs;
    }
}

bool values_set_real(Unit *unit, size_t count, const fmi2ValueReference references[], const fmi2Real values[]) {
    if (!values_arrays(unit, count, references, values)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const Variable *variable = values_find(unit, references[i], KIND_REAL);
        if (variable == NULL || !settable(unit, variable) || !in_range(unit, variable, values[i])) {
            return false;
        }
    }
    for (size_t i = 0; i < count; i++) {
        const Variable *variable = &unit->variables[references[i]];
        *(double *)unit_address(unit, variable) = values[i];
        note_set(unit, variable);
    }
    unit->tame = false; /* perhaps */
    return true;
}

bool values_set_whole(Unit *unit, Kind kind, size_t count, const fmi2ValueReference references[], const int values[]) {
    if (!values_arrays(unit, count, references, values)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const Variable *variable = values_find(unit, references[i], kind);
        if (variable == NULL || !settable(unit, variable) || !in_range(unit, variable, values[i])) {
            return false;
        }
    }
    for (size_t i = 0; i < count; i++) {
        const Variable *variable = &unit->variables[references[i]];
        *(int *)unit_address(unit, variable) = kind == KIND_BOOLEAN ? values[i] != 0 : values[i];
        note_set(unit, variable);
    }
    return true;
}

static bool fits(Unit *unit, const Variable *variable, const char *text) {
    char name[VARIABLE_NAME_SIZE];
    if (text == NULL) {
        return unit_fail(unit, "the value of '%s' is NULL", table_name(unit, variable, name));
    }
    size_t length = strlen(text);
    if (length >= STRING_SIZE) {
        return unit_fail(unit, "the value of '%s' is too long: %.0f bytes, allowed are at most %d",
                         table_name(unit, variable, name), (double)length, STRING_SIZE - 1);
    }
    return true;
}

bool values_set_string(Unit *unit, size_t count, const fmi2ValueReference references[], const fmi2String values[]) {
    if (!values_arrays(unit, count, references, values)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        const Variable *variable = values_find(unit, references[i], KIND_STRING);
        if (variable == NULL || !settable(unit, variable) || !fits(unit, variable, values[i])) {
            return false;
        }
    }
    for (size_t i = 0; i < count; i++) {
        const Variable *variable = &unit->variables[references[i]];
        char *text = unit_address(unit, variable);
        size_t length = strlen(values[i]);
        memmove(text, values[i], length); /* importers may hand back what fmi2GetString gave them */
        memset(text + length, 0, STRING_SIZE - length);
        note_set(unit, variable);
    }
    return true;
}

/* --- start values from the model's own files */

static const Variable *named(const Unit *unit, const char *name) {
    for (size_t i = 0; i < SCALAR_ROWS; i++) {
        if (strcmp(unit->variables[i].info->name, name) == 0) {
            return &unit->variables[i];
        }
    }
    for (size_t axis = 0; axis < unit->axes; axis++) {
        const size_t length = strlen(unit->axis_names[axis]);
        if (strncmp(name, unit->axis_names[axis], length) != 0 || name[length] != '.') {
            continue;
        }
        const Variable *rows = unit->variables + SCALAR_ROWS + axis * (size_t)AXIS_ROWS;
        for (const Variable *end = rows + AXIS_ROWS; rows < end; rows++) {
            if (strcmp(rows->info->name, name + length + 1) == 0) {
                return rows;
            }
        }
    }
    return NULL;
}

bool unit_set_start(Unit *unit, const char *name, const char *value) {
    const Variable *variable = named(unit, name);
    if (variable == NULL || variable->info->causality != CAUSALITY_parameter || variable->info->kind == KIND_STRING) {
        return unit_fail(unit, "'%s' is no parameter of this unit that a number can be the value of", name);
    }
    const Kind kind = variable->info->kind;
    double number = 0;
    const char *end = value;
    if (!number_parse(value, &end, &number) || *end != '\0' || (kind == KIND_BOOLEAN && number != 0 && number != 1) ||
        (kind == KIND_INTEGER && number != floor(number))) {
        return unit_fail(unit, "the value of parameter '%s' is '%s', which is no %s", name, value,
                         kind == KIND_REAL      ? "number with a decimal point"
                         : kind == KIND_INTEGER ? "whole number"
                                                : "0 or 1");
    }
    if (!in_range(unit, variable, number)) {
        return false;
    }
    if (kind == KIND_REAL) {
        *(double *)unit_address(unit, variable) = number;
    } else {
        *(int *)unit_address(unit, variable) = (int)number;
    }
    return true;
}

/* --- check a whole block */

static bool real_sound(Unit *unit, const Variable *variable, double value, bool results) {
    const Causality causality = variable->info->causality;
    if (causality == CAUSALITY_parameter || causality == CAUSALITY_input) {
        return in_range(unit, variable, value);
    }
    return !results || isfinite(value) || out_of_range(unit, variable, value);
}

static bool sound(Unit *unit, const Variable *variable, const unsigned char *at, bool results) {
    char name[VARIABLE_NAME_SIZE];
    double real;
    int whole;
    switch (variable->info->kind) {
    case KIND_REAL:
        memcpy(&real, at, sizeof real);
        return real_sound(unit, variable, real, results);
    case KIND_INTEGER:
        memcpy(&whole, at, sizeof whole);
        return in_range(unit, variable, whole);
    case KIND_BOOLEAN:
        memcpy(&whole, at, sizeof whole);
        return whole == 0 || whole == 1 ||
               unit_fail(unit, "the value of %s '%s' is %d; a Boolean is 0 or 1",
                         table_causality(variable->info->causality), table_name(unit, variable, name), whole);
    case KIND_STRING:
        return memchr(at, '\0', STRING_SIZE) != NULL ||
               unit_fail(unit, "the value of '%s' is too long: allowed are at most %d bytes",
                         table_name(unit, variable, name), STRING_SIZE - 1);
    }
    return false;
}

bool values_sound(Unit *unit, const unsigned char *block, bool results) {
    for (size_t i = 0; i < unit->variable_count; i++) {
        if (!sound(unit, &unit->variables[i], block + unit->variables[i].offset, results)) {
            return false;
        }
    }
    return true;
}
