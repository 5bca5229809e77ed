#include "derivatives.h"

#include <math.h>

#include "numbers.h"
#include "values.h"

RARE static bool is_another(Unit *unit, fmi2ValueReference reference, Causality causality, const char *purpose) {
    const Variable *variable = &unit->variables[reference];
    char name[VARIABLE_NAME_SIZE];
    return unit_fail(unit, "%s %s, but value reference %u is the %s '%s'", purpose, table_causality(causality),
                     reference, table_causality(variable->info->causality), table_name(unit, variable, name));
}

static inline bool is(Unit *unit, fmi2ValueReference reference, Causality causality, const char *purpose) {
    const Variable *variable = values_find(unit, reference, KIND_REAL);
    return variable != NULL &&
           (variable->info->causality == causality || is_another(unit, reference, causality, purpose));
}

RARE static bool another_order(Unit *unit, fmi2ValueReference reference, int order, const char *limit) {
    char name[VARIABLE_NAME_SIZE];
    return unit_fail(unit, "derivative of order %d asked for '%s'; allowed is order 1 (%s)", order,
                     table_name(unit, &unit->variables[reference], name), limit);
}

static inline bool first_order(Unit *unit, fmi2ValueReference reference, int order, const char *limit) {
    return order == 1 || another_order(unit, reference, order, limit);
}

/* --- inputs */

bool derivatives_set_inputs(Unit *unit, size_t count, const fmi2ValueReference references[], const fmi2Integer orders[],
                            const fmi2Real values[]) {
    if (!values_arrays(unit, count, references, values) || !values_arrays(unit, count, references, orders)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        if (!is(unit, references[i], CAUSALITY_input, "a slope goes with an") ||
            !first_order(unit, references[i], orders[i], "inputs are linear over a step")) {
            return false;
        }
        if (!isfinite(values[i])) {
            char name[VARIABLE_NAME_SIZE], text[NUMBER_TEXT_SIZE];
            return unit_fail(unit, "the slope of input '%s' is not finite: %s",
                             table_name(unit, &unit->variables[references[i]], name), number_text(text, values[i]));
        }
    }
    for (size_t i = 0; i < count; i++) {
        unit_slopes(unit)[references[i]] = values[i];
    }
    if (count > 0) {
        unit_header(unit)->sloped = 1;
    }
    unit->tame = false; /* perhaps */
    return true;
}

/* Also finds out whether the inputs are tame (again). */
bool derivatives_inputs_finite_now(Unit *unit, double h) {
    double probe = 0;
    for (size_t i = 0; i < unit->input_count; i++) {
        const Variable *variable = &unit->variables[unit->inputs[i]];
        const double value = *(const double *)unit_address(unit, variable), slope = unit_slopes(unit)[unit->inputs[i]];
        if (!isfinite(value + slope * h)) {
            char name[VARIABLE_NAME_SIZE], text[2][NUMBER_TEXT_SIZE];
            return unit_fail(unit, "input '%s' does not stay finite over the step: value %s, slope %s/s",
                             table_name(unit, variable, name), number_text(text[0], value),
                             number_text(text[1], slope));
        }
        probe += number_probe_tame(value) + number_probe_tame(slope);
    }
    unit->tame = !isnan(probe);
    return true;
}

/* --- outputs */

/* Where parameters were refused the coefficients may be anything, of another size of the state even. */
static bool has_coefficients(Unit *unit) {
    return unit->derived_valid || unit_fail(unit, "no derivatives: the present parameters were refused");
}

bool derivatives_get_outputs(Unit *unit, size_t count, const fmi2ValueReference references[],
                             const fmi2Integer orders[], fmi2Real values[]) {
    if (!values_arrays(unit, count, references, values) || !values_arrays(unit, count, references, orders)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        if (!is(unit, references[i], CAUSALITY_output, "derivatives with respect to time are those of an") ||
            !first_order(unit, references[i], orders[i], "maxOutputDerivativeOrder")) {
            return false;
        }
    }
    if (!has_coefficients(unit)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        values[i] = MODEL.output_derivative(unit, references[i]);
    }
    return true;
}

bool derivatives_get_directional(Unit *unit, size_t unknown_count, const fmi2ValueReference unknowns[],
                                 size_t known_count, const fmi2ValueReference knowns[], const fmi2Real seed[],
                                 fmi2Real sensitivity[]) {
    if (!values_arrays(unit, unknown_count, unknowns, sensitivity) || !values_arrays(unit, known_count, knowns, seed)) {
        return false;
    }
    for (size_t i = 0; i < unknown_count; i++) {
        if (!is(unit, unknowns[i], CAUSALITY_output, "an unknown of a directional derivative is an")) {
            return false;
        }
    }
    for (size_t k = 0; k < known_count; k++) {
        if (!is(unit, knowns[k], CAUSALITY_input, "a known of a directional derivative is an")) {
            return false;
        }
    }
    const bool initial = unit_header(unit)->phase == PHASE_INITIALIZATION;
    if (initial ? !run_refresh(unit) : !has_coefficients(unit)) {
        return false;
    }
    for (size_t i = 0; i < unknown_count; i++) {
        sensitivity[i] = 0;
        for (size_t k = 0; k < known_count; k++) {
            sensitivity[i] += MODEL.partial(unit, unknowns[i], knowns[k], initial) * seed[k];
        }
    }
    return true;
}
