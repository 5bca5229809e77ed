#include "plant.h"
#include "floor.h"
#include "shell.h"

#define MOST_INPUTS 16

static Plant *plant_of(void *unit) {
    return ((Unit *)unit)->derived;
}

static double *inputs_of(void *unit) {
    const Unit *u = unit;
    return (double *)((StateHead *)(void *)(u->block + u->state_at) + 1);
}

static const AxisBlock *axis_of(void *unit, size_t axis) {
    return (const AxisBlock *)(const void *)(((Unit *)unit)->block + AXES_AT) + axis;
}

void plant_floor_prepare(void *unit, double h) {
    modal_prepare(&plant_of(unit)->modal[0], h);
}

void plant_floor_step(void *unit, const double *M_a, const double *M_a_slope, const double *M_fr,
                      const double *M_fr_slope, double h, double *n) {
    Plant *plant = plant_of(unit);
    const Modal *modal = &plant->modal[0];
    double *state = inputs_of(unit), *q = state + plant_inputs(plant), *v = q + plant->size;
    double u[MOST_INPUTS], du[MOST_INPUTS];
    for (size_t i = 0; i < plant->axes; i++) {
        u[i] = M_a[i] - M_fr[i] - axis_of(unit, i)->M_0;
        du[i] = h * (M_a_slope[i] - M_fr_slope[i]);
    }
    double *q_end = plant->end, *v_end = q_end + plant->size;
    modal_advance(modal, plant->axes, u, du, q, v, q_end, v_end);
    for (size_t k = 0; k < plant->size; k++) {
        q[k] = q_end[k];
        v[k] = v_end[k];
    }
    for (size_t i = 0; i < plant->axes; i++)
        n[i] = modal_sum(modal, i, v);
}

void plant_floor_measure(void *unit, const double *n, double *x_a_n_a) {
    const Plant *plant = plant_of(unit);
    const size_t inputs = plant_inputs(plant);
    const double *q = inputs_of(unit) + inputs;
    for (size_t i = 0; i < plant->axes; i++) {
        x_a_n_a[2 * i] = axis_of(unit, i)->x_0 + modal_sum(&plant->modal[0], inputs + i, q);
        x_a_n_a[2 * i + 1] = n[i];
    }
}

void plant_floor_record(void *unit, const double *x_a_n_a, double *row) {
    const Plant *plant = plant_of(unit);
    const double *q = inputs_of(unit) + plant_inputs(plant);
    for (size_t i = 0; i < PLANT_AXIS_ROW * plant->axes; i++)
        *row++ = x_a_n_a[i];
    for (size_t i = 0; i < TOOL_DIRECTIONS; i++) {
        const size_t axis = plant->tool_axis[i];
        const double x = modal_sum(&plant->modal[0], plant->axes + i, q);
        row[i] = x;
        row[TOOL_DIRECTIONS + i] = (axis == NO_AXIS ? 0 : axis_of(unit, axis)->x_0) + x;
    }
}
