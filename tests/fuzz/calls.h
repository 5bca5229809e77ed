/* Calls of the FMI as bytes make them (target.c): their arguments, what the table of variables and the phase of the
 * instance say must become of them, and their answers. */
#ifndef FEEDSIM_FUZZ_CALLS_H
#define FEEDSIM_FUZZ_CALLS_H

#include "arguments.h"

typedef struct Answer {
    fmi2Status status;
    double reals[MOST];
    int wholes[MOST];
    uint64_t texts;
} Answer;

/* --- what is to be expected: BAD leaves everything as it was */

typedef enum Expected { GOOD, BAD, EITHER } Expected;

static bool in_range_of(const VariableInfo *info, double value) {
    return isfinite(value) && value >= info->min && value <= info->max;
}

static bool settable_in(Phase phase, const VariableInfo *info) {
    return info->causality == CAUSALITY_input ||
           (info->causality == CAUSALITY_parameter &&
            (phase != PHASE_STEPPING || info->variability == VARIABILITY_tunable));
}

/* Whether element i is one that the function takes. */
static bool fits(const Pair *pair, const Asked *asked, size_t i) {
    const fmi2ValueReference reference = asked->references[i];
    if (reference >= pair->unit->variable_count) {
        return false;
    }
    const VariableInfo *info = pair->unit->variables[reference].info;
    if (info->kind != asked->kind) {
        return false;
    }
    switch (asked->call) {
    case CALL_SetReal:
        return settable_in(pair->phase, info) && in_range_of(info, asked->reals[i]);
    case CALL_SetInteger:
    case CALL_SetBoolean:
        return settable_in(pair->phase, info) && in_range_of(info, asked->wholes[i]);
    case CALL_SetString:
        return settable_in(pair->phase, info) && asked->texts[i] != NULL && strlen(asked->texts[i]) < STRING_SIZE;
    case CALL_SetRealInputDerivatives:
        return info->causality == CAUSALITY_input && asked->orders[i] == 1 && isfinite(asked->reals[i]);
    case CALL_GetRealOutputDerivatives:
        return info->causality == CAUSALITY_output && asked->orders[i] == 1;
    case CALL_GetDirectionalDerivative:
        return info->causality == CAUSALITY_output;
    default:
        return true;
    }
}

static Expected expected_of_arrays(const Pair *pair, const Asked *asked) {
    const bool ordered = asked->call == CALL_SetRealInputDerivatives || asked->call == CALL_GetRealOutputDerivatives;
    if (asked->count > MOST || asked->known_count > MOST ||
        (asked->count > 0 &&
         (asked->references == NULL || asked->reals == NULL || (ordered && asked->orders == NULL))) ||
        (asked->known_count > 0 && asked->knowns == NULL)) {
        return BAD;
    }
    for (size_t i = 0; i < asked->count; i++) {
        if (!fits(pair, asked, i)) {
            return BAD;
        }
    }
    for (size_t i = 0; i < asked->known_count; i++) {
        if (asked->knowns[i] >= pair->unit->variable_count ||
            pair->unit->variables[asked->knowns[i]].info->causality != CAUSALITY_input ||
            pair->unit->variables[asked->knowns[i]].info->kind != KIND_REAL) {
            return BAD;
        }
    }
    if (asked->call >= CALL_SetReal && asked->call <= CALL_SetString) {
        return GOOD;
    }
    return asked->call == CALL_SetRealInputDerivatives ? GOOD : EITHER; /* parameters were refused, overflow */
}

static Expected expected(const Pair *pair, const Asked *asked) {
#define PHASES_OF(name, phases) PHASES_##name,
    static const unsigned phases[] = {CALLS(PHASES_OF)};
#undef PHASES_OF
    if (asked->nobody || !(phases[asked->call] & 1u << pair->phase)) {
        return BAD;
    }
    switch (asked->call) {
    case CALL_SetDebugLogging:
        return asked->count > MOST || (asked->count > 0 && asked->reals == NULL) ? BAD : GOOD;
    case CALL_SetupExperiment:
        return isfinite(asked->t) && (!asked->flag || asked->h >= asked->t) ? GOOD : BAD;
    case CALL_DoStep:
        return isfinite(asked->h) && asked->h > 0 &&
                       fabs(asked->t - pair->time) <= 0.1 * asked->h + 1e-9 * fabs(asked->t)
                   ? EITHER
                   : BAD;
    case CALL_ExitInitializationMode:
        return EITHER; /* parameters that do not go together */
    case CALL_EnterInitializationMode:
    case CALL_Terminate:
    case CALL_Reset:
    case CALL_GetStatus:
    case CALL_GetRealStatus:
    case CALL_GetIntegerStatus:
    case CALL_GetBooleanStatus:
    case CALL_GetStringStatus:
        return GOOD;
    default:
        return expected_of_arrays(pair, asked);
    }
}

/* --- to one instance */

static void answer_texts(Answer *answer, const Asked *asked) {
    answer->texts = HASH_OF_NOTHING;
    for (size_t i = 0; i < asked->count && answer->status == fmi2OK; i++) {
        answer->texts = hash_bytes(answer->texts, asked->texts[i], strlen(asked->texts[i]) + 1);
    }
}

static Answer perform(Unit *unit, const Asked *asked) {
    Answer answer = {.status = fmi2Fatal};
    const Asked *a = asked;
    fmi2Component c = a->nobody ? NULL : unit;
    double *reals = a->reals != NULL ? LAST(answer.reals, a->count) : NULL;
    int *wholes = a->wholes != NULL ? LAST(answer.wholes, a->count) : NULL;
    fmi2Status told = fmi2OK;
    fmi2String text = NULL;
    doing = a->nobody ? "a function of nobody" : call_name(a->call);
    switch (a->call) {
    case CALL_SetDebugLogging:
        answer.status = fmi2SetDebugLogging(c, a->flag, a->count, a->texts);
        break;
    case CALL_SetupExperiment:
        answer.status = fmi2SetupExperiment(c, fmi2True, 1e-6, a->t, a->flag, a->h);
        break;
    case CALL_EnterInitializationMode:
        answer.status = fmi2EnterInitializationMode(c);
        break;
    case CALL_ExitInitializationMode:
        answer.status = fmi2ExitInitializationMode(c);
        break;
    case CALL_Terminate:
        answer.status = fmi2Terminate(c);
        break;
    case CALL_Reset:
        answer.status = fmi2Reset(c);
        break;
    case CALL_GetReal:
        answer.status = fmi2GetReal(c, a->references, a->count, reals);
        break;
    case CALL_GetInteger:
        answer.status = fmi2GetInteger(c, a->references, a->count, wholes);
        break;
    case CALL_GetBoolean:
        answer.status = fmi2GetBoolean(c, a->references, a->count, wholes);
        break;
    case CALL_GetString:
        answer.status = fmi2GetString(c, a->references, a->count, a->texts);
        answer_texts(&answer, a);
        break;
    case CALL_SetReal:
        answer.status = fmi2SetReal(c, a->references, a->count, a->reals);
        break;
    case CALL_SetInteger:
        answer.status = fmi2SetInteger(c, a->references, a->count, a->wholes);
        break;
    case CALL_SetBoolean:
        answer.status = fmi2SetBoolean(c, a->references, a->count, a->wholes);
        break;
    case CALL_SetString:
        answer.status = fmi2SetString(c, a->references, a->count, a->texts);
        break;
    case CALL_GetDirectionalDerivative: {
        double seed[MOST];
        for (size_t i = 0; i < MOST; i++) {
            seed[i] = 1 - 0.25 * (double)i;
        }
        answer.status =
            fmi2GetDirectionalDerivative(c, a->references, a->count, a->knowns, a->known_count, seed, reals);
        break;
    }
    case CALL_SetRealInputDerivatives:
        answer.status = fmi2SetRealInputDerivatives(c, a->references, a->count, a->orders, a->reals);
        break;
    case CALL_GetRealOutputDerivatives:
        answer.status = fmi2GetRealOutputDerivatives(c, a->references, a->count, a->orders, reals);
        break;
    case CALL_DoStep:
        answer.status = fmi2DoStep(c, a->t, a->h, a->flag);
        break;
    case CALL_GetStatus:
        answer.status = fmi2GetStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : &told);
        answer.wholes[0] = (int)told;
        break;
    case CALL_GetRealStatus:
        answer.status = fmi2GetRealStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : answer.reals);
        break;
    case CALL_GetIntegerStatus:
        answer.status = fmi2GetIntegerStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : answer.wholes);
        break;
    case CALL_GetBooleanStatus:
        answer.status = fmi2GetBooleanStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : answer.wholes);
        break;
    case CALL_GetStringStatus:
        answer.status = fmi2GetStringStatus(c, (fmi2StatusKind)a->status_kind, a->flag ? NULL : &text);
        break;
    default:
        answer.status = fmi2CancelStep(c);
        break;
    }
    return answer;
}

/* Where the variable of that name lies, or of that name behind a part's; NULL where there is none. */
static const void *variable_named(const Unit *unit, const char *name) {
    for (size_t i = 0; i < unit->variable_count; i++) {
        const char *own = unit->variables[i].info->name, *last = strrchr(own, '.');
        if (strcmp(own, name) == 0 || (last != NULL && strcmp(last + 1, name) == 0)) {
            return unit->block + unit->variables[i].offset;
        }
    }
    return NULL;
}

/* A controller works its cycles one by one, and so does the machine, with exchanges in each: steps of millions of them,
 * and states that lag far behind their time, are slow, not wrong. Their states begin with what they have worked. */
static bool takes_long(const Pair *pair, const Asked *asked) {
    const double *T_c = variable_named(pair->unit, "T_c");
    const int *exchanges = variable_named(pair->unit, "substeps");
    if (asked->call != CALL_DoStep || pair->phase != PHASE_STEPPING || T_c == NULL) {
        return false;
    }
    int64_t worked;
    memcpy(&worked, unit_state(pair->unit), sizeof worked);
    const double cycles = (asked->t + asked->h - header_of(pair)->start_time) / *T_c - (double)worked;
    return cycles * (exchanges != NULL ? *exchanges : 1) > MOST_CYCLES && cycles < 2e9;
}

/* --- to both, and what must hold then */

static void results_are_finite(const Pair *pair, const Asked *asked, const Answer *answer) {
    if (asked->call != CALL_GetReal || answer->status != fmi2OK || pair->phase == PHASE_FAILED) {
        return;
    }
    for (size_t i = 0; i < MOST; i++) {
        must(isfinite(answer->reals[i]), "what was read is not finite");
    }
}

/* What the call has made of the instance. */
static void follow(Pair *pair, const Asked *asked, const Answer *answer) {
    if (answer->status == fmi2OK) {
        switch (asked->call) {
        case CALL_SetupExperiment:
            pair->time = asked->t;
            pair->stop = asked->flag ? asked->h : INFINITY;
            break;
        case CALL_EnterInitializationMode:
            pair->phase = PHASE_INITIALIZATION;
            break;
        case CALL_ExitInitializationMode:
            pair->phase = PHASE_STEPPING;
            break;
        case CALL_Terminate:
            pair->phase = PHASE_TERMINATED;
            break;
        case CALL_Reset:
            at_its_start(pair);
            break;
        case CALL_DoStep:
            pair->time = asked->t + asked->h;
            must(pair->time <= pair->stop + 0.1 * asked->h + 1e-9 * fabs(pair->stop), "past the stop time");
            break;
        default:
            break;
        }
    } else if (asked->call == CALL_DoStep && header_of(pair)->phase == PHASE_FAILED) {
        pair->phase = PHASE_FAILED;
    }
    must(header_of(pair)->phase == (uint32_t)pair->phase, "the instance is in another state");
    must(!(header_of(pair)->time < pair->time || header_of(pair)->time > pair->time), "it stands at another time");
}

static void ask(Pair *pair, const Asked *asked) {
    if (takes_long(pair, asked)) {
        return;
    }
    const Expected hoped = expected(pair, asked);
    const Phase before = pair->phase;
    begin(false);
    short_of_memory = false;
    const bool told = !asked->nobody && (pair->unit->log_categories & LOG_ERRORS);
    const Answer answer = perform(pair->unit, asked);
    fail_in = 0;
    const bool error = answer.status == fmi2Error;
    must(error || answer.status <= fmi2Discard, "no such status");
    must(hoped != BAD || error, "not refused");
    must(hoped != GOOD || !error || short_of_memory, "refused");
    if (told && asked->call != CALL_SetDebugLogging) {
        must(error == (errors_told > 0), "an error without a message, or a message without an error");
    }
    if (!asked->nobody) {
        follow(pair, asked, &answer);
    }
    results_are_finite(pair, asked, &answer);
    const bool nothing_happened =
        error && (hoped == BAD || short_of_memory || (asked->call == CALL_DoStep && pair->phase == before));
    if (depth > 0 || nothing_happened) {
        return;
    }
    begin(true);
    const Answer other = perform(pair->twin, asked);
    must(memcmp(&answer, &other, sizeof answer) == 0, "the twin answers otherwise");
}

#endif
