/* As little of FMI 2.0 co-simulation as an archive needs that nobody here has made: variables by number, no slopes, no
 * saved states. A unit includes this after it has defined REALS, BOOLEANS and `advance`, which takes a step. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#ifndef BEFORE_INSTANTIATION
#define BEFORE_INSTANTIATION
#endif
/* What fmi2Terminate returns, and what is done ahead of fmi2FreeInstance. */
#ifndef TERMINATION
#define TERMINATION(unit) fmi2OK
#define BEFORE_FREEING(unit)
#endif

/* Habits of exporters; a program is compiled with one of them. */
#define STRICT_STOP 1 /* a step that ends behind the stop time is refused, to the last bit */
#define SUMMED_STOP 2 /* the same by a clock that sums up the steps */
#define LATE_SLOPES 3 /* slopes are differences of two steps: there are none before */
#define NO_SLOPES 4   /* nor behind */
#ifndef HABIT
#define HABIT 0
#endif

typedef struct Unit {
    double real[REALS];
    fmi2Boolean boolean[BOOLEANS];
    double state, stop, clock;
    int steps;
    const fmi2CallbackFunctions *callbacks;
} Unit;

static const double STARTS[REALS];
static fmi2Status advance(Unit *unit, double h);

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String categories[]) {
    (void)c, (void)on, (void)categories;
    return n ? fmi2Error : fmi2OK; /* it has no categories */
}
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                              const fmi2CallbackFunctions *callbacks, fmi2Boolean visible, fmi2Boolean logging) {
    (void)name, (void)resources, (void)visible, (void)logging;
    BEFORE_INSTANTIATION
    if (type != fmi2CoSimulation || strcmp(guid, GUID) != 0)
        return NULL;
    Unit *unit = calloc(1, sizeof *unit);
    if (unit == NULL)
        return NULL;
    unit->callbacks = callbacks;
    memcpy(unit->real, STARTS, sizeof STARTS);
    return unit;
}
void fmi2FreeInstance(fmi2Component c) {
    BEFORE_FREEING((Unit *)c)
    free(c);
}
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean a, fmi2Real b, fmi2Real t, fmi2Boolean d, fmi2Real e) {
    (void)a, (void)b;
    Unit *unit = c;
    unit->clock = t;
    unit->stop = d ? e : INFINITY;
    return fmi2OK;
}
fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
fmi2Status fmi2Terminate(fmi2Component c) { return c ? TERMINATION((Unit *)c) : fmi2Error; }
fmi2Status fmi2Reset(fmi2Component c) { return c ? fmi2OK : fmi2Error; }

fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= REALS)
            return fmi2Error;
        value[i] = ((Unit *)c)->real[vr[i]];
    }
    return fmi2OK;
}
fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Real value[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= REALS)
            return fmi2Error;
        ((Unit *)c)->real[vr[i]] = value[i];
    }
    return fmi2OK;
}
fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, fmi2Boolean value[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= BOOLEANS)
            return fmi2Error;
        value[i] = ((Unit *)c)->boolean[vr[i]];
    }
    return fmi2OK;
}
fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference vr[], size_t n, const fmi2Boolean value[]) {
    for (size_t i = 0; i < n; i++) {
        if (vr[i] >= BOOLEANS)
            return fmi2Error;
        ((Unit *)c)->boolean[vr[i]] = value[i];
    }
    return fmi2OK;
}
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_return) {
    (void)no_return;
    Unit *unit = c;
    unit->steps++;
    unit->clock += h;
    if ((HABIT == STRICT_STOP && t + h > unit->stop) || (HABIT == SUMMED_STOP && unit->clock > unit->stop))
        return fmi2Error;
    return advance(c, h);
}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t n,
                                        const fmi2Integer order[], fmi2Real v[]) {
    (void)vr, (void)order;
    for (size_t i = 0; i < n; i++)
        v[i] = HABIT == NO_SLOPES || ((Unit *)c)->steps < 2 ? NAN : 0;
    return HABIT >= LATE_SLOPES ? fmi2OK : fmi2Error;
}

/* What it cannot do. */
#define VR const fmi2ValueReference vr[], size_t n
#define CANNOT(name, ...) \
    fmi2Status name(fmi2Component c, __VA_ARGS__) { return c == NULL ? fmi2Fatal : fmi2Error; }
CANNOT(fmi2GetInteger, VR, fmi2Integer v[])
CANNOT(fmi2SetInteger, VR, const fmi2Integer v[])
CANNOT(fmi2GetString, VR, fmi2String v[])
CANNOT(fmi2SetString, VR, const fmi2String v[])
CANNOT(fmi2GetFMUstate, fmi2FMUstate *s)
CANNOT(fmi2SetFMUstate, fmi2FMUstate s)
CANNOT(fmi2FreeFMUstate, fmi2FMUstate *s)
CANNOT(fmi2SerializedFMUstateSize, fmi2FMUstate s, size_t *n)
CANNOT(fmi2SerializeFMUstate, fmi2FMUstate s, fmi2Byte b[], size_t n)
CANNOT(fmi2DeSerializeFMUstate, const fmi2Byte b[], size_t n, fmi2FMUstate *s)
CANNOT(fmi2GetDirectionalDerivative, VR, const fmi2ValueReference k[], size_t m, const fmi2Real d[], fmi2Real v[])
CANNOT(fmi2SetRealInputDerivatives, VR, const fmi2Integer order[], const fmi2Real v[])
fmi2Status fmi2CancelStep(fmi2Component c) { return c == NULL ? fmi2Fatal : fmi2Error; }
CANNOT(fmi2GetStatus, const fmi2StatusKind k, fmi2Status *v)
CANNOT(fmi2GetRealStatus, const fmi2StatusKind k, fmi2Real *v)
CANNOT(fmi2GetIntegerStatus, const fmi2StatusKind k, fmi2Integer *v)
CANNOT(fmi2GetBooleanStatus, const fmi2StatusKind k, fmi2Boolean *v)
CANNOT(fmi2GetStringStatus, const fmi2StatusKind k, fmi2String *v)
