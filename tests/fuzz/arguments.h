/* Arguments of calls of the FMI as bytes make them (target.c): of which variables, with which values. */
#ifndef FEEDSIM_FUZZ_ARGUMENTS_H
#define FEEDSIM_FUZZ_ARGUMENTS_H

#include "surroundings.h"

typedef struct Asked {
    Call call;
    Kind kind;   /* of the values */
    bool nobody; /* NULL for the component */
    size_t count, known_count;
    const fmi2ValueReference *references, *knowns;
    double *reals;
    int *wholes, *orders;
    fmi2String *texts;
    double t, h;
    bool flag;
    int status_kind;
} Asked;

/* Arrays end where their memory does, so that one element too many is seen. */
static fmi2ValueReference reference_room[2][MOST];
static double real_room[MOST];
static int whole_room[MOST], order_room[MOST];
static fmi2String text_room[MOST];
#define LAST(room, count) ((count) <= MOST ? (room) + MOST - (count) : (room))

static size_t some_count(void) {
    const unsigned kind = byte();
    return kind < 160 ? 1 : kind < 240 ? kind % MOST : kind < 252 ? 0 : kind < 254 ? SIZE_MAX : MOST_ELEMENTS + 1;
}

static fmi2ValueReference some_reference(const Unit *unit, Kind kind) {
    const unsigned choice = byte();
    if (choice > 250) {
        return (fmi2ValueReference)bytes(4);
    }
    const fmi2ValueReference first = choice % (fmi2ValueReference)(unit->variable_count + 1);
    fmi2ValueReference found = first;
    while (choice < 200 && found < unit->variable_count && unit->variables[found].info->kind != kind) {
        found++;
    }
    return found;
}

static bool absent(void) {
    return byte() > 250;
}

static const fmi2ValueReference *some_references(const Unit *unit, Kind kind, size_t count, size_t room) {
    for (size_t i = 0; i < count && i < MOST; i++) {
        LAST(reference_room[room], count)[i] = some_reference(unit, kind);
    }
    return absent() ? NULL : LAST(reference_room[room], count);
}

/* Half of them within a factor of the start value: those are mostly allowed. */
static double some_real(const Unit *unit, fmi2ValueReference reference) {
    const unsigned kind = byte();
    if (kind < 128 || reference >= unit->variable_count) {
        return number();
    }
    const VariableInfo *info = unit->variables[reference].info;
    return kind < 132   ? info->min
           : kind < 136 ? info->max
                        : info->start * (1 + 0.01 * ((int)kind - 192)) + (info->start != 0 ? 0 : 1e-3 * (kind - 192));
}

static fmi2String some_text(void) {
    static char endless[STRING_SIZE + 2];
    memset(endless, 'x', STRING_SIZE);
    const fmi2String known[] = {"", other_modes, "no such file", NULL, endless, endless + 1, "\xff%n\n", "?"};
    return known[byte() % (sizeof known / sizeof *known)];
}

static double some_step(const Pair *pair) {
    const unsigned kind = byte();
    return kind < 128   ? 1e-4 * (1 + kind % 16)
           : kind < 160 ? 1e-6 * kind
           : kind < 176 ? pair->stop - pair->time
                        : number();
}

static double some_time(const Pair *pair) {
    const unsigned kind = byte();
    return kind < 200   ? pair->time
           : kind < 216 ? nextafter(pair->time, kind % 2 ? INFINITY : -INFINITY)
           : kind < 224 ? pair->time + 1e-6
                        : number();
}

static Asked some_call(const Pair *pair, Call call) {
    static const fmi2String categories[] = {
        "logAll", "logStatusError", "logStatusWarning", "logEvents", "logFmi2Call", "%s", NULL, ""};
    const Unit *unit = pair->unit;
    Asked asked = {.call = call, .nobody = byte() > 253};
    asked.kind = call == CALL_GetInteger || call == CALL_SetInteger   ? KIND_INTEGER
                 : call == CALL_GetBoolean || call == CALL_SetBoolean ? KIND_BOOLEAN
                 : call == CALL_GetString || call == CALL_SetString   ? KIND_STRING
                                                                      : KIND_REAL;
    switch (call) {
    case CALL_SetDebugLogging:
    case CALL_GetReal:
    case CALL_GetInteger:
    case CALL_GetBoolean:
    case CALL_GetString:
    case CALL_SetReal:
    case CALL_SetInteger:
    case CALL_SetBoolean:
    case CALL_SetString:
    case CALL_GetDirectionalDerivative:
    case CALL_SetRealInputDerivatives:
    case CALL_GetRealOutputDerivatives:
        asked.flag = byte() < 200;
        asked.count = some_count();
        asked.references = some_references(unit, asked.kind, asked.count, 0);
        asked.reals = absent() ? NULL : LAST(real_room, asked.count);
        asked.wholes = asked.reals == NULL ? NULL : LAST(whole_room, asked.count);
        asked.orders = absent() ? NULL : LAST(order_room, asked.count);
        asked.texts = asked.reals == NULL ? NULL : LAST(text_room, asked.count);
        if (call == CALL_GetDirectionalDerivative) {
            asked.known_count = some_count();
            asked.knowns = some_references(unit, KIND_REAL, asked.known_count, 1);
        }
        for (size_t i = 0; i < asked.count && i < MOST; i++) {
            LAST(order_room, asked.count)[i] = byte() > 250 ? (int)bytes(4) : 1;
            if (call == CALL_SetReal || call == CALL_SetRealInputDerivatives) {
                LAST(real_room, asked.count)[i] = some_real(unit, LAST(reference_room[0], asked.count)[i]);
            }
            if (call == CALL_SetInteger || call == CALL_SetBoolean) {
                LAST(whole_room, asked.count)[i] = byte() < 200 ? (int)byte() % 8 - 1 : (int)bytes(4);
            }
            if (call == CALL_SetString) {
                LAST(text_room, asked.count)[i] = some_text();
            }
            if (call == CALL_SetDebugLogging) {
                LAST(text_room, asked.count)[i] = categories[byte() % (sizeof categories / sizeof *categories)];
            }
        }
        break;
    case CALL_SetupExperiment:
        asked.flag = byte() < 64;
        asked.t = byte() < 128 ? 0 : number();
        asked.h = byte() < 128 ? asked.t + 1 : number();
        break;
    case CALL_DoStep:
        asked.t = some_time(pair);
        asked.h = some_step(pair);
        break;
    default:
        asked.flag = absent();
        asked.status_kind = (int)(byte() % 6) - 1;
        break;
    }
    return asked;
}

#endif
