/* plant: the mechanical structure of a machine with its feed drives, reduced to modes.
 *
 *   q_k'' + 2 zeta_k omega_k q_k' + omega_k^2 q_k = f_k          per mode k, mass-normalised
 *
 *   f_k      = sum over axes A of (n_kA (M_a - M_fr - M_0) + x_kA (F_a - guide.F_fr))
 *              + sum over directions d of tcp_kd F_d
 *
 *   n_a      = n_fr = sum over k of n_kA q_k'                     rotor against stator [rad/s]
 *
 *   x_a      = x_0 + sum over k of x_kA q_k                       slide against rail, at the linear scale [m]
 *
 *   tool.x_d = sum over k of tcp_kd q_k                           tool against workpiece [m]
 *              with play and geometry: geometry.h
 *
 *   tcp.x_d  = tool.x_d + x_0 of the axis named d                 tool centre point [m]
 *
 * M_a motor torque, M_fr friction torque, M_0 constant load [N.m]; F_a force on the slide, F_d on the tool [N]; omega_k
 * = 2 pi frequency; n_kA, x_kA, tcp_kd: mode shapes at the ports, columns of the mode table (modes.h).
 *
 * With mounts (mount.h) that are not linear, f_k gets -b_kp (F_p(x_p) - K_p x_p) per direction p of each besides,
 * x_p = sum over k of b_kp q_k, K_p the spring that the modes hold.
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
    const Plant *plant = unit_derived(unit);
    return sizeof(StateHead) + 2 * (plant_state_doubles(plant) + plant_mounts_doubles(plant)) * sizeof(double);
}

/* --- start and step */

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

static void plant_start(Unit *unit) {
    Plant *plant = unit_derived(unit);
    double *u = plant_state(unit), *q = u + plant_ports(plant), *v = q + plant->size;
    StateHead *head = plant_head(unit);
    Scalars *shown = unit_scalars(unit);
    plant_gather(unit, 0, u, plant->du);
    plant_measure(plant, &plant->modal[0], q, v, plant->y); /* at rest, whatever the cell */
    plant_measure_tool(plant, &plant->modal[0], q, plant->y);
    plant_positions(unit, plant, plant->y + plant_slides(plant), plant->x);
    plant_start_joints(unit, plant, u);
    plant_show_guides(unit, plant, plant_state(unit));
    head->table_hash = plant->table_hash;
    head->cell = plant->cells > 1 ? cells_find(&plant->poses, plant->x) : 0;
    plant_show(unit, plant, plant->y);
    plant_show_tool(unit, plant, plant->y);
    shown->pose_cell = (int)head->cell;
    shown->pose_crossings = 0;
    shown->mounts_E = shown->mounts_x_max = 0;
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

/* Step `index` of `count` equal ones of h, with what is measured at its end in y. */
static bool plant_advance(Unit *unit, Plant *plant, double h, size_t index, size_t count) {
    Modal *modal = &plant->modal[plant_head(unit)->cell];
    const size_t ports = plant_ports(plant), size = plant->size;
    const uint64_t place = 1 - plant_head(unit)->place;
    double *state = plant_state(unit), *end = plant_state_at(unit, plant, place);
    double *q_end = end + ports, *v_end = q_end + size;
    const bool joined = plant->guided || plant->driven, mounted = plant->mounts.on;
    plant_gather(unit, h * (double)count, plant->u, plant->du);
    for (size_t i = 0; count > 1 && i < ports; i++) {
        plant->du[i] /= (double)count;
        plant->u[i] += (double)index * plant->du[i];
    }
    modal_prepare(modal, h);
    const double *u = plant->u, *du = plant->du;
    size_t acting = 0;
    if (mounted && !plant_pace_mounts(unit, plant, h)) {
        return false;
    }
    if (joined && !plant_join(unit, plant, modal, state, end, h, &acting)) {
        return false;
    }
    for (size_t i = 0; i < ports; i++) {
        end[i] = u[i] + du[i];
    }
    const double *held = mounted ? plant_mounts_held(unit, plant, plant_mounts_block(plant, state)) : NULL;
    const double *q = state + ports, *v = q + size;
    if (plant->guided) {
        modal_advance_at(modal, acting, plant->shapes, plant->u_acting, plant->du_acting, held, q, v, q_end, v_end);
    } else {
        size_t active = plant->axes; /* mostly, no force is on tool and slides: nothing to add then */
        for (size_t i = active; i < ports; i++) {
            active = u[i] != 0 || du[i] != 0 ? i + 1 : active;
        }
        if (mounted) {
            modal_advance_held(modal, active, u, du, held, q, v, q_end, v_end);
        } else {
            modal_advance(modal, active, u, du, q, v, q_end, v_end);
        }
    }
    if (!plant_measure(plant, modal, q_end, v_end, plant->y) ||
        (plant->cells > 1 && !plant_follow(unit, plant, q_end, v_end))) {
        return unit_fail(unit, "an output would be no finite number at the end of the step");
    }
    if (mounted && !plant_follow_mounts(unit, plant, state, end, h)) {
        return unit_fail(unit, "the force of a mount would be no finite number at the end of the step");
    }
    if (plant->errors) {
        double *ways = plant_ways(plant, end);
        plant_play(unit, plant, plant_ways(plant, state), ways);
        if (!plant_errors_are_numbers(plant, ways)) {
            return unit_fail(unit, "an output would be no finite number at the end of the step");
        }
    }
    if (joined) {
        plant_follow_joints(unit, plant, &plant->modal[plant_head(unit)->cell], end);
    }
    plant_head(unit)->place = place;
    return true;
}

static bool plant_step(Unit *unit, double t, double h) {
    (void)t; /* the structure does not change with time */
    Plant *plant = unit_derived(unit);
    size_t count = 1;
    if (plant->driven && !plant_substeps(unit, plant, h, &count)) {
        return false;
    }
    for (size_t i = 0; i < count; i++) {
        if (!plant_advance(unit, plant, count > 1 ? h / (double)count : h, i, count)) {
            return false;
        }
    }
    double *end = plant_state(unit);
    plant_show(unit, plant, plant->y);
    if (plant->guided || plant->driven) {
        plant_show_guides(unit, plant, end);
        plant_show_transmissions(unit, plant, end);
    }
    if (plant->mounts.on) {
        plant_show_mounts(unit, plant, end);
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

/* --- derivatives */

static double plant_mounts_acceleration(Unit *unit, const Plant *plant, const Modal *modal, size_t axis) {
    const int block = plant->mounts.on ? plant_mounts_block(plant, plant_state(unit)) : 0;
    return plant->mounts.on ? modal_sum(modal, axis, plant_mounts_held(unit, plant, block)) : 0;
}

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
        return modal_acceleration(modal, axis, ports, u, q, v) + plant_mounts_acceleration(unit, plant, modal, axis);
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
