/* What a page calls of the unit `machine`: an instance, its parameters, and a run as one call. The FMI's functions are
 * called from here; numbers are handed over in the module's memory. Statuses are those of the FMI. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

#define EXPORTED(name) __attribute__((export_name(#name), used)) name
enum { FILES = 8, NAME = 32, TEXT = 4096, FLAGS = 64 };

__attribute__((import_module("page"), import_name("say"))) void page_say(int status, const char *text);
const char *page_file(const char *name, size_t *size);

static struct {
    char name[NAME];
    const char *bytes;
    size_t size;
} files[FILES];
static fmi2Component unit;

/* --- what the unit asks for */

const char *page_file(const char *name, size_t *size) {
    for (size_t i = 0; i < FILES; i++) {
        if (files[i].bytes != NULL && strcmp(files[i].name, name) == 0) {
            *size = files[i].size;
            return files[i].bytes;
        }
    }
    return NULL;
}

static void say(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                fmi2String message, ...) {
    static char text[TEXT];
    (void)environment, (void)instance, (void)category;
    va_list values;
    va_start(values, message);
    vsnprintf(text, sizeof text, message, values);
    va_end(values);
    page_say(status, text);
}

static const fmi2CallbackFunctions callbacks = {say, calloc, free, NULL, NULL};

/* --- an instance */

void *EXPORTED(page_alloc)(size_t size) {
    return malloc(size);
}

void EXPORTED(page_free)(void *memory) {
    free(memory);
}

/* A resource file; the bytes stay where they are. */
int EXPORTED(page_give)(const char *name, const char *bytes, size_t size) {
    for (size_t i = 0; i < FILES && strlen(name) < NAME; i++) {
        if (files[i].bytes == NULL || strcmp(files[i].name, name) == 0) {
            strcpy(files[i].name, name);
            files[i].bytes = bytes;
            files[i].size = size;
            return fmi2OK;
        }
    }
    return fmi2Error;
}

int EXPORTED(page_open)(const char *guid) {
    unit = fmi2Instantiate("machine", fmi2CoSimulation, guid, "file:///page", &callbacks, fmi2False, fmi2False);
    return unit != NULL ? fmi2OK : fmi2Error;
}

int EXPORTED(page_reset)(void) {
    return fmi2Reset(unit);
}

int EXPORTED(page_set_real)(fmi2ValueReference variable, double value) {
    return fmi2SetReal(unit, &variable, 1, &value);
}

int EXPORTED(page_set_integer)(fmi2ValueReference variable, int value) {
    return fmi2SetInteger(unit, &variable, 1, &value);
}

int EXPORTED(page_set_boolean)(fmi2ValueReference variable, int value) {
    return fmi2SetBoolean(unit, &variable, 1, &value);
}

/* --- a run */

/* Initialisation, with the first row of what is fed. */
int EXPORTED(page_begin)(double stop, size_t fed, const fmi2ValueReference *feeds, const double *first) {
    int status = fmi2SetupExperiment(unit, fmi2False, 0, 0, fmi2True, stop);
    status = status > fmi2Warning ? status : fmi2EnterInitializationMode(unit);
    status = status > fmi2Warning ? status : fmi2SetReal(unit, feeds, fed, first);
    return status > fmi2Warning ? status : fmi2ExitInitializationMode(unit);
}

/* The cycles `first` to `last` - 1 of T_c [s]. Row k/ratio of `rows` is fed ahead of cycle k, where k is a whole
 * multiple; ahead of every `every`-th cycle, and of `last` where that is one and `end` is set, a row of reals and then
 * of flags is written to `out`. */
int EXPORTED(page_run)(int first, int last, int end, double T_c, int ratio, size_t fed, const fmi2ValueReference *feeds,
                       const double *rows, int every, size_t reals, const fmi2ValueReference *real, size_t flags,
                       const fmi2ValueReference *flag, double *out) {
    fmi2Boolean set[FLAGS];
    for (int k = first; flags <= FLAGS && (k < last || (end && k == last)); k++) {
        int status = fmi2OK;
        if (k % ratio == 0) {
            status = fmi2SetReal(unit, feeds, fed, rows + (size_t)(k / ratio) * fed);
        }
        if (status <= fmi2Warning && k % every == 0) {
            status = fmi2GetReal(unit, real, reals, out);
            out += reals;
            if (status <= fmi2Warning && flags > 0) {
                status = fmi2GetBoolean(unit, flag, flags, set);
            }
            for (size_t i = 0; i < flags; i++) {
                *out++ = set[i];
            }
        }
        if (status <= fmi2Warning && k < last) {
            status = fmi2DoStep(unit, k * T_c, T_c, fmi2True);
        }
        if (status > fmi2Warning) {
            return status;
        }
    }
    return flags <= FLAGS ? fmi2OK : fmi2Error;
}
