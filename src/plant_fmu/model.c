/* plant: the mechanical structure of a machine with its feed drives, reduced to modes.
 *
 *   q_k'' + 2 zeta_k omega_k q_k' + omega_k^2 q_k = f_k                                per mode k, mass-normalised
 *   f_k   = sum over axes A of (n_kA (M_a - M_fr - M_0) + x_kA (F_a - guide.F_fr)) + sum over directions d of tcp_kd
 * F_d n_a   = n_fr = sum over k of n_kA q_k'             rotor against stator [rad/s] x_a   = x_0 + sum over k of x_kA
 * q_k               slide against rail, at the linear scale [m] tool.x_d = sum over k of tcp_kd q_k                tool
 * against workpiece [m]; with play and geometry: geometry.h tcp.x_d  = tool.x_d + x_0 of the axis named d      tool
 * centre point [m]
 *
 *   M_a motor torque, M_fr friction torque, M_0 constant load [N.m]; F_a force on the slide, F_d on the tool [N];
 * omega_k = 2 pi frequency; n_kA, x_kA, tcp_kd: mode shapes at the ports, columns of the mode table (modes.h)
 *
 * With poses (poses.h) these are the modes of the cell that the axes stand in. At the end of a step that takes an axis
 * out of its cell, q and v are carried over into the next one, x_a unchanged; what is reported then belongs to the new
 * cell, so that outputs, their derivatives and the start of the next step are those of one state.
 *
 * Source: M. Wiesauer, F. Bleicher, "Parameterization method for non-linear friction models of machine tool feed
 * drives", 18th CIRP Conference on Modeling of Machining Operations (2021), section 2.1. Method and limits: README.md.
 *
 * Each mode is advanced exactly for inputs that are linear over the step (modal.h). The state is that of the modes; the
 * inputs at the end of the last step are kept with it, as the accelerations there need them. */
#include <limits.h>
#include <math.h>
#include <string.h>

#include "cells.h"
#include "numbers.h"
#include "plant.h"

static size_t plant_state_size(const Unit *unit) {
    return sizeof(StateHead) + 2 * plant_state_doubles(unit_derived(unit)) * sizeof(double);
}

static StateHead *plant_head(Unit *unit) {
    return unit_state(unit);
}

static double *plant_state_at(Unit *unit, const Plant *plant, uint64_t place) {
    return (double *)(plant_head(unit) + 1) + place * plant_state_doubles(plant);
}

static double *plant_state(Unit *unit) {
    return plant_state_at(unit, unit_derived(unit), plant_head(unit)->place);
}

/* --- start and step */

static double plant_start_position(Unit *unit, const Plant *plant, size_t direction) {
    const size_t axis = plant->tool_axis[direction];
    return axis == NO_AXIS ? 0 : unit_axis(unit, axis)->x_0;
}

/* Inputs at the ports, u, and their change du over a step of h. */
static void plant_gather(Unit *unit, double h, double *u, double *du) {
    const Scalars *v = unit_scalars(unit);
    const size_t axes = unit_axes(unit), slides = axes + TOOL_DIRECTIONS;
    for (size_t i = 0; i < axes; i++) {
        const AxisBlock *axis = unit_axis(unit, i);
        const unsigned row = (unsigned)(SCALAR_ROWS + i * AXIS_ROWS);
        u[i] = axis->M_a - axis->M_fr - axis->M_0;
        du[i] = h * (unit_slope(unit, row + AXIS_VR_M_a) - unit_slope(unit, row + AXIS_VR_M_fr));
        u[slides + i] = axis->F_a;
        du[slides + i] = h * unit_slope(unit, row + AXIS_VR_F_a);
    }
    u[axes] = v->tool_F_X;
    u[axes + 1] = v->tool_F_Y;
    u[axes + 2] = v->tool_F_Z;
    du[axes] = h * unit_slope(unit, VR_tool_F_X);
    du[axes + 1] = h * unit_slope(unit, VR_tool_F_Y);
    du[axes + 2] = h * unit_slope(unit, VR_tool_F_Z);
}

/* Speeds at the axes' rotors and displacements at their scales, y[ports]; false where one is no finite number. */
static bool plant_measure(const Plant *plant, const Modal *modal, const double *q, const double *v, double *y) {
    const size_t slides = plant_slides(plant);
    double probe = 0;
    for (size_t i = 0; i < plant->axes; i++) {
        y[i] = modal_sum(modal, i, v);
        y[slides + i] = modal_sum(modal, slides + i, q);
        probe += number_probe(y[i]) + number_probe(y[slides + i]);
    }
    return !isnan(probe);
}

/* Displacements at the tool, the rest of y[ports]; likewise. */
static bool plant_measure_tool(const Plant *plant, const Modal *modal, const double *q, double *y) {
    double probe = 0;
    for (size_t port = plant->axes; port < plant_slides(plant); port++) {
        y[port] = modal_sum(modal, port, q);
        probe += number_probe(y[port]);
    }
    return !isnan(probe);
}

static void plant_show(Unit *unit, const Plant *plant, const double *y) {
    const double *x = y + plant_slides(plant);
    for (size_t i = 0; i < plant->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        axis->n_a = y[i];
        axis->n_fr = y[i];
        axis->x_a = axis->x_0 + x[i];
    }
}

/* Ways of the slides since the start, behind q and v of a state; what play takes off or adds follows. */
static double *plant_ways(const Plant *plant, double *state) {
    return state + plant_ports(plant) + 2 * plant->size;
}

/* Play of the drives, at the end of a step that leads from one place of the state to the other. */
static void plant_play(Unit *unit, const Plant *plant, const double *before, double *ways) {
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

static void plant_show_play(Unit *unit, const Plant *plant, const double *ways) {
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
static bool plant_errors_are_numbers(const Plant *plant, const double *ways) {
    double added[TOOL_DIRECTIONS], probe = 0;
    plant_errors(plant, ways, added);
    for (size_t d = 0; d < TOOL_DIRECTIONS; d++) {
        probe += number_probe(added[d]);
    }
    return !isnan(probe);
}

static void plant_show_tool(Unit *unit, Plant *plant, double *y) {
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
static void plant_positions(Unit *unit, const Plant *plant, const double *displacement, double *x) {
    for (size_t i = 0; i < plant->axes; i++) {
        x[i] = unit_axis(unit, i)->x_0 + displacement[i];
    }
}

/* --- friction at the guides */

/* Of each axis, behind the ways of a state. */
static GuideState *plant_guides(const Plant *plant, double *state) {
    return (GuideState *)(void *)(plant_ways(plant, state) + 3 * plant->axes);
}

/* How the slides give way to their friction, for a step of h. */
static void plant_prepare_guides(Plant *plant, const Modal *modal, double h) {
    if (plant->mobility == modal && plant->mobility_h == h) {
        return;
    }
    const size_t axes = plant->axes, slides = plant_slides(plant);
    for (size_t i = 0; i < axes * axes; i++) {
        modal_mobility(modal, slides + i / axes, slides + i % axes, &plant->held[i], &plant->ramp[i]);
    }
    plant->mobility = modal;
    plant->mobility_h = h;
}

/* Behind a step that the structure took without it: its end with the friction. False where a force is no finite
 * number. */
static bool plant_step_guides(Plant *plant, const Modal *modal, double *state, double *end, double h) {
    const size_t axes = plant->axes, slides = plant_slides(plant), ports = plant_ports(plant);
    double *q_end = end + ports, *v_end = q_end + plant->size;
    const GuideState *start = plant_guides(plant, state);
    GuideState *guides = plant_guides(plant, end);
    plant_prepare_guides(plant, modal, h);
    for (size_t i = 0; i < axes; i++) {
        plant->v_free[i] = plant->guides[i].on ? modal_sum(modal, slides + i, v_end) : 0;
    }
    if (!guide_step(axes, plant->guides, plant->v_free, plant->held, plant->ramp, start, guides, h)) {
        return false;
    }
    for (size_t i = 0; i < axes; i++) {
        if (plant->guides[i].on) {
            modal_add(modal, slides + i, -start[i].F, start[i].F - guides[i].F, q_end, v_end);
            end[slides + i] = plant->u[slides + i] + plant->du[slides + i] - guides[i].F;
        }
    }
    return true;
}

/* Behind a crossing from cell to cell: speeds as the new modes have them. */
static void plant_follow_guides(const Plant *plant, const Modal *modal, double *end) {
    const double *v_end = end + plant_ports(plant) + plant->size;
    for (size_t i = 0; i < plant->axes; i++) {
        plant_guides(plant, end)[i].v = modal_sum(modal, plant_slides(plant) + i, v_end);
    }
}

static void plant_show_guides(Unit *unit, const Plant *plant, double *state) {
    for (size_t i = 0; i < plant->axes; i++) {
        const GuideState *guide = &plant_guides(plant, state)[i];
        AxisBlock *axis = unit_axis(unit, i);
        axis->guide_F_fr = guide->F;
        axis->guide_z = guide->contact.z;
        axis->guide_E_fr = guide->work;
        axis->guide_warmth = guide->warmth;
    }
}

/* --- transmissions between the motors and the structure
 * ---------------------------------------------------------------
 */

/* Of each axis, behind the guides of a state. */
static TransmissionState *plant_transmissions(const Plant *plant, double *state) {
    return (TransmissionState *)(void *)(plant_guides(plant, state) + plant->axes);
}

/* The torques at the motors, taken off the structure, which keeps the constant load: a weight hangs behind the play. */
static void plant_take_motors(Unit *unit, Plant *plant) {
    for (size_t i = 0; i < plant->axes; i++) {
        if (plant->transmissions[i].on) {
            const double M_0 = unit_axis(unit, i)->M_0;
            plant->motor_u[i] = plant->u[i] + M_0;
            plant->motor_du[i] = plant->du[i];
            plant->u[i] = -M_0;
            plant->du[i] = 0;
        }
    }
}

/* What the structure gives way at the motors' ports to a torque over a step of h. */
static void plant_prepare_transmissions(Plant *plant, const Modal *modal, double h) {
    if (plant->transmitted == modal && plant->transmitted_h == h) {
        return;
    }
    const size_t axes = plant->axes;
    for (size_t i = 0; i < axes * axes; i++) {
        double ramp;
        modal_mobility(modal, i / axes, i % axes, &plant->by_n[i], &ramp);
        plant->by_angle[i] = modal_moved(modal, i / axes, i % axes);
    }
    plant->transmitted = modal;
    plant->transmitted_h = h;
}

/* Behind a step that the structure took without motors: its end with them, and with friction at the guides, which the
 * torques of the motors change and which changes these: by turns, until they have settled. False where one is no finite
 * number. */
static bool plant_step_transmissions(Plant *plant, const Modal *modal, double *state, double *end, double h) {
    const int most_passes = 20;
    const double settled = 1e-10; /* of a torque */
    const size_t axes = plant->axes, bytes = plant->size * sizeof(double);
    double *q_end = end + plant_ports(plant), *v_end = q_end + plant->size;
    const TransmissionState *start = plant_transmissions(plant, state);
    TransmissionState *motors = plant_transmissions(plant, end);
    plant_prepare_transmissions(plant, modal, h);
    if (plant->guided) {
        memcpy(plant->q_free, q_end, bytes);
        memcpy(plant->v_free_step, v_end, bytes);
    }
    for (size_t i = 0; i < axes; i++) {
        plant->angle_free[i] = plant->transmissions[i].on ? modal_sum(modal, i, q_end) : 0;
        plant->n_free[i] = plant->transmissions[i].on ? modal_sum(modal, i, v_end) : 0;
    }
    bool other = true;
    for (int pass = 0; other && pass < most_passes; pass++) {
        double most = 0, change = 0;
        for (size_t i = 0; i < axes; i++) {
            plant->y[i] = motors[i].T;
        }
        if (!transmission_step(axes, plant->transmissions, plant->motor_u, plant->motor_du, plant->angle_free,
                               plant->n_free, plant->by_angle, plant->by_n, start, motors, h)) {
            return false;
        }
        for (size_t i = 0; i < axes; i++) {
            most = fmax(most, fabs(motors[i].T));
            change = fmax(change, fabs(motors[i].T - plant->y[i]));
        }
        other = plant->guided && (pass == 0 || change > settled * most);
        if (pass > 0) {
            memcpy(q_end, plant->q_free, bytes);
            memcpy(v_end, plant->v_free_step, bytes);
        }
        for (size_t i = 0; i < axes; i++) {
            if (plant->transmissions[i].on) {
                modal_add(modal, i, motors[i].T, 0, q_end, v_end);
                end[i] = plant->u[i] + motors[i].T;
            }
        }
        if (plant->guided && !plant_step_guides(plant, modal, state, end, h)) {
            return false;
        }
        for (size_t i = 0; other && i < axes; i++) {
            if (plant->transmissions[i].on) { /* what the guides do at the motors' ports */
                plant->angle_free[i] += modal_sum(modal, i, q_end) - motors[i].angle_s;
                plant->n_free[i] += modal_sum(modal, i, v_end) - motors[i].n_s;
            }
        }
    }
    return true;
}

/* Behind the step, and a crossing from cell to cell: the structure as its modes have it, motors turned along with it.
 */
static void plant_follow_transmissions(const Plant *plant, const Modal *modal, double *end) {
    const double *q_end = end + plant_ports(plant), *v_end = q_end + plant->size;
    TransmissionState *motors = plant_transmissions(plant, end);
    for (size_t i = 0; i < plant->axes; i++) {
        if (plant->transmissions[i].on) {
            const double angle = modal_sum(modal, i, q_end);
            motors[i].angle += angle - motors[i].angle_s;
            motors[i].angle_s = angle;
            motors[i].n_s = modal_sum(modal, i, v_end);
        }
    }
}

static void plant_show_transmissions(Unit *unit, const Plant *plant, double *state) {
    for (size_t i = 0; i < plant->axes; i++) {
        const TransmissionState *motor = &plant_transmissions(plant, state)[i];
        AxisBlock *axis = unit_axis(unit, i);
        if (plant->transmissions[i].on) {
            axis->n_a = axis->n_fr = motor->n;
            axis->transmission_F = motor->C / plant->transmissions[i].lead;
            axis->transmission_way = (motor->angle - motor->angle_s) * plant->transmissions[i].lead;
            axis->transmission_heat = motor->heat;
        }
    }
}

/* --- start and step, with all of it */

static void plant_start(Unit *unit) {
    Plant *plant = unit_derived(unit);
    double *u = plant_state(unit), *q = u + plant_ports(plant), *v = q + plant->size;
    StateHead *head = plant_head(unit);
    Scalars *shown = unit_scalars(unit);
    plant_gather(unit, 0, u, plant->du);
    plant_measure(plant, &plant->modal[0], q, v, plant->y); /* at rest, whatever the cell */
    plant_measure_tool(plant, &plant->modal[0], q, plant->y);
    plant_positions(unit, plant, plant->y + plant_slides(plant), plant->x);
    for (size_t i = 0; i < plant->axes; i++) {
        plant_guides(plant, plant_state(unit))[i].x = unit_axis(unit, i)->x_0;
        if (plant->transmissions[i].on) {
            const double M_0 = unit_axis(unit, i)->M_0;
            plant_transmissions(plant, plant_state(unit))[i].u = u[i] + M_0;
            u[i] = -M_0;
        }
    }
    plant_show_guides(unit, plant, plant_state(unit));
    head->table_hash = plant->table_hash;
    head->cell = plant->cells > 1 ? cells_find(&plant->poses, plant->x) : 0;
    plant_show(unit, plant, plant->y);
    plant_show_tool(unit, plant, plant->y);
    shown->pose_cell = (int)head->cell;
    shown->pose_crossings = 0;
    shown->pose_E_kin_lost = shown->pose_E_el_lost = 0;
    shown->pose_held = shown->pose_jump_x_a = shown->pose_jump_n_a = shown->pose_jump_tool = 0;
}

static double plant_jump(const Plant *plant, size_t from, size_t to, double largest) {
    for (size_t port = from; port < to; port++) {
        largest = fmax(largest, fabs(plant->y[port] - plant->y_before[port]));
    }
    return largest;
}

/* A counter that stays at its end. */
static int plant_count(int before, size_t more) {
    return more < (size_t)(INT_MAX - before) ? before + (int)more : INT_MAX;
}

/* Into the cell that the positions at the end of the step lie in, with the end's q and v and what is measured there. */
static bool plant_follow(Unit *unit, Plant *plant, double *q, double *v) {
    const size_t slides = plant_slides(plant), ports = plant_ports(plant);
    Scalars *shown = unit_scalars(unit);
    if (!plant_measure_tool(plant, &plant->modal[plant_head(unit)->cell], q, plant->y)) {
        return false; /* measured ahead, for the jump */
    }
    plant_positions(unit, plant, plant->y + slides, plant->x);
    const Passage passage =
        cells_follow(&plant->poses, plant->modal, (size_t)plant_head(unit)->cell, plant->x, q, v, plant->carried);
    if (passage.crossings == 0) {
        return true;
    }
    memcpy(plant->y_before, plant->y, ports * sizeof *plant->y);
    const Modal *modal = &plant->modal[passage.cell];
    if (!plant_measure(plant, modal, q, v, plant->y) || !plant_measure_tool(plant, modal, q, plant->y)) {
        return false;
    }
    plant_head(unit)->cell = passage.cell;
    shown->pose_cell = (int)passage.cell;
    shown->pose_crossings = plant_count(shown->pose_crossings, passage.crossings);
    shown->pose_E_kin_lost += passage.kinetic_lost;
    shown->pose_E_el_lost += passage.elastic_lost;
    shown->pose_held = fmax(shown->pose_held, passage.held);
    shown->pose_jump_x_a = plant_jump(plant, slides, ports, shown->pose_jump_x_a);
    shown->pose_jump_n_a = plant_jump(plant, 0, plant->axes, shown->pose_jump_n_a);
    shown->pose_jump_tool = plant_jump(plant, plant->axes, slides, shown->pose_jump_tool);
    return true;
}

static bool plant_step(Unit *unit, double t, double h) {
    (void)t; /* the structure does not change with time */
    Plant *plant = unit_derived(unit);
    Modal *modal = &plant->modal[plant_head(unit)->cell];
    const size_t ports = plant_ports(plant), size = plant->size;
    const uint64_t place = 1 - plant_head(unit)->place;
    double *state = plant_state(unit), *end = plant_state_at(unit, plant, place);
    double *q_end = end + ports, *v_end = q_end + size;
    plant_gather(unit, h, plant->u, plant->du);
    if (plant->driven) {
        plant_take_motors(unit, plant);
    }
    size_t active = plant->axes; /* mostly, no force is on tool and slides: nothing to add then */
    const double *u = plant->u, *du = plant->du;
    for (size_t i = 0; i < ports; i++) {
        end[i] = u[i] + du[i];
    }
    for (size_t i = active; i < ports; i++) {
        active = u[i] != 0 || du[i] != 0 ? i + 1 : active;
    }
    modal_prepare(modal, h);
    modal_advance(modal, active, u, du, state + ports, state + ports + size, q_end, v_end);
    if (plant->driven && !plant_step_transmissions(plant, modal, state, end, h)) {
        return unit_fail(unit, "a force behind a motor would be no finite number at the end of the step");
    }
    if (plant->guided && !plant->driven && !plant_step_guides(plant, modal, state, end, h)) {
        return unit_fail(unit, "a friction force at a guide would be no finite number at the end of the step");
    }
    if (!plant_measure(plant, modal, q_end, v_end, plant->y) ||
        (plant->cells > 1 && !plant_follow(unit, plant, q_end, v_end))) {
        return unit_fail(unit, "an output would be no finite number at the end of the step");
    }
    if (plant->errors) {
        double *ways = plant_ways(plant, end);
        plant_play(unit, plant, plant_ways(plant, state), ways);
        if (!plant_errors_are_numbers(plant, ways)) {
            return unit_fail(unit, "an output would be no finite number at the end of the step");
        }
    }
    if (plant->guided) {
        if (plant->cells > 1) {
            plant_follow_guides(plant, &plant->modal[plant_head(unit)->cell], end);
        }
        for (size_t i = 0; i < plant->axes; i++) {
            plant_guides(plant, end)[i].x = unit_axis(unit, i)->x_0 + plant->y[plant_slides(plant) + i];
        }
        plant_show_guides(unit, plant, end);
    }
    if (plant->driven) {
        plant_follow_transmissions(plant, &plant->modal[plant_head(unit)->cell], end);
    }
    plant_head(unit)->place = place;
    plant_show(unit, plant, plant->y);
    if (plant->driven) {
        plant_show_transmissions(unit, plant, end);
    }
    if (plant->errors) {
        plant_show_play(unit, plant, plant_ways(plant, end));
    }
    if (plant->cells > 1) {
        plant_show_tool(unit, plant, plant->y);
    } else {
        unit_leave_late(unit);
    }
    return true;
}

/* The tool's displacements, a quarter of a step's work, when somebody reads them. */
static void plant_show_late(Unit *unit) {
    Plant *plant = unit_derived(unit);
    const Modal *modal = &plant->modal[plant_head(unit)->cell];
    plant_measure_tool(plant, modal, plant_state(unit) + plant_ports(plant), plant->y);
    plant_show_tool(unit, plant, plant->y);
}

/* Speed of an axis's slide: that of the structure there, unless play lets it stand. */
static double plant_slide_speed(Unit *unit, const Plant *plant, const Modal *modal, size_t axis) {
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

static double plant_tool_speed(Unit *unit, const Plant *plant, const Modal *modal, size_t direction) {
    const double *v = plant_state(unit) + plant_ports(plant) + plant->size;
    const double speed = modal_sum(modal, plant->axes + direction, v);
    return plant->errors ? speed + plant_error_speed(unit, plant, modal, direction) : speed;
}

/* --- derivatives */

static double plant_output_derivative(Unit *unit, unsigned vr) {
    const Plant *plant = unit_derived(unit);
    const Modal *modal = &plant->modal[plant_head(unit)->cell];
    const size_t ports = plant_ports(plant);
    const double *u = plant_state(unit), *q = u + ports, *v = q + plant->size;
    switch (vr) {
    case VR_tool_x_X:
    case VR_tcp_x_X:
        return plant_tool_speed(unit, plant, modal, 0);
    case VR_tool_x_Y:
    case VR_tcp_x_Y:
        return plant_tool_speed(unit, plant, modal, 1);
    case VR_tool_x_Z:
    case VR_tcp_x_Z:
        return plant_tool_speed(unit, plant, modal, 2);
    default:
        break;
    }
    if (vr < SCALAR_ROWS) {
        return 0;
    }
    const size_t axis = (vr - SCALAR_ROWS) / AXIS_ROWS;
    switch ((vr - SCALAR_ROWS) % AXIS_ROWS) {
    case AXIS_VR_n_a:
    case AXIS_VR_n_fr:
        if (plant->transmissions[axis].on) {
            const TransmissionState *motor = &plant_transmissions(plant, plant_state(unit))[axis];
            return (motor->u - motor->C) / plant->transmissions[axis].J;
        }
        return modal_acceleration(modal, axis, ports, u, q, v);
    case AXIS_VR_guide_F_fr:
        return plant_guides(plant, plant_state(unit))[axis].slope;
    case AXIS_VR_x_a:
        return plant->errors ? plant_slide_speed(unit, plant, modal, axis)
                             : modal_sum(modal, plant_slides(plant) + axis, v);
    default:
        return 0;
    }
}

/* The torques and forces act on accelerations: no output reacts at once. */
static double plant_partial(Unit *unit, unsigned output, unsigned input, bool initial) {
    (void)unit;
    (void)output;
    (void)input;
    (void)initial;
    return 0;
}

const Model MODEL = {
    .identifier = "plant",
    .has_resources = true,
    .load = plant_load,
    .derive = plant_derive,
    .state_size = plant_state_size,
    .accepts = plant_accepts,
    .start = plant_start,
    .step = plant_step,
    .late_first = VR_tool_x_X,
    .late_end = VR_tcp_x_Z + 1,
    .show_late = plant_show_late,
    .output_derivative = plant_output_derivative,
    .partial = plant_partial,
    .release = plant_release,
};
