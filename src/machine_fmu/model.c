/* machine: the feed drives of a machine tool in one unit.
 *
 *   inputs   per axis x_s n_ffw (or the motion inside), n_add M_add release; tool.F_X tool.F_Y tool.F_Z
 *   outputs  per axis what its drive, its friction and the structure give: x_a n_a M_a M_fr x_e ...; tool.x_X ...
 *
 * The parts are the units plant, controller, friction and setpoint, their model functions linked once more; they are
 * coupled at the control cycle, as the master couples them (exchange.c). This file holds what is about time.
 *
 * Cycle k lies at t_k = start + k T_c and is counted, so that nothing drifts. A step [t, t + H) works the cycles that
 * begin in that interval, each as a whole: the last one may end behind the step. Then the outputs are those of its
 * inside, at t + H: currents, torques and speeds linear between its ends, positions and displacements cubic by their
 * speeds there. What is sampled belongs to the last instant. So the cycles, and with them the results at common
 * instants, are the same whatever the steps. */
#include <float.h>
#include <math.h>
#include <stdio.h>

#include "instants.h"
#include "machine.h"
#include "numbers.h"

static size_t machine_state_size(const Unit *unit) {
    const Machine *machine = unit_derived(unit);
    return machine->places[1 + 2 * machine->axes];
}

static void machine_start(Unit *unit) {
    Machine *machine = unit_derived(unit);
    machine_bind(unit, true);
    machine_head(unit)->end = machine_state_size(unit);
    machine_head(unit)->share = 1;
    machine->warned_far[false] = machine->warned_far[true] = false;
    if (machine->has_motion) {
        setpoint_part.start(&machine->motion);
    }
    plant_part.start(&machine->plant);
    const bool friction = unit_scalars(unit)->coupling_friction;
    for (size_t i = 0; i < machine->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        AxisState *own = &machine_axis_states(unit)[i];
        axis->friction_n_fr = axis->plant_n_fr;
        friction_part.start(&machine->contacts[i]);
        if (!friction) {
            axis->friction_M_fr = 0;
        }
        own->M_fr = axis->plant_M_fr = axis->friction_M_fr;
        axis->drive_x_a = axis->plant_x_a;
        axis->drive_n_a = axis->plant_n_a;
        if (!unit_scalars(unit)->motion_built_in) {
            axis->motion_x_s = axis->x_s;
            axis->motion_n_ffw = axis->n_ffw;
        }
        axis->drive_x_s = axis->motion_x_s;
        controller_part.start(&machine->drives[i]);
        axis->plant_M_a = axis->drive_M_a;
        axis->x_e_min = axis->x_e_max = axis->drive_x_e;
        axis->x_a_min = axis->x_a_max = axis->plant_x_a;
        axis->M_a_min = axis->M_a_max = axis->drive_M_a;
    }
}

/* --- outputs between two cycles */

static unsigned plant_vr(size_t axis, unsigned row) {
    return (unsigned)(plant_part.scalar_rows + axis * plant_part.axis_rows) + row - PLANT_AXIS_FIRST;
}

/* What the displacements at the tool are made of, in their order. */
static double *tool_displacement(Unit *unit, size_t direction) {
    Scalars *v = unit_scalars(unit);
    double *displacements[] = {&v->plant_tool_x_X, &v->plant_tool_x_Y, &v->plant_tool_x_Z};
    return displacements[direction];
}

static double *tool_point(Unit *unit, size_t direction) {
    Scalars *v = unit_scalars(unit);
    double *points[] = {&v->plant_tcp_x_X, &v->plant_tcp_x_Y, &v->plant_tcp_x_Z};
    return points[direction];
}

static const unsigned tool_vr[] = {VR_plant_tool_x_X - PLANT_FIRST, VR_plant_tool_x_Y - PLANT_FIRST,
                                   VR_plant_tool_x_Z - PLANT_FIRST};

/* Before a cycle that the step's end lies in: where it begins. */
static void keep_start(Unit *unit, Machine *machine) {
    StateHead *head = machine_head(unit);
    for (size_t i = 0; i < machine->axes; i++) {
        const AxisBlock *axis = unit_axis(unit, i);
        AxisState *own = &machine_axis_states(unit)[i];
        own->x_a = axis->plant_x_a;
        own->x_a_v = plant_part.output_derivative(&machine->plant, plant_vr(i, AXIS_VR_plant_x_a));
        own->n_a = axis->plant_n_a;
        own->M_fr_0 = own->M_fr;
    }
    plant_part.show_late(&machine->plant);
    for (size_t d = 0; d < 3; d++) {
        head->tool[d] = *tool_displacement(unit, d);
        head->tool_v[d] = plant_part.output_derivative(&machine->plant, tool_vr[d]);
    }
}

/* Between y_0 with speed v_0 and y_1 with v_1, h [s] apart. */
static double cubic(double y_0, double v_0, double y_1, double v_1, double h, double share) {
    const double rest = 1 - share;
    return rest * rest * ((1 + 2 * share) * y_0 + share * h * v_0) +
           share * share * ((3 - 2 * share) * y_1 - rest * h * v_1);
}

static double line(double y_0, double y_1, double share) {
    return y_0 + share * (y_1 - y_0);
}

static void show_inside(Unit *unit, Machine *machine, double share) {
    const double T_c = machine->T_c, behind = (1 - share) * T_c;
    for (size_t i = 0; i < machine->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        const AxisState *own = &machine_axis_states(unit)[i];
        Part *drive = &machine->drives[i];
        const double v = plant_part.output_derivative(&machine->plant, plant_vr(i, AXIS_VR_plant_x_a));
        axis->plant_x_a = cubic(own->x_a, own->x_a_v, axis->drive_x_a, v, T_c, share);
        axis->plant_n_a = axis->plant_n_fr = line(own->n_a, axis->drive_n_a, share);
        axis->friction_M_fr = line(own->M_fr_0, own->M_fr, share);
        axis->drive_M_a = own->M_a - behind * own->M_a_slope;
        axis->drive_i_d = own->i_d - behind * controller_part.output_derivative(drive, AXIS_VR_drive_i_d - DRIVE_FIRST);
        axis->drive_i_q = own->i_q - behind * controller_part.output_derivative(drive, AXIS_VR_drive_i_q - DRIVE_FIRST);
    }
}

/* Whether what is shown is not that of the last cycle's end. */
static bool inside(const StateHead *head) {
    return head->share < 1 || head->share > 1;
}

/* Ahead of a cycle: what the parts read of their own outputs. */
static void show_end(Unit *unit, const Machine *machine) {
    for (size_t i = 0; i < machine->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        const AxisState *own = &machine_axis_states(unit)[i];
        axis->plant_x_a = axis->drive_x_a;
        axis->plant_n_a = axis->plant_n_fr = axis->drive_n_a;
        axis->friction_M_fr = own->M_fr;
        axis->drive_M_a = own->M_a;
        axis->drive_i_d = own->i_d;
        axis->drive_i_q = own->i_q;
    }
}

static void machine_show_late(Unit *unit) {
    Machine *machine = unit_derived(unit);
    const StateHead *head = machine_head(unit);
    machine_bind(unit, true);
    plant_part.show_late(&machine->plant);
    for (size_t d = 0; inside(head) && d < 3; d++) {
        double *shown = tool_displacement(unit, d), *point = tool_point(unit, d);
        const double offset = *point - *shown;
        const double v = plant_part.output_derivative(&machine->plant, tool_vr[d]);
        *shown = cubic(head->tool[d], head->tool_v[d], *shown, v, machine->T_c, head->share);
        *point = offset + *shown;
    }
}

/* --- steps */

enum { FAR_TEXT_SIZE = 256 };

/* Steps longer than the position cycle, and no derivative says how the setpoints go on: the drives see stairs. */
static void warn_of_held(Unit *unit, Machine *machine, double h) {
    const double T_pos = unit_axis(unit, 0)->drive_T_pos;
    if (machine->warned || unit_scalars(unit)->motion_built_in || unit_scalars(unit)->setpoints_delay > 0 ||
        unit_sloped(unit) || h < (1 + INSTANTS_ROUNDING) * T_pos) {
        return;
    }
    char text[2][NUMBER_TEXT_SIZE];
    unit_warn(
        unit,
        "steps of %s s are longer than the position cycle, %s s, and the setpoints have no slopes: they are held, "
        "and the axes are driven over stairs; give slopes (fmi2SetRealInputDerivatives), shorter steps, a delay of "
        "a step or two for a path through the last samples (setpoints.delay), or a motion inside (motion.built_in)",
        number_text(text[0], h), number_text(text[1], T_pos));
    machine->warned = true;
}

/* Setpoints that begin so far from the axis that the speed controller's gain alone takes it to its torque limit: mostly
 * an input that nothing is connected to, or a pose that is another one here than there; at a later release, setpoints
 * that went on without the axis. */
static double setpoint_of(Unit *unit, const AxisBlock *axis) {
    return unit_scalars(unit)->motion_built_in ? axis->motion_x_s : axis->x_s;
}

static bool begins_far(Unit *unit, const AxisBlock *axis, bool first) {
    if (!axis->release || (!first && axis->drive_release)) {
        return false;
    }
    const double step = axis->drive_K_p * axis->drive_K_v * (setpoint_of(unit, axis) - axis->drive_x_a);
    return fabs(step / axis->drive_I_P) > axis->drive_M_max;
}

/* From the axis `from` on, which is the first that is far. */
static void warn_of_far_axes(Unit *unit, Machine *machine, size_t from, bool first) {
    char axes[FAR_TEXT_SIZE] = "", text[2][NUMBER_TEXT_SIZE];
    size_t at = 0;
    for (size_t i = from; i < machine->axes && at < sizeof axes; i++) {
        const AxisBlock *axis = unit_axis(unit, i);
        if (begins_far(unit, axis, first)) {
            const char *input = unit_scalars(unit)->motion_built_in ? "motion.x_s" : "x_s";
            at +=
                (size_t)snprintf(axes + at, sizeof axes - at, "%s'%s.%s' is %s m and the axis stands at %s m",
                                 at > 0 ? ", " : "", unit_axis_name(unit, i), input,
                                 number_text(text[0], setpoint_of(unit, axis)), number_text(text[1], axis->drive_x_a));
        }
    }
    machine->warned_far[first] = true;
    if (first) {
        unit_warn(
            unit,
            "the first setpoints are far from the axes: %s; the drives go there at their torque limits. Setpoints "
            "begin where the axes stand, which is also the inputs' start value; or set the pose (x_0)",
            axes);
    } else {
        unit_warn(
            unit,
            "setpoints are far from the axes when these are released: %s; the drives go there at their torque limits. "
            "Let setpoints begin where the axes stand at that time",
            axes);
    }
}

/* At every step: the text only where there is one. */
static void warn_of_far(Unit *unit, Machine *machine, bool first) {
    for (size_t i = 0; i < machine->axes && !machine->warned_far[first]; i++) {
        if (begins_far(unit, unit_axis(unit, i), first)) {
            warn_of_far_axes(unit, machine, i, first);
        }
    }
}

/* Motor torque is linear from instant to instant, so that its extremes are there or at the end of the step. */
static void begin_extremes(Unit *unit, const Machine *machine) {
    for (size_t i = 0; i < machine->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        axis->x_e_min = axis->x_a_min = axis->M_a_min = DBL_MAX;
        axis->x_e_max = axis->x_a_max = axis->M_a_max = -DBL_MAX;
    }
}

static void take_torque(AxisBlock *axis, double M_a) {
    axis->M_a_min = M_a < axis->M_a_min ? M_a : axis->M_a_min;
    axis->M_a_max = M_a > axis->M_a_max ? M_a : axis->M_a_max;
}

static void take_position(AxisBlock *axis, double x_a) {
    axis->x_a_min = x_a < axis->x_a_min ? x_a : axis->x_a_min;
    axis->x_a_max = x_a > axis->x_a_max ? x_a : axis->x_a_max;
}

static void take_error(AxisBlock *axis) {
    const double x_e = axis->drive_x_e;
    axis->x_e_min = x_e < axis->x_e_min ? x_e : axis->x_e_min;
    axis->x_e_max = x_e > axis->x_e_max ? x_e : axis->x_e_max;
}

/* At the instant that the next cycle begins with. */
static void take_positions(Unit *unit, const Machine *machine) {
    for (size_t i = 0; i < machine->axes; i++) {
        take_position(unit_axis(unit, i), unit_axis(unit, i)->drive_x_a);
    }
}

/* At the instant that the last cycle began with. */
static void take_instant(Unit *unit, const Machine *machine) {
    for (size_t i = 0; i < machine->axes; i++) {
        const AxisState *own = &machine_axis_states(unit)[i];
        take_torque(unit_axis(unit, i), own->M_a - machine->T_c * own->M_a_slope);
        take_error(unit_axis(unit, i));
    }
}

/* At the end of the step; where no instant lies in it, the following error is that of the last one. */
static void take_end(Unit *unit, const Machine *machine, bool none) {
    for (size_t i = 0; i < machine->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        take_torque(axis, axis->drive_M_a);
        take_position(axis, axis->plant_x_a);
        if (none) {
            take_error(axis);
        }
    }
}

static bool machine_step(Unit *unit, double t, double h) {
    Machine *machine = unit_derived(unit);
    StateHead *head = machine_head(unit);
    const double start_time = unit_start_time(unit), end = t + h, T_c = machine->T_c;
    const double last = end - instants_margin(t, h, T_c);
    double t_k = start_time + (double)head->cycle * T_c;
    if (end - t_k > INSTANTS_MOST * T_c) {
        return instants_too_many(unit, (end - t_k) / T_c, T_c);
    }
    machine_bind(unit, true);
    unit_leave_late(unit); /* ahead: where a cycle fails they are of the state that it has left, shown before or not */
    bool kept = inside(head); /* where the last cycle began */
    if (kept) {
        show_end(unit, machine);
    }
    if (machine_path_used(unit_scalars(unit)) && !machine_path_take(unit, t, h)) {
        return false;
    }
    warn_of_held(unit, machine, h);
    warn_of_far(unit, machine, head->cycle == 0);
    begin_extremes(unit, machine);
    const int64_t first = head->cycle;
    while (t_k < last) {
        const double next = start_time + (double)(head->cycle + 1) * T_c;
        const double share = machine_share(next - end, T_c);
        kept = next >= last && (share < 1 || share > 1);
        if (kept) {
            keep_start(unit, machine);
        }
        take_positions(unit, machine);
        if (!machine_cycle(unit, t, t_k)) {
            return false;
        }
        take_instant(unit, machine);
        head->cycle++;
        t_k = next;
    }
    head->share = kept ? machine_share(t_k - end, T_c) : 1;
    if (inside(head)) {
        show_inside(unit, machine, head->share);
    }
    take_end(unit, machine, head->cycle == first);
    for (size_t i = 0; i < machine->axes; i++) {
        controller_part.show_late(&machine->drives[i]); /* x_m: at the end of the last cycle */
    }
    return true;
}

/* --- derivatives */

static double machine_output_derivative(Unit *unit, unsigned vr) {
    Machine *machine = unit_derived(unit);
    machine_bind(unit, true);
    if (vr < SCALAR_ROWS) {
        return vr >= VR_plant_tool_x_X && vr <= VR_plant_tcp_x_Z
                   ? plant_part.output_derivative(&machine->plant, vr - PLANT_FIRST)
                   : 0;
    }
    const size_t axis = (vr - SCALAR_ROWS) / AXIS_ROWS;
    const unsigned row = (vr - SCALAR_ROWS) % AXIS_ROWS;
    switch (row) {
    case AXIS_VR_plant_n_a:
    case AXIS_VR_plant_n_fr:
    case AXIS_VR_plant_x_a:
        return plant_part.output_derivative(&machine->plant, plant_vr(axis, row));
    case AXIS_VR_drive_M_a:
    case AXIS_VR_drive_i_d:
    case AXIS_VR_drive_i_q:
        return controller_part.output_derivative(&machine->drives[axis], row - DRIVE_FIRST);
    case AXIS_VR_friction_M_fr:
        return unit_scalars(unit)->coupling_friction
                   ? friction_part.output_derivative(&machine->contacts[axis], row - FRICTION_FIRST)
                   : 0;
    default: /* sampled: steps */
        return 0;
    }
}

/* Forces act on accelerations, and drives sample: no input acts on an output at once. Ahead of the first instant x_e
 * shows the difference of its inputs. */
static double machine_partial(Unit *unit, unsigned output, unsigned input, bool initial) {
    if (!initial || output < SCALAR_ROWS || unit_scalars(unit)->motion_built_in) {
        return 0;
    }
    const unsigned row = (output - SCALAR_ROWS) % AXIS_ROWS, first = output - row;
    const bool error = row == AXIS_VR_drive_x_e || row == AXIS_VR_x_e_min || row == AXIS_VR_x_e_max;
    return error && input == first + AXIS_VR_x_s ? 1 : 0;
}

const Model MODEL = {
    .identifier = "machine",
    .has_resources = true,
    .load = machine_load,
    .derive = machine_derive,
    .state_size = machine_state_size,
    .accepts = machine_accepts,
    .start = machine_start,
    .step = machine_step,
    .late_first = VR_plant_tool_x_X,
    .late_end = VR_plant_tcp_x_Z + 1,
    .show_late = machine_show_late,
    .output_derivative = machine_output_derivative,
    .partial = machine_partial,
    .release = machine_release,
};
