/* A unit's shared library, loaded: its functions by name, and what variables it has, found by asking. For programs that
 * run whole units from outside, as an importer does. A program is one file that includes this once. */
#ifndef LOADED_H
#define LOADED_H

#include <dlfcn.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "fmi2FunctionTypes.h"

enum { MOST = 4096 };

/* The functions of the library, by their types in the standard's header. */
#define FUNCTIONS(F)                                                                                                   \
    F(GetVersion);                                                                                                     \
    F(GetTypesPlatform);                                                                                               \
    F(SetDebugLogging);                                                                                                \
    F(Instantiate);                                                                                                    \
    F(FreeInstance);                                                                                                   \
    F(SetupExperiment);                                                                                                \
    F(EnterInitializationMode);                                                                                        \
    F(ExitInitializationMode);                                                                                         \
    F(Terminate);                                                                                                      \
    F(Reset);                                                                                                          \
    F(GetReal);                                                                                                        \
    F(GetInteger);                                                                                                     \
    F(GetBoolean);                                                                                                     \
    F(GetString);                                                                                                      \
    F(SetReal);                                                                                                        \
    F(SetInteger);                                                                                                     \
    F(SetBoolean);                                                                                                     \
    F(SetString);                                                                                                      \
    F(GetFMUstate);                                                                                                    \
    F(SetFMUstate);                                                                                                    \
    F(FreeFMUstate);                                                                                                   \
    F(SerializedFMUstateSize);                                                                                         \
    F(SerializeFMUstate);                                                                                              \
    F(DeSerializeFMUstate);                                                                                            \
    F(GetDirectionalDerivative);                                                                                       \
    F(SetRealInputDerivatives);                                                                                        \
    F(GetRealOutputDerivatives);                                                                                       \
    F(DoStep);                                                                                                         \
    F(CancelStep);                                                                                                     \
    F(GetStatus);                                                                                                      \
    F(GetRealStatus);                                                                                                  \
    F(GetIntegerStatus);                                                                                               \
    F(GetBooleanStatus);                                                                                               \
    F(GetStringStatus);
#define MEMBER(name) fmi2##name##TYPE *name
static struct {
    FUNCTIONS(MEMBER)
} fmu;

static int faults;

static inline void must(bool good, const char *what) {
    if (!good) {
        printf("failed: %s\n", what);
        faults++;
    }
}
#define MUST(call) must((call) == fmi2OK, #call)

static inline void tell(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                        fmi2String category, fmi2String message, ...) {
    (void)environment;
    printf("%s [%s, %d] %s\n", instance, category, (int)status, message);
}

static inline void *symbol(void *library, const char *name) {
    void *found = dlsym(library, name);
    if (found == NULL) {
        printf("%s is missing\n", name);
        faults++;
    }
    return found;
}

/* A function pointer out of an object pointer: POSIX allows it, ISO C has no cast for it. */
#define FIND(name)                                                                                                     \
    do {                                                                                                               \
        void *found = symbol(library, "fmi2" #name);                                                                   \
        memcpy(&fmu.name, &found, sizeof found);                                                                       \
    } while (0)

/* false, and told, where it cannot be loaded or lacks a function. */
static inline bool load(const char *path) {
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        printf("%s\n", dlerror());
        return false;
    }
    FUNCTIONS(FIND)
    return faults == 0;
}

/* --- what the unit has */

typedef struct Interface {
    fmi2ValueReference reals[MOST], inputs[MOST], outputs[MOST];
    size_t real_count, input_count, output_count;
} Interface;

/* An instance between two steps tells them apart: Real variables can be read, Real inputs take a slope, Real outputs
 * give one. */
static inline void explore(fmi2Component c, Interface *found) {
    const int order = 1;
    double value;
    memset(found, 0, sizeof *found);
    MUST(fmu.SetDebugLogging(c, fmi2True, 1,
                             (const fmi2String[]){"logEvents"})); /* no errors: they are the answer here */
    for (fmi2ValueReference vr = 0; vr < MOST; vr++) {
        if (fmu.GetReal(c, &vr, 1, &value) != fmi2OK) {
            continue;
        }
        found->reals[found->real_count++] = vr;
        if (fmu.GetRealOutputDerivatives(c, &vr, 1, &order, &value) == fmi2OK) {
            found->outputs[found->output_count++] = vr;
        }
        value = 0;
        if (fmu.SetRealInputDerivatives(c, &vr, 1, &order, &value) == fmi2OK) {
            found->inputs[found->input_count++] = vr;
        }
    }
    MUST(fmu.SetDebugLogging(c, fmi2False, 0, NULL));
}

#endif
