/* Memory of an instance: what the importer's callbacks allocate, the block and its layout, and the model's view of it.
 */
#include "unit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "log.h"
#include "shell.h"

/* --- memory */

void *unit_alloc(Unit *unit, size_t count, size_t size) {
    void *memory = NULL;
    if (size == 0 || count <= SIZE_MAX / size) {
        size_t bytes = count * size > 0 ? count * size : 1;
        memory = unit->callbacks.allocateMemory(bytes, 1);
        if (memory != NULL) {
            memset(memory, 0, bytes); /* the standard promises zeroes, not every importer keeps it */
        }
    }
    if (memory == NULL) {
        unit_fail(unit, "out of memory: %.0f bytes asked for", (double)count * (double)size);
    }
    return memory;
}

void unit_free(Unit *unit, void *memory) {
    if (memory != NULL) {
        unit->callbacks.freeMemory(memory);
    }
}

char *unit_copy_text(Unit *unit, const char *text) {
    size_t size = strlen(text) + 1;
    char *copy = unit_alloc(unit, size, 1);
    return copy != NULL ? memcpy(copy, text, size) : NULL;
}

/* --- layout */

static void write_start(const VariableInfo *info, void *address) {
    switch (info->kind) {
    case KIND_REAL:
        *(double *)address = info->start;
        break;
    case KIND_INTEGER:
    case KIND_BOOLEAN:
        *(int *)address = (int)info->start;
        break;
    case KIND_STRING:
        snprintf(address, STRING_SIZE, "%s", info->start_text);
        break;
    }
}

static bool is_late(unsigned reference) {
    return MODEL.show_late != NULL && reference >= MODEL.late_first && reference < MODEL.late_end;
}

static unsigned what_is(const VariableInfo *info, bool late) {
    if (info->kind != KIND_REAL) {
        return 0;
    }
    const bool input = info->causality == CAUSALITY_input, bounded = !(isinf(info->min) && isinf(info->max));
    return (late ? 0u : READY_REAL) | (input && !bounded ? FREE_INPUT : 0u) | (input ? REAL_INPUT : 0u) |
           (info->causality == CAUSALITY_output ? REAL_OUTPUT : 0u);
}

static void lay_row(Unit *unit, size_t base, const VariableInfo *info) {
    const unsigned reference = (unsigned)unit->variable_count++;
    const size_t offset = base + info->offset;
    unit->variables[reference] = (Variable){info, offset};
    unit->slots[reference] = (Slot){(uint32_t)offset, what_is(info, is_late(reference))};
    write_start(info, unit->block + offset);
    if (info->kind == KIND_REAL && info->causality == CAUSALITY_input) {
        unit->inputs[unit->input_count++] = reference;
    }
    if (info->kind == KIND_REAL && (info->causality == CAUSALITY_output || info->causality == CAUSALITY_local) &&
        !is_late(reference)) {
        unit->results[unit->result_count++] = (uint32_t)offset;
    }
}

static void lay_rows(Unit *unit, size_t base, const VariableInfo *rows, size_t count) {
    for (size_t i = 0; i < count; i++) {
        lay_row(unit, base, &rows[i]);
    }
}

static void free_tables(Unit *unit) {
    unit_free(unit, unit->slots);
    unit_free(unit, unit->variables);
    unit_free(unit, unit->inputs);
    unit_free(unit, unit->results);
    unit_free(unit, unit->block);
}

/* (Re)build the tables and a block with every variable at its start value, for `axes` axes and no model state. */
static bool lay_out(Unit *unit, size_t axes) {
    size_t count = (size_t)SCALAR_ROWS + axes * (size_t)AXIS_ROWS;
    free_tables(unit);
    unit->axes = axes;
    unit->variable_count = unit->input_count = unit->result_count = 0;
    unit->slopes_at = AXES_AT + BLOCK_ALIGNED(axes * sizeof(AxisBlock));
    unit->state_at = unit->block_size = unit->slopes_at + BLOCK_ALIGNED(count * sizeof(double));
    unit->slots = unit_alloc(unit, count, sizeof *unit->slots);
    unit->variables = unit_alloc(unit, count, sizeof *unit->variables);
    unit->inputs = unit_alloc(unit, count, sizeof *unit->inputs);
    unit->results = unit_alloc(unit, count, sizeof *unit->results);
    unit->block = unit_alloc(unit, unit->block_size, 1);
    if (unit->slots == NULL || unit->variables == NULL || unit->inputs == NULL || unit->results == NULL ||
        unit->block == NULL) {
        return false;
    }
    if (unit->slopes_at > UINT32_MAX) {
        return unit_fail(unit, "%.0f axes are more than this unit can address", (double)axes);
    }
    lay_rows(unit, SCALARS_AT, table_scalars, SCALAR_ROWS);
    for (size_t axis = 0; axis < axes; axis++) {
        lay_rows(unit, AXES_AT + axis * sizeof(AxisBlock), table_axis, AXIS_ROWS);
    }
    return true;
}

static void free_axis_names(Unit *unit) {
    for (size_t axis = 0; unit->axis_names != NULL && axis < unit->axes; axis++) {
        unit_free(unit, unit->axis_names[axis]);
    }
    unit_free(unit, unit->axis_names);
    unit->axis_names = NULL;
}

bool unit_set_axes(Unit *unit, size_t count, const char *const *names) {
    if (unit->start != NULL) {
        return unit_fail(unit, "axes can be named only while the model is loaded");
    }
    free_axis_names(unit);
    unit->axes = 0;
    char **copies = unit_alloc(unit, count, sizeof *copies);
    if (copies == NULL || !lay_out(unit, count)) {
        unit_free(unit, copies);
        return false;
    }
    unit->axis_names = copies;
    for (size_t axis = 0; axis < count; axis++) {
        if ((copies[axis] = unit_copy_text(unit, names[axis])) == NULL) {
            return false;
        }
    }
    return true;
}

bool unit_keep_start(Unit *unit) {
    size_t size = unit->slopes_at - SCALARS_AT;
    unit->start = unit_alloc(unit, size, 1);
    unit->derived_for = unit_alloc(unit, size, 1);
    if (unit->start == NULL || unit->derived_for == NULL) {
        return false;
    }
    memcpy(unit->start, unit->block + SCALARS_AT, size);
    return true;
}

bool unit_resize_state(Unit *unit, size_t state_size) {
    unsigned char *block = unit_alloc(unit, unit->state_at + state_size, 1);
    if (block == NULL) {
        return false;
    }
    memcpy(block, unit->block, unit->state_at);
    unit_free(unit, unit->block);
    unit->block = block;
    unit->block_size = unit->state_at + state_size;
    return true;
}

Unit *unit_create(const fmi2CallbackFunctions *callbacks, const char *name) {
    fmi2CallbackFunctions used = {NULL, NULL, NULL, NULL, NULL};
    if (callbacks != NULL) {
        used = *callbacks;
    }
    if (used.allocateMemory == NULL || used.freeMemory == NULL) {
        used.allocateMemory = calloc;
        used.freeMemory = free;
    }
    Unit *unit = used.allocateMemory(1, sizeof *unit);
    if (unit == NULL) {
        return NULL;
    }
    memset(unit, 0, sizeof *unit);
    unit->callbacks = used;
    unit->call = CALL_Instantiate;
    unit->log_categories = LOG_ERRORS;
    unit->name = unit_copy_text(unit, name);
    if (unit->name == NULL || !lay_out(unit, 0)) {
        unit_destroy(unit);
        return NULL;
    }
    return unit;
}

void unit_destroy(Unit *unit) {
    if (MODEL.release != NULL && unit->derived != NULL) {
        MODEL.release(unit);
    }
    free_axis_names(unit);
    free_tables(unit);
    unit_free(unit, unit->start);
    unit_free(unit, unit->derived_for);
    unit_free(unit, unit->resources);
    unit_free(unit, unit->location);
    unit_free(unit, unit->name);
    unit_free(unit, unit);
}

/* --- the model's view */

Scalars *unit_scalars(Unit *unit) {
    return (Scalars *)(void *)(unit->block + SCALARS_AT);
}

AxisBlock *unit_axis(Unit *unit, size_t axis) {
    return (AxisBlock *)(void *)(unit->block + AXES_AT) + axis;
}

const AxisBlock *unit_axis_behind(const Scalars *scalars, size_t axis) {
    const unsigned char *axes = (const unsigned char *)scalars + (AXES_AT - SCALARS_AT);
    return (const AxisBlock *)(const void *)axes + axis;
}

Clock unit_clock_behind(const Unit *unit, const Scalars *scalars) {
    (void)unit;
    Header header;
    memcpy(&header, (const unsigned char *)scalars - SCALARS_AT, sizeof header);
    return (Clock){header.start_time, header.time, header.phase != PHASE_FAILED};
}

size_t unit_axes(const Unit *unit) {
    return unit->axes;
}

const char *unit_axis_name(const Unit *unit, size_t axis) {
    return unit->axis_names[axis];
}

double unit_slope(const Unit *unit, unsigned vr) {
    return unit_slopes(unit)[vr];
}

bool unit_sloped(const Unit *unit) {
    return unit_header(unit)->sloped != 0;
}

void *unit_state(Unit *unit) {
    return unit->block + unit->state_at;
}

double unit_start_time(const Unit *unit) {
    return unit_header(unit)->start_time;
}

const char *unit_resources(const Unit *unit) {
    return unit->resources;
}

const char *unit_location(const Unit *unit) {
    return unit->location;
}

const char *unit_resource_hash(const Unit *unit) {
    return unit->guid + HASH_TEXT_SIZE;
}

void *unit_derived(const Unit *unit) {
    return unit->derived;
}

void unit_set_derived(Unit *unit, void *derived) {
    unit->derived = derived;
}

void unit_leave_late(Unit *unit) {
    unit->late = true;
}
