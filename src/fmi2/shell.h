/* One instance of a unit, as the rooms of the shell share it. Models never see this file. */
#ifndef FEEDSIM_SHELL_H
#define FEEDSIM_SHELL_H

#include <stdint.h>

#include "calls.h"
#include "fmi2Functions.h"
#include "hash.h"
#include "log.h"
#include "unit.h"

#define GUID_SIZE (2 * HASH_TEXT_SIZE) /* <hash of the table>-<hash of the resources> */

/* First part of the block: where the instance is in its life. */
typedef struct Header {
    double start_time;
    double stop_time; /* INFINITY where none is defined */
    double time;      /* last communication point reached */
    uint64_t steps;
    uint32_t phase;     /* a Phase */
    uint32_t stale;     /* initialisation: parameters or inputs changed since start() */
    uint32_t sloped;    /* an input slope is set for the next step */
    uint32_t last_step; /* fmi2Status of the last step */
} Header;

/* The block: Header, Scalars, AxisBlock[axes], slopes [one double per value reference], model state. */
#define BLOCK_ALIGNED(size) (((size) + 15) / 16 * 16)
#define SCALARS_AT BLOCK_ALIGNED(sizeof(Header))
#define AXES_AT (SCALARS_AT + BLOCK_ALIGNED(sizeof(Scalars)))

/* What the calls of every step ask of a variable, in two words. */
enum {
    READY_REAL = 1, /* a Real that holds its value at all times */
    FREE_INPUT = 2, /* a Real input that takes every finite number */
    REAL_INPUT = 4,
    REAL_OUTPUT = 8,
};

typedef struct Slot {
    uint32_t offset; /* in the block */
    uint32_t is;     /* of the above */
} Slot;

typedef struct Variable {
    const VariableInfo *info;
    size_t offset; /* in the block */
} Variable;

struct Unit {
    /* Ahead, since close together: what the calls of every step need. */
    unsigned char *block;
    Slot *slots; /* by value reference */
    size_t variable_count;
    size_t slopes_at, state_at;
    void *derived;
    unsigned log_categories;
    Call call; /* the function being executed, and its step: where a message belongs */
    bool derived_valid;
    bool parameters_touched; /* they may differ from derived_for */
    bool late;               /* the late outputs are those of an earlier step */
    bool tame;               /* no input, and no slope of one, is beyond TAME in size */
    double step_time, step_size;
    unsigned *inputs;  /* value references of the Real inputs */
    uint32_t *results; /* where in the block the Real outputs and locals lie that a step writes */
    size_t input_count, result_count;

    Variable *variables; /* by value reference */
    size_t block_size;
    unsigned char *start;       /* variables as load() left them, for reset */
    unsigned char *derived_for; /* variables that the derived data was made from */
    size_t axes;
    char **axis_names;
    fmi2CallbackFunctions callbacks; /* memory functions always set, logger may be NULL */
    char *name;
    char guid[GUID_SIZE];
    char *location; /* as the importer gave it */
    char *resources;
};

static inline Header *unit_header(const Unit *unit) {
    return (Header *)(void *)unit->block;
}

static inline double *unit_slopes(const Unit *unit) {
    return (double *)(void *)(unit->block + unit->slopes_at);
}

static inline void *unit_address(const Unit *unit, const Variable *variable) {
    return unit->block + variable->offset;
}

/* The Real of that reference. */
static inline double *unit_real(const Unit *unit, unsigned reference) {
    return (double *)(void *)(unit->block + unit->slots[reference].offset);
}

/* --- table.c */
extern const VariableInfo table_scalars[SCALAR_ROWS + 1];
extern const VariableInfo table_axis[AXIS_ROWS + 1];
char *table_hash(char *text); /* text[HASH_TEXT_SIZE], which is returned */
const char *table_causality(Causality causality);
#define VARIABLE_NAME_SIZE 256
/* "F_S", or "X.M_a" for a row of axis X, written to name[VARIABLE_NAME_SIZE]; returns name. */
char *table_name(const Unit *unit, const Variable *variable, char *name);

/* --- unit.c */
Unit *unit_create(const fmi2CallbackFunctions *callbacks, const char *name);
void unit_destroy(Unit *unit);
char *unit_copy_text(Unit *unit, const char *text);
bool unit_keep_start(Unit *unit);                      /* the present variables are those that reset brings back */
bool unit_resize_state(Unit *unit, size_t state_size); /* keeps all but the model state, which is zeroed */

/* --- run.c: false with the reason logged */
bool run_derive(Unit *unit, bool may_resize); /* where parameters changed since the last time */
bool run_derived_for(const Unit *unit,
                     const unsigned char *block); /* the coefficients are those of block's parameters */
bool run_refresh(Unit *unit);                     /* initial values that belong to the present parameters and inputs */
bool run_step(Unit *unit, double t, double h);
bool run_show_late(Unit *unit); /* late outputs that belong to the present state */
void run_reset(Unit *unit);

/* What an error takes is kept out of the way of what happens in every step. */
#ifdef __GNUC__
#define RARE __attribute__((cold, noinline))
#else
#define RARE
#endif

/* Between steps, and nobody wants to hear of calls: what the calls of every step need not look at any further. */
static inline bool unit_usual(const Unit *unit) {
    return unit != NULL && unit_header(unit)->phase == PHASE_STEPPING && !(unit->log_categories & LOG_CALLS);
}

/* call_begin(), for a function whose states are known where it is compiled. */
static inline bool call_begin_in(Unit *unit, Call call, unsigned phases) {
    if (unit == NULL || !(phases & 1u << unit_header(unit)->phase)) {
        return call_begin(unit, call);
    }
    unit->call = call;
    return true;
}

/* --- entry points: how each of them opens, with its arguments as the log of calls shows them, and what it returns */
#define BEGIN(call, ...)                                                                                               \
    Unit *unit = c;                                                                                                    \
    if (unit != NULL && (unit->log_categories & LOG_CALLS))                                                            \
        call_tell(unit, CALL_##call, __VA_ARGS__);                                                                     \
    if (!call_begin_in(unit, CALL_##call, PHASES_##call))                                                              \
    return fmi2Error
#define STATUS(good) ((good) ? fmi2OK : fmi2Error)

#endif
