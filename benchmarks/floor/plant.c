#include "plant.h"
#include "floor.h"
#include "shell.h"

#define MOST_INPUTS 16

static Plant *plant_of(void *unit) {
    return ((Unit *)unit)->derived;
}

static const AxisBlock *axis_of(void *unit, size_t axis) {
    return (const AxisBlock *)(const void *)(((Unit *)unit)->block + AXES_AT) + axis;
}

void plant_floor_prepare(void *unit, double h, PlantMotion *motion) {
    const Unit *u = unit;
    Plant *plant = plant_of(unit);
    modal_prepare(&plant->modal[0], h);
    motion->now = (double *)((StateHead *)(void *)(u->block + u->state_at) + 1) + plant_ports(plant);
    motion->next = motion->now + plant_state_doubles(plant);
}

void plant_floor_step(void *unit, PlantMotion *motion, const double *M_a, const double *M_a_slope, const double *M_fr,
                      const double *M_fr_slope, double h, double *n) {
    const Plant *plant = plant_of(unit);
    const Modal *modal = &plant->modal[0];
    double u[MOST_INPUTS], du[MOST_INPUTS];
    for (size_t i = 0; i < plant->axes; i++) {
        u[i] = M_a[i] - M_fr[i] - axis_of(unit, i)->M_0;
        du[i] = h * (M_a_slope[i] - M_fr_slope[i]);
    }
    double *q = motion->now, *q_end = motion->next;
    modal_advance(modal, plant->axes, u, du, q, q + plant->size, q_end, q_end + plant->size);
    motion->now = q_end;
    motion->next = q;
    for (size_t i = 0; i < plant->axes; i++) {
        n[i] = modal_sum(modal, i, q_end + plant->size);
    }
}

void plant_floor_measure(void *unit, const PlantMotion *motion, const double *n, double *x_a_n_a) {
    const Plant *plant = plant_of(unit);
    const size_t slides = plant_slides(plant);
    for (size_t i = 0; i < plant->axes; i++) {
        x_a_n_a[2 * i] = axis_of(unit, i)->x_0 + modal_sum(&plant->modal[0], slides + i, motion->now);
        x_a_n_a[2 * i + 1] = n[i];
    }
}

void plant_floor_record(void *unit, const PlantMotion *motion, const double *x_a_n_a, double *row) {
    const Plant *plant = plant_of(unit);
    for (size_t i = 0; i < PLANT_AXIS_ROW * plant->axes; i++) {
        *row++ = x_a_n_a[i];
    }
    for (size_t i = 0; i < TOOL_DIRECTIONS; i++) {
        const size_t axis = plant->tool_axis[i];
        const double x = modal_sum(&plant->modal[0], plant->axes + i, motion->now);
        row[i] = x;
        row[TOOL_DIRECTIONS + i] = (axis == NO_AXIS ? 0 : axis_of(unit, axis)->x_0) + x;
    }
}
