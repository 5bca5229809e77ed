/* Generic access to the variables by value reference. Every function either succeeds or changes nothing and returns
 * false with the reason logged. */
#ifndef FEEDSIM_VALUES_H
#define FEEDSIM_VALUES_H

#include <math.h>
#include <stdint.h>

#include "fmi2Functions.h"
#include "numbers.h"
#include "shell.h"

/* The variable of that reference, or NULL (with the reason logged) where there is none of that kind. */
static inline const Variable *values_find(Unit *unit, fmi2ValueReference reference, Kind kind);
const Variable *values_missing(Unit *unit, fmi2ValueReference reference, Kind kind); /* always NULL */

/* No memory holds more numbers than this. */
#define MOST_ELEMENTS (SIZE_MAX / 2 / sizeof(double))

/* Whether `count` elements can lie in both arrays. An importer may pass NULL for an array of no elements only. */
static inline bool values_arrays(Unit *unit, size_t count, const void *references, const void *values);
bool values_no_arrays(Unit *unit, size_t count); /* always false, with the reason logged */

/* Whether every reference is that of a variable which `is` so (see shell.h), in the fewest instructions. */
static inline bool values_all(const Unit *unit, size_t count, const fmi2ValueReference references[], unsigned is);
/* ... and every value that goes with them is tame (numbers.h). */
static inline bool values_all_tame(const Unit *unit, size_t count, const fmi2ValueReference references[],
                                   const fmi2Real values[], unsigned is);

/* What the calls of every step mostly are: references and values are there, at most one of each variable, there is
 * nothing to refuse. false, and nothing changed, where it is not that; the functions below then look again. */
static inline bool values_get_usual(const Unit *unit, size_t count, const fmi2ValueReference references[],
                                    fmi2Real values[]);
static inline bool values_set_usual(Unit *unit, size_t count, const fmi2ValueReference references[],
                                    const fmi2Real values[]);

bool values_get_real(Unit *unit, size_t count, const fmi2ValueReference references[], fmi2Real values[]);
bool values_set_real(Unit *unit, size_t count, const fmi2ValueReference references[], const fmi2Real values[]);
/* kind: KIND_INTEGER or KIND_BOOLEAN */
bool values_get_whole(Unit *unit, Kind kind, size_t count, const fmi2ValueReference references[], int values[]);
bool values_set_whole(Unit *unit, Kind kind, size_t count, const fmi2ValueReference references[], const int values[]);
bool values_get_string(Unit *unit, size_t count, const fmi2ValueReference references[], fmi2String values[]);
bool values_set_string(Unit *unit, size_t count, const fmi2ValueReference references[], const fmi2String values[]);

/* Whether the variables of a foreign block (aligned or not) are such as this file would have let them become; results:
 * its Real outputs and locals must be finite as well. */
bool values_sound(Unit *unit, const unsigned char *block, bool results);

static inline const Variable *values_find(Unit *unit, fmi2ValueReference reference, Kind kind) {
    if (reference < unit->variable_count && unit->variables[reference].info->kind == kind) {
        return &unit->variables[reference];
    }
    return values_missing(unit, reference, kind);
}

static inline bool values_arrays(Unit *unit, size_t count, const void *references, const void *values) {
    return (count <= MOST_ELEMENTS && references != NULL && values != NULL) || count == 0 ||
           values_no_arrays(unit, count);
}

static inline bool values_all(const Unit *unit, size_t count, const fmi2ValueReference references[], unsigned is) {
    const Slot *slots = unit->slots;
    const size_t known = unit->variable_count;
    unsigned all = is;
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= known) {
            return false;
        }
        all &= slots[references[i]].is;
    }
    return all == is;
}

static inline bool values_all_tame(const Unit *unit, size_t count, const fmi2ValueReference references[],
                                   const fmi2Real values[], unsigned is) {
    const Slot *slots = unit->slots;
    const size_t known = unit->variable_count;
    unsigned all = is;
    double probe = 0;
    for (size_t i = 0; i < count; i++) {
        if (references[i] >= known) {
            return false;
        }
        all &= slots[references[i]].is;
        probe += number_probe_tame(values[i]);
    }
    return all == is && !isnan(probe);
}

static inline bool values_get_usual(const Unit *unit, size_t count, const fmi2ValueReference references[],
                                    fmi2Real values[]) {
    if (!unit_usual(unit) || references == NULL || values == NULL || count > unit->variable_count ||
        !values_all(unit, count, references, READY_REAL)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = *unit_real(unit, references[i]);
    }
    return true;
}

static inline bool values_set_usual(Unit *unit, size_t count, const fmi2ValueReference references[],
                                    const fmi2Real values[]) {
    if (!unit_usual(unit) || references == NULL || values == NULL || count > unit->variable_count ||
        !values_all_tame(unit, count, references, values, FREE_INPUT)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        *unit_real(unit, references[i]) = values[i];
    }
    unit->late = unit->late || MODEL.late_reads_inputs;
    return true;
}

#endif
