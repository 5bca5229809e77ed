/* Cost of a unit's fmi2DoStep alone: no Python, no ctypes in between.
 *
 * usage: dostep LIBRARY IDENTIFIER GUID RESOURCES STEPS INPUT_REFERENCE AMPLITUDE OUTPUT_REFERENCE
 *
 * Drives one Real input with a slow sine (so that the unit passes through its branches), takes 125 us steps, and prints
 * nanoseconds per step: doStep alone, and with setting the input, its slope, and reading the output around it. */
#define _POSIX_C_SOURCE 200112L
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "fmi2FunctionTypes.h"

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t); /* what other programs take does not count */
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void *symbol(void *library, const char *name) {
    void *address = dlsym(library, name);
    if (!address) {
        fprintf(stderr, "dostep: %s is missing\n", name);
        exit(2);
    }
    return address;
}

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    (void)environment;
    (void)category;
    if (status > fmi2Warning) {
        fprintf(stderr, "%s: %s\n", name, message);
    }
}

int main(int count, char **words) {
    if (count != 9) {
        fprintf(stderr, "usage: dostep LIBRARY IDENTIFIER GUID RESOURCES STEPS INPUT AMPLITUDE OUTPUT\n");
        return 2;
    }
    void *library = dlopen(words[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) {
        fprintf(stderr, "dostep: %s\n", dlerror());
        return 2;
    }
    fmi2InstantiateTYPE *instantiate;
    fmi2SetupExperimentTYPE *setup;
    fmi2EnterInitializationModeTYPE *enter;
    fmi2ExitInitializationModeTYPE *leave;
    fmi2SetRealTYPE *set;
    fmi2GetRealTYPE *get;
    fmi2SetRealInputDerivativesTYPE *set_slope;
    fmi2DoStepTYPE *step;
    fmi2FreeInstanceTYPE *release;
    *(void **)&instantiate = symbol(library, "fmi2Instantiate");
    *(void **)&setup = symbol(library, "fmi2SetupExperiment");
    *(void **)&enter = symbol(library, "fmi2EnterInitializationMode");
    *(void **)&leave = symbol(library, "fmi2ExitInitializationMode");
    *(void **)&set = symbol(library, "fmi2SetReal");
    *(void **)&get = symbol(library, "fmi2GetReal");
    *(void **)&set_slope = symbol(library, "fmi2SetRealInputDerivatives");
    *(void **)&step = symbol(library, "fmi2DoStep");
    *(void **)&release = symbol(library, "fmi2FreeInstance");

    const fmi2CallbackFunctions callbacks = {logger, calloc, free, NULL, NULL};
    const long steps = atol(words[5]);
    const fmi2ValueReference input = (fmi2ValueReference)atoi(words[6]);
    const double amplitude = atof(words[7]);
    const fmi2ValueReference output = (fmi2ValueReference)atoi(words[8]);
    const double h = 125e-6, omega = 6.0;
    const fmi2Integer first = 1;

    for (int with_exchange = 0; with_exchange < 2; with_exchange++) {
        fmi2Component unit = instantiate(words[2], fmi2CoSimulation, words[3], words[4], &callbacks, 0, 0);
        if (!unit || setup(unit, 0, 0, 0, 0, 0) > fmi2Warning || enter(unit) > fmi2Warning ||
            leave(unit) > fmi2Warning) {
            return 2;
        }
        double spent = 0, value = 0;
        for (long k = 0; k < steps; k++) {
            const double t = (double)k * h;
            const double u = amplitude * sin(omega * t), slope = amplitude * omega * cos(omega * t);
            const double begun = with_exchange ? now() : 0;
            set(unit, &input, 1, &u);
            set_slope(unit, &input, 1, &first, &slope);
            const double mid = with_exchange ? begun : now();
            if (step(unit, t, h, fmi2True) > fmi2Warning) {
                return 2;
            }
            const double end = with_exchange ? 0 : now();
            get(unit, &output, 1, &value);
            spent += (with_exchange ? now() : end) - mid;
        }
        /* the clock's own cost, measured the same way, is taken off */
        double clock_cost = 0;
        for (long k = 0; k < steps; k++) {
            const double begun = now();
            clock_cost += now() - begun;
        }
        printf("%.2f\n", 1e9 * (spent - clock_cost) / (double)steps);
        release(unit);
    }
    return 0;
}
