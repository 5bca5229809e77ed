/* What the tests of the shell share: instances of the toy unit in a given state, what they log, what they allocate. */
#ifndef TOY_H
#define TOY_H

#include <stddef.h>

#include "check.h"
#include "shell.h"

#define NO_RESOURCES "cbf29ce484222325"
#define AXIS(axis, row) ((fmi2ValueReference)(SCALAR_ROWS + (axis) * AXIS_ROWS + AXIS_VR_##row))

/* The last message, and how many there were. Give its address as componentEnvironment. */
typedef struct Log {
    char message[8192];
    char category[64];
    char instance[64];
    fmi2Status status;
    int count;
} Log;

void log_record(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status, fmi2String category,
                fmi2String message, ...);

/* Allocation that counts, and fails from the n-th call on (never where negative). */
typedef struct Memory {
    long allocations; /* so far */
    long held;        /* not yet freed */
    long fail_at;
} Memory;
extern Memory memory;
void *memory_allocate(size_t count, size_t size);
void memory_free(void *bytes);

const char *toy_guid(void);
fmi2Component toy_instantiate(Log *log, fmi2Boolean logging); /* all callbacks; log may be NULL */
fmi2Component toy_in(Phase phase, Log *log);                  /* an instance brought to that state */
void toy_enter(fmi2Component c, Phase phase);                 /* an instance in 'instantiated' brought to that state */

double get_real(fmi2Component c, fmi2ValueReference vr);
fmi2Status set_real(fmi2Component c, fmi2ValueReference vr, double value);
int get_integer(fmi2Component c, fmi2ValueReference vr);
fmi2Status set_integer(fmi2Component c, fmi2ValueReference vr, int value);
int get_boolean(fmi2Component c, fmi2ValueReference vr);
fmi2Status set_boolean(fmi2Component c, fmi2ValueReference vr, int value);
const char *get_string(fmi2Component c, fmi2ValueReference vr);
fmi2Status set_string(fmi2Component c, fmi2ValueReference vr, const char *value);
fmi2Status set_slope(fmi2Component c, fmi2ValueReference vr, double value);

/* The instance as bytes, for comparison; as many as *size says. */
#define IMAGE_SIZE 16384
void image_of(fmi2Component c, char *bytes, size_t *size);
bool same_image(fmi2Component c, const char *bytes, size_t size);

#endif
