/* What a model sees of the FMI shell, and what it has to offer.
 *
 * The shell (src/fmi2) knows the FMI 2.0 standard and no physics; a model (model.c of a unit) knows physics and no FMI.
 * The two meet here. A model's memory is of two sorts:
 *   - the BLOCK, one contiguous, pointer-free piece that the shell owns, copies for get/set/serialise state and
 *     restores on reset: variables (Scalars, AxisBlock), input slopes, and the model's own state (state_size() bytes,
 *     zeroed);
 *   - DERIVED data (coefficients, mode tables), which the model allocates in load() and derive() and which is never
 *     copied. */
#ifndef FEEDSIM_UNIT_H
#define FEEDSIM_UNIT_H

#include <stdbool.h>
#include <stddef.h>

#include "prefix.h"
#include "table.h"

typedef struct Unit Unit;

/* --- offered by the shell */

/* Pointers into the block hold until unit_set_axes() is called or derive() returns, either of which may move it. */
Scalars *unit_scalars(Unit *unit);
AxisBlock *unit_axis(Unit *unit, size_t axis); /* axis < unit_axes() */
size_t unit_axes(const Unit *unit);
const char *unit_axis_name(const Unit *unit, size_t axis);
/* Slope [unit of the input per second] that goes with input `vr` in the present step; 0 unless the importer set one. */
double unit_slope(const Unit *unit, unsigned vr);
/* Whether any input may have a slope in the present step; false: all are 0. */
bool unit_sloped(const Unit *unit);
/* The model's own state inside the block; valid after derive(). */
void *unit_state(Unit *unit);
/* Start of the experiment [s], as given by fmi2SetupExperiment (0 without it). */
double unit_start_time(const Unit *unit);

/* Directory of the unpacked resources, a UTF-8 path without closing separator; NULL where the importer gave none. */
const char *unit_resources(const Unit *unit);
/* The resource location as the importer gave it, also where it names no folder; NULL where it gave none. */
const char *unit_location(const Unit *unit);
/* Second half of the instantiation GUID (16 hexadecimal digits): FNV-1a 64 of the resource files the archive was packed
 * with. */
const char *unit_resource_hash(const Unit *unit);

/* load() tells the shell which axes there are; names are copied. false (with a logged error) when memory is short. */
bool unit_set_axes(Unit *unit, size_t count, const char *const *names);

/* load() gives the parameter of that name the start value `value` spells, within its range; false with the reason
 * logged. Behind unit_set_axes(), which begins anew. */
bool unit_set_start(Unit *unit, const char *name, const char *value);

/* The block of an axis that lies behind `scalars`: those of accepts() as well. */
const AxisBlock *unit_axis_behind(const Scalars *scalars, size_t axis);
/* accepts(): the clock of the saved state that `scalars` lies in. `valid`: steps that went well have brought it to
 * `time`; not so where a step failed on its way. */
typedef struct Clock {
    double start, time; /* [s] */
    bool valid;
} Clock;
Clock unit_clock_behind(const Unit *unit, const Scalars *scalars);
/* accepts(): whether the present derived data belongs to the parameters among `scalars` and behind them. */
bool unit_derived_for(const Unit *unit, const Scalars *scalars);

/* To be called in step(), where it leaves the late outputs (see Model) for when they are asked for. */
void unit_leave_late(Unit *unit);

/* Write an output or a local by itself. Compilers else take two that lie side by side at once out of the state, and a
 * processor that has only just written these two one by one waits until they have reached the cache. */
static inline void unit_show(volatile double *variable, double value) {
    *variable = value;
}

/* Pointer to coefficients and tables that the model owns. */
void *unit_derived(const Unit *unit);
void unit_set_derived(Unit *unit, void *derived);

/* Report why load, derive or step fails: printf-style, one sentence that says what, where, the actual value and what is
 * allowed. Returns false, so that a model can write `return unit_fail(unit, ...)`. unit_warn only logs. */
bool unit_fail(Unit *unit, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 2, 3)))
#endif
    ;
void unit_warn(Unit *unit, const char *format, ...)
#ifdef __GNUC__
    __attribute__((format(printf, 2, 3)))
#endif
    ;

/* Zeroed memory from the importer's allocateMemory (calloc where there is none); NULL, with an error logged, when
 * memory is short or count * size overflows. Not to be called in step(). unit_free(unit, NULL) does nothing. */
void *unit_alloc(Unit *unit, size_t count, size_t size);
void unit_free(Unit *unit, void *memory);

/* --- offered by the model */

typedef struct Model {
    const char *identifier; /* "plant", "controller", "friction", "setpoint" */

    /* The archive has resource files; load() checks that they are those of unit_resource_hash(). Without, the shell
     * sees to it that this is the hash of nothing. */
    bool has_resources;

    /* Once, at instantiation: read resources, name the axes, set per-axis start values. NULL where there is nothing to
     * load. */
    bool (*load)(Unit *unit);

    /* Parameters (range-checked one by one by the shell) -> coefficients; refuses combinations that make no sense. May
     * be called again and again while parameters can still change, and after a state with other parameters was
     * restored. */
    bool (*derive)(Unit *unit);

    /* Bytes of model state after derive(). */
    size_t (*state_size)(const Unit *unit);

    /* Whether a saved model state, state[size] made with the variables `scalars`, belongs to the data that derive()
     * finds for them, and every index and count in it lies within that data: the bytes may be anybody's; false with the
     * reason logged. Asked before derive() sees those variables, so that what is refused costs nothing; changes
     * nothing. NULL where derive() depends on the variables alone and the state is of plain numbers. */
    bool (*accepts)(Unit *unit, const Scalars *scalars, const void *state, size_t size);

    /* Initial state and outputs from parameters and the inputs at the start; the state arrives zeroed. Called whenever
     * an initial value is asked for in initialisation mode, and when that mode ends. */
    void (*start)(Unit *unit);

    /* Advance from t to t + h (h > 0, any size). Input i is value_i + slope_i (time - t) within the step. Writes the
     * state, the outputs and the locals. No allocation. */
    bool (*step)(Unit *unit, double t, double h);

    /* Real outputs that mostly nobody reads: value references `late_first` up to `late_end`, without the latter. step()
     * may leave them out (unit_leave_late()); show_late() then writes them from the state, when they are read or the
     * state is saved. It depends on the state and on fixed parameters alone, and on the inputs where
     * `late_reads_inputs`. NULL where there are none. */
    unsigned late_first, late_end;
    bool late_reads_inputs;
    void (*show_late)(Unit *unit);

    /* First derivative of Real output `vr` with respect to time at the end of the last step [unit/s]. */
    double (*output_derivative)(Unit *unit, unsigned vr);

    /* Partial derivative of Real output `output` with respect to Real input `input`. initial: in initialisation mode,
     * of what start() computes; else at the communication point, the state held (0 without direct feed-through). */
    double (*partial)(Unit *unit, unsigned output, unsigned input, bool initial);

    /* Free what unit_derived() points to. NULL where nothing is derived. */
    void (*release)(Unit *unit);
} Model;

extern const Model MODEL;

#endif
