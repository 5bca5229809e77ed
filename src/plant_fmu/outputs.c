/* What a state of the plant shows: at rotors, scales and tool, with play and geometry; and how fast it changes. */
#include <math.h>

#include "numbers.h"
#include "plant.h"

/* Speeds at the axes' rotors and displacements at their scales, y[ports]; false where one is no finite number. */
bool plant_measure(const Plant *plant, const Modal *modal, const double *q, const double *v, double *y) {
    const size_t slides = plant_slides(plant);
    double probe = 0;
    modal_sums(modal, 0, plant->axes, v, y);
    modal_sums(modal, slides, plant->axes, q, y + slides);
    for (size_t i = 0; i < plant->axes; i++) {
        probe += number_probe(y[i]) + number_probe(y[slides + i]);
    }
    return !isnan(probe);
}

/* Displacements at the tool, the rest of y[ports]; likewise. */
bool plant_measure_tool(const Plant *plant, const Modal *modal, const double *q, double *y) {
    double probe = 0;
    for (size_t port = plant->axes; port < plant_slides(plant); port++) {
        y[port] = modal_sum(modal, port, q);
        probe += number_probe(y[port]);
    }
    return !isnan(probe);
}

void plant_show(Unit *unit, const Plant *plant, const double *y) {
    const double *x = y + plant_slides(plant);
    for (size_t i = 0; i < plant->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        axis->n_a = y[i];
        axis->n_fr = y[i];
        axis->x_a = axis->x_0 + x[i];
    }
}

/* Play of the drives, at the end of a step that leads from one place of the state to the other. */
void plant_play(Unit *unit, const Plant *plant, const double *before, double *ways) {
    const double *x = plant->y + plant_slides(plant);
    const size_t axes = plant->axes;
    for (size_t i = 0; i < axes; i++) {
        const AxisBlock *axis = unit_axis(unit, i);
        double *wound = &ways[2 * axes + i], way = x[i];
        *wound = before[2 * axes + i];
        if (axis->hysteresis_value > 0) {
            /* Where the structure was: what stands behind `before`, less what play and hysteresis had made of it. */
            const double was = before[i] - before[axes + i];
            *wound = geometry_hysteresis(*wound, x[i] - was, axis->hysteresis_way);
            way -= axis->hysteresis_value / 2 * (*wound / axis->hysteresis_way);
        }
        ways[i] = geometry_play(before[i], way, axis->play);
        ways[axes + i] = ways[i] - x[i];
    }
}

void plant_show_play(Unit *unit, const Plant *plant, const double *ways) {
    for (size_t i = 0; i < plant->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        axis->x_a = axis->x_0 + ways[i];
    }
}

/* Ways s[directions] of the slides that move the tool, or speeds, of the axes' own [axes]. */
static void plant_by_direction(const Plant *plant, const double *of_axes, double *s) {
    for (size_t d = 0; d < TOOL_DIRECTIONS; d++) {
        s[d] = plant->tool_axis[d] == NO_AXIS ? 0 : of_axes[plant->tool_axis[d]];
    }
}

/* What play and geometry add at the tool, added[directions]. */
static void plant_errors(const Plant *plant, const double *ways, double *added) {
    double s[TOOL_DIRECTIONS], play[TOOL_DIRECTIONS], error[TOOL_DIRECTIONS];
    plant_by_direction(plant, ways, s);
    plant_by_direction(plant, ways + plant->axes, play);
    geometry_errors(&plant->geometry, s, error);
    for (size_t d = 0; d < TOOL_DIRECTIONS; d++) {
        added[d] = play[d] + error[d];
    }
}

/* Whether they are numbers at the ways that end a step: a cube of a way is soon none. */
bool plant_errors_are_numbers(const Plant *plant, const double *ways) {
    double added[TOOL_DIRECTIONS], probe = 0;
    plant_errors(plant, ways, added);
    for (size_t d = 0; d < TOOL_DIRECTIONS; d++) {
        probe += number_probe(added[d]);
    }
    return !isnan(probe);
}

static double plant_start_position(Unit *unit, const Plant *plant, size_t direction) {
    const size_t axis = plant->tool_axis[direction];
    return axis == NO_AXIS ? 0 : unit_axis(unit, axis)->x_0;
}

void plant_show_tool(Unit *unit, Plant *plant, double *y) {
    Scalars *v = unit_scalars(unit);
    double *tool = y + plant->axes;
    if (plant->errors) {
        double added[TOOL_DIRECTIONS];
        plant_errors(plant, plant_ways(plant, plant_state(unit)), added);
        for (size_t d = 0; d < TOOL_DIRECTIONS; d++) {
            tool[d] += added[d];
        }
    }
    v->tool_x_X = tool[0];
    v->tool_x_Y = tool[1];
    v->tool_x_Z = tool[2];
    v->tcp_x_X = plant_start_position(unit, plant, 0) + tool[0];
    v->tcp_x_Y = plant_start_position(unit, plant, 1) + tool[1];
    v->tcp_x_Z = plant_start_position(unit, plant, 2) + tool[2];
}

/* Positions x[axes] from displacements at the axes' scales. */
void plant_positions(Unit *unit, const Plant *plant, const double *displacement, double *x) {
    for (size_t i = 0; i < plant->axes; i++) {
        x[i] = unit_axis(unit, i)->x_0 + displacement[i];
    }
}

/* --- derivatives */

/* Speed of an axis's slide: that of the structure there, unless play lets it stand. */
double plant_slide_speed(Unit *unit, const Plant *plant, const Modal *modal, size_t axis) {
    double *state = plant_state(unit);
    double speed = modal_sum(modal, plant_slides(plant) + axis, state + plant_ports(plant) + plant->size);
    const AxisBlock *own = unit_axis(unit, axis);
    const double half = own->play / 2, h = own->hysteresis_value, w = own->hysteresis_way;
    double apart = plant_ways(plant, state)[plant->axes + axis];
    if (h > 0) {
        const double wound = plant_ways(plant, state)[2 * plant->axes + axis];
        apart += h / 2 * (wound / w);
        speed *= (speed > 0 ? wound < w : wound > -w) ? 1 - h / (2 * w) : 1;
    }
    const double limit = half * (1 - 1e-9); /* the way is a difference of positions, rounded */
    return half > 0 && !(speed > 0 ? apart <= -limit : apart >= limit) ? 0 : speed;
}

/* What play and geometry add to the speed at the tool in a direction. */
static double plant_error_speed(Unit *unit, const Plant *plant, const Modal *modal, size_t direction) {
    double *state = plant_state(unit), s[TOOL_DIRECTIONS], v[TOOL_DIRECTIONS] = {0}, slope[TOOL_DIRECTIONS];
    plant_by_direction(plant, plant_ways(plant, state), s);
    for (size_t d = 0; d < TOOL_DIRECTIONS; d++) {
        v[d] = plant->tool_axis[d] == NO_AXIS ? 0 : plant_slide_speed(unit, plant, modal, plant->tool_axis[d]);
    }
    geometry_slopes(&plant->geometry, s, v, slope);
    const size_t axis = plant->tool_axis[direction];
    const double structure =
        axis == NO_AXIS ? 0 : modal_sum(modal, plant_slides(plant) + axis, state + plant_ports(plant) + plant->size);
    return slope[direction] + v[direction] - structure;
}

double plant_tool_speed(Unit *unit, const Plant *plant, const Modal *modal, size_t direction) {
    const double *v = plant_state(unit) + plant_ports(plant) + plant->size;
    const double speed = modal_sum(modal, plant->axes + direction, v);
    return plant->errors ? speed + plant_error_speed(unit, plant, modal, direction) : speed;
}
