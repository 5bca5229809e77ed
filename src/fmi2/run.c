/* When the model is asked for what: coefficients, initial values, steps. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "derivatives.h"
#include "log.h"
#include "numbers.h"
#include "shell.h"
#include "values.h"

/* --- coefficients */

static size_t field_size(Kind kind) {
    return kind == KIND_REAL ? sizeof(double) : kind == KIND_STRING ? STRING_SIZE : sizeof(int);
}

static bool parameters_differ(const Unit *unit, const unsigned char *block) {
    for (size_t i = 0; i < unit->variable_count; i++) {
        const Variable *variable = &unit->variables[i];
        if (variable->info->causality == CAUSALITY_parameter &&
            memcmp(block + variable->offset, unit->derived_for + (variable->offset - SCALARS_AT),
                   field_size(variable->info->kind)) != 0) {
            return true;
        }
    }
    return false;
}

bool run_derived_for(const Unit *unit, const unsigned char *block) {
    return unit->derived_valid && !parameters_differ(unit, block);
}

bool unit_derived_for(const Unit *unit, const Scalars *scalars) {
    return run_derived_for(unit, (const unsigned char *)scalars - SCALARS_AT);
}

bool run_derive(Unit *unit, bool may_resize) {
    if (unit->derived_valid && !(unit->parameters_touched && parameters_differ(unit, unit->block))) {
        unit->parameters_touched = false;
        return true;
    }
    unit->derived_valid = false;
    if (!MODEL.derive(unit)) {
        return false;
    }
    size_t state_size = MODEL.state_size(unit), old_size = unit->block_size - unit->state_at;
    if (state_size != old_size && !may_resize) {
        return unit_fail(unit, "a tunable parameter changed the size of the model's state from %.0f to %.0f bytes",
                         (double)old_size, (double)state_size);
    }
    if (state_size != old_size && !unit_resize_state(unit, state_size)) {
        return false;
    }
    memcpy(unit->derived_for, unit->block + SCALARS_AT, unit->slopes_at - SCALARS_AT);
    unit->derived_valid = true;
    unit->parameters_touched = false;
    log_write(unit, LOG_EVENTS, "coefficients derived from the parameters");
    return true;
}

/* --- results */

static double result(const Unit *unit, size_t offset) {
    return *(const double *)(const void *)(unit->block + offset);
}

RARE static bool not_finite(Unit *unit, const Variable *variable) {
    char name[VARIABLE_NAME_SIZE], text[NUMBER_TEXT_SIZE];
    return unit_fail(unit, "%s '%s' is not finite: %s", table_causality(variable->info->causality),
                     table_name(unit, variable, name), number_text(text, result(unit, variable->offset)));
}

/* One by one: the first of the results that is not. The sum of finite ones is none either where they are huge. */
RARE static bool results_finite_each(Unit *unit) {
    for (size_t i = 0; i < unit->result_count; i++) {
        if (!isfinite(result(unit, unit->results[i]))) {
            const Variable *variable = unit->variables;
            while (variable->offset != unit->results[i]) {
                variable++;
            }
            return not_finite(unit, variable);
        }
    }
    return true;
}

/* By their sum, which is finite only where all of them are. In parts that do not wait for one another; one number at a
 * time, since a processor has to wait where it reads two at once that were only just written one by one. */
static inline bool results_finite(Unit *unit) {
    double sum = 0, second = 0, third = 0;
    const uint32_t *at = unit->results;
    size_t remaining = unit->result_count;
    for (; remaining >= 3; remaining -= 3, at += 3) {
        sum += result(unit, at[0]);
        second += result(unit, at[1]);
        third += result(unit, at[2]);
    }
    for (; remaining > 0; remaining--, at++) {
        sum += result(unit, *at);
    }
    return isfinite((sum + second) + third) || results_finite_each(unit);
}

static bool late_finite(Unit *unit) {
    for (unsigned reference = MODEL.late_first; reference < MODEL.late_end; reference++) {
        if (!isfinite(result(unit, unit->variables[reference].offset))) {
            return not_finite(unit, &unit->variables[reference]);
        }
    }
    return true;
}

bool run_show_late(Unit *unit) {
    if (!unit->late) {
        return true;
    }
    if (!unit->derived_valid) { /* the coefficients may be anything, of another size of the state even */
        char name[VARIABLE_NAME_SIZE];
        return unit_fail(unit, "output '%s' cannot be computed: the present parameters were refused",
                         table_name(unit, &unit->variables[MODEL.late_first], name));
    }
    MODEL.show_late(unit);
    unit->late = !late_finite(unit);
    return !unit->late;
}

bool run_refresh(Unit *unit) {
    if (!unit_header(unit)->stale) {
        return true;
    }
    if (!run_derive(unit, true)) {
        return false;
    }
    memset(unit_state(unit), 0, unit->block_size - unit->state_at);
    unit->late = false;
    MODEL.start(unit);
    if (!results_finite(unit) || !late_finite(unit)) {
        return false;
    }
    unit_header(unit)->stale = 0;
    return true;
}

void run_reset(Unit *unit) {
    memset(unit->block, 0, unit->block_size);
    unit->late = unit->tame = false;
    memcpy(unit->block + SCALARS_AT, unit->start, unit->slopes_at - SCALARS_AT);
    unit_header(unit)->stop_time = INFINITY;
    unit_header(unit)->stale = 1;
    unit->parameters_touched = true;
}

/* --- steps */

/* Importers compute time as k h, as a sum of h, from integer nanoseconds, ...: what differs by less than this is the
 * same instant. A part in 10^9, but never a noticeable part of a step, and never less than a few units in the last
 * place. */
static double tolerance(double t, double h) {
    const double scale = fabs(t) + h, part = 1e-9 * scale, least = 16 * DBL_EPSILON * scale;
    const double usual = part < 0.1 * h ? part : 0.1 * h;
    return usual > least ? usual : least;
}

RARE static bool step_refused(Unit *unit, double t, double h) {
    const Header *header = unit_header(unit);
    char text[3][NUMBER_TEXT_SIZE];
    if (!isfinite(t)) {
        return unit_fail(unit, "the communication point is not finite");
    }
    if (!(isfinite(h) && h > 0)) {
        return unit_fail(unit, "the step size must be finite and greater than 0");
    }
    if (fabs(t - header->time) > tolerance(header->time, h)) {
        return unit_fail(unit, "the communication point is %s s, but the unit stands at %s s", number_text(text[0], t),
                         number_text(text[1], header->time));
    }
    return unit_fail(unit, "the step would end at %s s, past the stop time of %s s", number_text(text[0], t + h),
                     number_text(text[1], header->stop_time));
}

/* Sufficient, and quickly said: the times are the same but for what the last places of an importer's sums differ. */
static inline bool step_usual(const Header *header, double t, double h) {
    const double end = t + h, grain = 16 * DBL_EPSILON * (fabs(header->time) + h);
    return h > 0 && end <= DBL_MAX && end <= header->stop_time && fabs(t - header->time) <= grain;
}

RARE static bool step_allowed(Unit *unit, double t, double h) {
    const Header *header = unit_header(unit);
    const double end = t + h;
    const bool allowed = isfinite(end) && h > 0 && fabs(t - header->time) <= tolerance(header->time, h) &&
                         (end <= header->stop_time || end <= header->stop_time + tolerance(header->stop_time, h));
    return allowed || step_refused(unit, t, h);
}

/* A step that is refused leaves everything as it was; one that fails leaves an instance that only a reset or a restored
 * state brings back. */
bool run_step(Unit *unit, double t, double h) {
    if ((!step_usual(unit_header(unit), t, h) && !step_allowed(unit, t, h)) || !derivatives_inputs_finite(unit, h) ||
        ((!unit->derived_valid || unit->parameters_touched) && !run_derive(unit, false))) {
        return false;
    }
    bool good = MODEL.step(unit, t, h) && results_finite(unit);
    Header *header = unit_header(unit);
    derivatives_clear_inputs(unit);
    header->last_step = good ? fmi2OK : fmi2Error;
    if (good) {
        header->time = t + h;
        header->steps++;
    } else {
        header->phase = PHASE_FAILED;
    }
    return good;
}
