/* unit.h for a model that is a part of the machine, to be included once by each of plant_part.c, controller_part.c,
 * ..., ahead of the model's own files. */
#ifndef FEEDSIM_PART_SHELL_H
#define FEEDSIM_PART_SHELL_H

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>

#include "part.h"
#include "unit.h"

/* A message that names a file's line and what is wrong with it. */
#define PART_MESSAGE_SIZE (2 * STRING_SIZE)

struct Unit {
    Part part;
};

/* --- what the model asks of the shell */

Scalars *unit_scalars(Unit *unit) {
    return (Scalars *)(void *)unit->part.scalars;
}

AxisBlock *unit_axis(Unit *unit, size_t axis) {
    const size_t place = unit->part.axis_of != NULL ? unit->part.axis_of[axis] : axis;
    return (AxisBlock *)(void *)(unit->part.axis_block + place * unit->part.axis_stride);
}

size_t unit_axes(const Unit *unit) {
    return unit->part.axes;
}

const char *unit_axis_name(const Unit *unit, size_t axis) {
    return unit->part.calls->axis_name(unit->part.host, &unit->part, axis);
}

double unit_slope(const Unit *unit, unsigned vr) {
    return unit->part.slopes[vr];
}

bool unit_sloped(const Unit *unit) {
    return unit->part.sloped;
}

void *unit_state(Unit *unit) {
    return unit->part.state;
}

double unit_start_time(const Unit *unit) {
    return unit->part.start_time;
}

Clock unit_clock_behind(const Unit *unit, const Scalars *scalars) {
    (void)scalars; /* the machine knows */
    return (Clock){unit->part.clock.start, unit->part.clock.time, unit->part.clock.valid};
}

const char *unit_resources(const Unit *unit) {
    return unit->part.resources;
}

const char *unit_location(const Unit *unit) {
    return unit->part.location;
}

const char *unit_resource_hash(const Unit *unit) {
    return unit->part.resource_hash;
}

bool unit_set_axes(Unit *unit, size_t count, const char *const *names) {
    return unit->part.calls->set_axes(unit->part.host, &unit->part, count, names);
}

void unit_leave_late(Unit *unit) {
    (void)unit; /* the machine asks for them */
}

void *unit_derived(const Unit *unit) {
    return unit->part.derived;
}

void unit_set_derived(Unit *unit, void *derived) {
    unit->part.derived = derived;
}

bool unit_fail(Unit *unit, const char *format, ...) {
    char text[PART_MESSAGE_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    unit->part.calls->fail(unit->part.host, unit->part.label, text);
    return false;
}

void unit_warn(Unit *unit, const char *format, ...) {
    char text[PART_MESSAGE_SIZE];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    unit->part.calls->warn(unit->part.host, unit->part.label, text);
}

void *unit_alloc(Unit *unit, size_t count, size_t size) {
    return unit->part.calls->alloc(unit->part.host, count, size);
}

void unit_free(Unit *unit, void *memory) {
    if (memory != NULL) {
        unit->part.calls->release(unit->part.host, memory);
    }
}

/* --- the model as the machine sees it */

static Unit *part_unit(const Part *part) {
    return (Unit *)(uintptr_t)part; /* its only member */
}

static bool part_load(Part *part) {
    return MODEL.load == NULL || MODEL.load(part_unit(part));
}

static bool part_derive(Part *part) {
    return MODEL.derive(part_unit(part));
}

static size_t part_state_size(const Part *part) {
    return MODEL.state_size(part_unit(part));
}

static bool part_accepts(Part *part, const void *scalars, const void *state, size_t size) {
    return MODEL.accepts == NULL || MODEL.accepts(part_unit(part), scalars, state, size);
}

static void part_start(Part *part) {
    MODEL.start(part_unit(part));
}

static bool part_step(Part *part, double t, double h) {
    return MODEL.step(part_unit(part), t, h);
}

static void part_show_late(Part *part) {
    if (MODEL.show_late != NULL) {
        MODEL.show_late(part_unit(part));
    }
}

static double part_output_derivative(Part *part, unsigned vr) {
    return MODEL.output_derivative(part_unit(part), vr);
}

static void part_release(Part *part) {
    if (MODEL.release != NULL && part->derived != NULL) {
        MODEL.release(part_unit(part));
    }
}

#define VARIABLE(kind, field, ...) offsetof(Scalars, field),
#define AXIS_VARIABLE(...)
static const size_t part_scalar_places[] = {
#include UNIT_TABLE
    sizeof(Scalars)};
#undef VARIABLE
#undef AXIS_VARIABLE

#define VARIABLE(...)
#define AXIS_VARIABLE(kind, field, ...) offsetof(AxisBlock, field),
static const size_t part_axis_places[] = {
#include UNIT_TABLE
    sizeof(AxisBlock)};
#undef VARIABLE
#undef AXIS_VARIABLE

#define PART PART_OF(UNIT_NAME)
#define PART_OF(unit) PART_JOINED(unit)
#define PART_JOINED(unit) unit##_part

const PartModel PART = {
    .load = part_load,
    .derive = part_derive,
    .state_size = part_state_size,
    .accepts = part_accepts,
    .start = part_start,
    .step = part_step,
    .show_late = part_show_late,
    .output_derivative = part_output_derivative,
    .release = part_release,
    .scalar_places = part_scalar_places,
    .axis_places = part_axis_places,
    .scalar_rows = SCALAR_ROWS,
    .axis_rows = AXIS_ROWS,
};

#endif
