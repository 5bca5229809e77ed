/* The info table: one VariableInfo per row of variables.def, and the hash that stands for the whole table. */
#include <stdio.h>
#include <string.h>

#include "hash.h"
#include "shell.h"

/* A closing row, so that a unit without axis rows does not declare an array of size zero. */
#define CLOSING_ROW {"", KIND_REAL, CAUSALITY_local, VARIABILITY_fixed, 0, "", "", NO_MIN, NO_MAX, "", "", 0}

#define ROW(struct_type, kind, field, name, causality, variability, start, start_text, unit, min, min_text, max,       \
            max_text)                                                                                                  \
    {name,     KIND_##kind, CAUSALITY_##causality,       VARIABILITY_##variability, start, start_text, unit, min, max, \
     min_text, max_text,    offsetof(struct_type, field)},

#define VARIABLE(kind, field, name, causality, variability, start, start_text, unit, display, min, min_text, max,      \
                 max_text, depends, text)                                                                              \
    ROW(Scalars, kind, field, name, causality, variability, start, start_text, unit, min, min_text, max, max_text)
#define AXIS_VARIABLE(...)
const VariableInfo table_scalars[SCALAR_ROWS + 1] = {
#include UNIT_TABLE
    CLOSING_ROW};
#undef VARIABLE
#undef AXIS_VARIABLE

#define VARIABLE(...)
#define AXIS_VARIABLE(kind, field, name, causality, variability, start, start_text, unit, display, min, min_text, max, \
                      max_text, depends, text)                                                                         \
    ROW(AxisBlock, kind, field, name, causality, variability, start, start_text, unit, min, min_text, max, max_text)
const VariableInfo table_axis[AXIS_ROWS + 1] = {
#include UNIT_TABLE
    CLOSING_ROW};
#undef VARIABLE
#undef AXIS_VARIABLE

static const char *const kinds[] = {"REAL", "INTEGER", "BOOLEAN", "STRING"};
static const char *const causalities[] = {"parameter", "input", "output", "local"};
static const char *const variabilities[] = {"fixed", "tunable", "discrete", "continuous"};

static uint64_t hash_rows(uint64_t hash, const VariableInfo *rows, size_t count) {
    for (size_t i = 0; i < count; i++) {
        const char *parts[] = {rows[i].name,
                               kinds[rows[i].kind],
                               causalities[rows[i].causality],
                               variabilities[rows[i].variability],
                               rows[i].start_text,
                               rows[i].unit,
                               rows[i].min_text,
                               rows[i].max_text};
        size_t last = sizeof parts / sizeof *parts - 1;
        for (size_t k = 0; k <= last; k++) {
            hash = hash_bytes(hash, parts[k], strlen(parts[k]));
            hash = hash_bytes(hash, k < last ? "|" : "\n", 1);
        }
    }
    return hash;
}

char *table_hash(char *text) {
    return hash_text(text, hash_rows(hash_rows(HASH_OF_NOTHING, table_scalars, SCALAR_ROWS), table_axis, AXIS_ROWS));
}

const char *table_causality(Causality causality) {
    return causalities[causality];
}

char *table_name(const Unit *unit, const Variable *variable, char *name) {
    if (variable->offset < AXES_AT) {
        snprintf(name, VARIABLE_NAME_SIZE, "%s", variable->info->name);
    } else {
        snprintf(name, VARIABLE_NAME_SIZE, "%s.%s", unit->axis_names[(variable->offset - AXES_AT) / sizeof(AxisBlock)],
                 variable->info->name);
    }
    return name;
}
