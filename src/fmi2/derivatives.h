/* Slopes of inputs, slopes of outputs, and partial derivatives of outputs with respect to inputs. Every function either
 * succeeds or changes nothing and returns false with the reason logged. */
#ifndef FEEDSIM_DERIVATIVES_H
#define FEEDSIM_DERIVATIVES_H

#include "fmi2Functions.h"
#include "numbers.h"
#include "shell.h"
#include "values.h"

bool derivatives_set_inputs(Unit *unit, size_t count, const fmi2ValueReference references[], const fmi2Integer orders[],
                            const fmi2Real values[]);
/* Every input stays finite until the end of a step of size h. */
static inline bool derivatives_inputs_finite(Unit *unit, double h);
bool derivatives_inputs_finite_now(Unit *unit, double h);
/* The slopes served their step. */
static inline void derivatives_clear_inputs(Unit *unit);

/* What the calls of every step mostly are, as in values.h: false, and nothing changed, where it is not that. */
static inline bool derivatives_set_usual(Unit *unit, size_t count, const fmi2ValueReference references[],
                                         const fmi2Integer orders[], const fmi2Real values[]);
static inline bool derivatives_get_usual(Unit *unit, size_t count, const fmi2ValueReference references[],
                                         const fmi2Integer orders[], fmi2Real values[]);

bool derivatives_get_outputs(Unit *unit, size_t count, const fmi2ValueReference references[],
                             const fmi2Integer orders[], fmi2Real values[]);
bool derivatives_get_directional(Unit *unit, size_t unknown_count, const fmi2ValueReference unknowns[],
                                 size_t known_count, const fmi2ValueReference knowns[], const fmi2Real seed[],
                                 fmi2Real sensitivity[]);

static inline bool derivatives_first_order(size_t count, const fmi2Integer orders[]) {
    int other = 0;
    for (size_t i = 0; i < count; i++) {
        other |= orders[i] ^ 1;
    }
    return other == 0;
}

static inline bool derivatives_set_usual(Unit *unit, size_t count, const fmi2ValueReference references[],
                                         const fmi2Integer orders[], const fmi2Real values[]) {
    if (!unit_usual(unit) || references == NULL || orders == NULL || values == NULL || count == 0 ||
        count > unit->variable_count || !values_all_tame(unit, count, references, values, REAL_INPUT) ||
        !derivatives_first_order(count, orders)) {
        return false;
    }
    double *slopes = unit_slopes(unit);
    for (size_t i = 0; i < count; i++) {
        slopes[references[i]] = values[i];
    }
    unit_header(unit)->sloped = 1;
    return true;
}

static inline bool derivatives_get_usual(Unit *unit, size_t count, const fmi2ValueReference references[],
                                         const fmi2Integer orders[], fmi2Real values[]) {
    if (!unit_usual(unit) || references == NULL || orders == NULL || values == NULL || !unit->derived_valid ||
        count > unit->variable_count || !values_all(unit, count, references, REAL_OUTPUT) ||
        !derivatives_first_order(count, orders)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = MODEL.output_derivative(unit, references[i]);
    }
    return true;
}

static inline bool derivatives_inputs_finite(Unit *unit, double h) {
    /* without slopes: the values themselves were checked when they were set */
    return !unit_header(unit)->sloped || (unit->tame && h < TAME_STEP) || derivatives_inputs_finite_now(unit, h);
}

static inline void derivatives_clear_inputs(Unit *unit) {
    Header *header = unit_header(unit);
    if (!header->sloped) {
        return;
    }
    double *slopes = unit_slopes(unit);
    const unsigned *inputs = unit->inputs;
    const size_t count = unit->input_count;
    for (size_t i = 0; i < count; i++) {
        slopes[inputs[i]] = 0;
    }
    header->sloped = 0;
}

#endif
