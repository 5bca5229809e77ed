/* The units linked into one program, as targets without dynamic loading do it: every function of the FMI carries
 * its unit's prefix, and nothing else may clash. Arguments: GUID and resources of each unit, in the order
 * of UNITS. */
#include <stdio.h>

#include "fmi2FunctionTypes.h"

#define UNITS(U) U(friction) U(friction_gms) U(controller) U(plant) U(setpoint) U(machine)

#define DECLARE(unit)                                                                                                  \
    extern fmi2InstantiateTYPE unit##_fmi2Instantiate;                                                                 \
    extern fmi2SetupExperimentTYPE unit##_fmi2SetupExperiment;                                                         \
    extern fmi2EnterInitializationModeTYPE unit##_fmi2EnterInitializationMode;                                         \
    extern fmi2ExitInitializationModeTYPE unit##_fmi2ExitInitializationMode;                                           \
    extern fmi2DoStepTYPE unit##_fmi2DoStep;                                                                           \
    extern fmi2FreeInstanceTYPE unit##_fmi2FreeInstance;
UNITS(DECLARE)

#define ROW(unit)                                                                                                      \
    {#unit,                                                                                                            \
     unit##_fmi2Instantiate,                                                                                           \
     unit##_fmi2SetupExperiment,                                                                                       \
     unit##_fmi2EnterInitializationMode,                                                                               \
     unit##_fmi2ExitInitializationMode,                                                                                \
     unit##_fmi2DoStep,                                                                                                \
     unit##_fmi2FreeInstance},
static const struct {
    const char *name;
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *set_up;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2DoStepTYPE *step;
    fmi2FreeInstanceTYPE *release;
} units[] = {UNITS(ROW)};

enum { COUNT = sizeof units / sizeof *units };

int main(int count, char *arguments[]) {
    if (count != 1 + 2 * COUNT) {
        return 2;
    }
    int good = 0;
    for (int i = 0; i < COUNT; i++) {
        const char *guid = arguments[1 + 2 * i], *resources = arguments[2 + 2 * i];
        fmi2Component c =
            units[i].instantiate(units[i].name, fmi2CoSimulation, guid, resources, NULL, fmi2False, fmi2False);
        /* each binary knows its own GUID, so a mix-up does not get past this */
        fmi2Component wrong =
            units[(i + 1) % COUNT].instantiate("wrong", fmi2CoSimulation, guid, resources, NULL, fmi2False, fmi2False);
        if (c == NULL || wrong != NULL) {
            continue;
        }
        if (units[i].set_up(c, fmi2False, 0, 0, fmi2False, 0) == fmi2OK && units[i].enter(c) == fmi2OK &&
            units[i].leave(c) == fmi2OK && units[i].step(c, 0, 125e-6, fmi2True) == fmi2OK) {
            good++;
        }
        units[i].release(c);
    }
    printf("%d units in one program: %d passed, %d failed\n", COUNT, good, COUNT - good);
    return good != COUNT;
}
