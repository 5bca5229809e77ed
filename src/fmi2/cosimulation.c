/* The FMI 2.0 functions of co-simulation: derivatives, steps, status. */
#include <string.h>

#include "derivatives.h"
#include "fmi2Functions.h"
#include "log.h"
#include "shell.h"

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[]) {
    BEGIN(GetDirectionalDerivative, "nUnknown = %.0f, nKnown = %.0f", (double)nUnknown, (double)nKnown);
    return STATUS(derivatives_get_directional(unit, nUnknown, vUnknown_ref, nKnown, vKnown_ref, dvKnown, dvUnknown));
}

RARE static fmi2Status set_slopes(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
                                  const fmi2Real value[]) {
    BEGIN(SetRealInputDerivatives, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(derivatives_set_inputs(unit, nvr, vr, order, value));
}

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[]) {
    return derivatives_set_usual(c, nvr, vr, order, value) ? fmi2OK : set_slopes(c, vr, nvr, order, value);
}

RARE static fmi2Status get_slopes(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
                                  fmi2Real value[]) {
    BEGIN(GetRealOutputDerivatives, "nvr = %.0f, vr = %u, ...", (double)nvr, nvr > 0 && vr != NULL ? vr[0] : 0);
    return STATUS(derivatives_get_outputs(unit, nvr, vr, order, value));
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[]) {
    return derivatives_get_usual(c, nvr, vr, order, value) ? fmi2OK : get_slopes(c, vr, nvr, order, value);
}

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint) {
    (void)noSetFMUStatePriorToCurrentPoint; /* nothing is kept for going back that could be let go */
    if (c != NULL) {
        ((Unit *)c)->step_time = currentCommunicationPoint;
        ((Unit *)c)->step_size = communicationStepSize;
    }
    BEGIN(DoStep, "called");
    return STATUS(run_step(unit, currentCommunicationPoint, communicationStepSize));
}

fmi2Status fmi2CancelStep(fmi2Component c) {
    BEGIN(CancelStep, "called");
    return fmi2Error;
}

/* --- status: what is not known is answered by fmi2Discard, as the standard says */

static const char *const status_kinds[] = {"fmi2DoStepStatus", "fmi2PendingStatus", "fmi2LastSuccessfulTime",
                                           "fmi2Terminated"};

static bool asks_for(Unit *unit, fmi2StatusKind asked, fmi2StatusKind known, const void *value) {
    if (asked == known && value != NULL) {
        return true;
    }
    unit_warn(unit, "%s is not known here; allowed is %s, with a pointer to where its value goes",
              (unsigned)asked < sizeof status_kinds / sizeof *status_kinds ? status_kinds[asked]
                                                                           : "an unknown status kind",
              status_kinds[known]);
    return false;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value) {
    BEGIN(GetStatus, "kind = %d", (int)s);
    if (!asks_for(unit, s, fmi2DoStepStatus, value)) {
        return fmi2Discard;
    }
    *value = (fmi2Status)unit_header(unit)->last_step;
    return fmi2OK;
}

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value) {
    BEGIN(GetRealStatus, "kind = %d", (int)s);
    if (!asks_for(unit, s, fmi2LastSuccessfulTime, value)) {
        return fmi2Discard;
    }
    *value = unit_header(unit)->time;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value) {
    (void)value;
    BEGIN(GetIntegerStatus, "kind = %d", (int)s);
    unit_warn(unit, "FMI 2.0 knows no Integer status");
    return fmi2Discard;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value) {
    BEGIN(GetBooleanStatus, "kind = %d", (int)s);
    if (!asks_for(unit, s, fmi2Terminated, value)) {
        return fmi2Discard;
    }
    *value = fmi2False; /* no model ends a simulation by itself */
    return fmi2OK;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value) {
    BEGIN(GetStringStatus, "kind = %d", (int)s);
    if (!asks_for(unit, s, fmi2PendingStatus, value)) {
        return fmi2Discard;
    }
    *value = "no step is pending: steps are synchronous";
    return fmi2OK;
}
