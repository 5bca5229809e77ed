/* One control cycle: the rows of cycle.h on the parts of the machine. The master works the same rows on units of their
 * own (feedsim/simulation/cosim/schedule.py), so that both give the same bits. */
#include <string.h>

#include "machine.h"

/* An exchange step as its operations see it: vectors with an entry per axis, all at its start but n_end. */
typedef struct Exchange {
    Unit *unit;
    Machine *machine;
    const Scheme *scheme;
    AxisState *axes;
    double t, t_k; /* start of the communication step and of the cycle [s] */
    double h;      /* [s] */
    double *M_a, *M_a_start, *M_a_slope, *M_fr_start, *n_start, *n, *n_slope;
    double *forces; /* as the importer has set them */
} Exchange;

/* --- inputs from outside */

/* An input of the plant that is the importer's, a force: its row in the part, and where it lies in the machine. */
typedef struct Force {
    unsigned row;
    size_t offset;
} Force;

#define FORCE_parameter(field, row, offset)
#define FORCE_local(field, row, offset)
#define FORCE_output(field, row, offset)
#define FORCE_INSIDE(row, offset)
#define FORCE_OUTSIDE(row, offset) {row, offset},
#define FORCE_input(field, row, offset) ROWS_JOINED(FORCE_, FROM_plant_##field)(row, offset)
#undef SCALAR_ROW
#undef AXIS_ROW
#define AXIS_ROW(...)
#define SCALAR_ROW(kind, field, name, c, ...)                                                                          \
    FORCE_##c(field, VR_plant_##field - PLANT_FIRST, offsetof(Scalars, plant_##field))
static const Force machine_forces[] = {
#include "plant_variables.def"
};
#undef SCALAR_ROW
#undef AXIS_ROW
#define SCALAR_ROW(...)
#define AXIS_ROW(kind, field, name, c, ...)                                                                            \
    FORCE_##c(field, AXIS_VR_plant_##field - PLANT_AXIS_FIRST, offsetof(AxisBlock, plant_##field))
static const Force axis_forces[] = {
#include "plant_variables.def"
};
/* as table.h has them */
#undef SCALAR_ROW
#undef AXIS_ROW
#define SCALAR_ROW(...) VARIABLE(__VA_ARGS__)
#define AXIS_ROW(...) AXIS_VARIABLE(__VA_ARGS__)
enum {
    MACHINE_FORCES = sizeof machine_forces / sizeof machine_forces[0],
    AXIS_FORCES = sizeof axis_forces / sizeof axis_forces[0]
};

size_t machine_scratch(size_t axes) {
    return MACHINE_FORCES + axes * (AXIS_FORCES + (size_t)VECTORS);
}

/* Force i of all: its value, its slope to the plant, and its reference in the machine. */
typedef struct ForcePlace {
    double *value, *slope;
    unsigned vr;
} ForcePlace;

static ForcePlace force_place(const Exchange *x, size_t i) {
    double *slopes = x->machine->plant.slopes;
    if (i < MACHINE_FORCES) {
        const Force *force = &machine_forces[i];
        return (ForcePlace){(double *)(void *)((unsigned char *)unit_scalars(x->unit) + force->offset),
                            slopes + force->row, PLANT_FIRST + force->row};
    }
    const size_t axis = (i - MACHINE_FORCES) / AXIS_FORCES;
    const Force *force = &axis_forces[(i - MACHINE_FORCES) % AXIS_FORCES];
    return (ForcePlace){(double *)(void *)((unsigned char *)unit_axis(x->unit, axis) + force->offset),
                        slopes + plant_part.scalar_rows + axis * plant_part.axis_rows + force->row,
                        (unsigned)(SCALAR_ROWS + axis * AXIS_ROWS) + PLANT_AXIS_FIRST + force->row};
}

static size_t force_count(const Exchange *x) {
    return unit_sloped(x->unit) ? MACHINE_FORCES + x->machine->axes * AXIS_FORCES : 0; /* else they stay as they are */
}

static void keep_forces(const Exchange *x) {
    for (size_t i = 0; i < force_count(x); i++) {
        x->forces[i] = *force_place(x, i).value;
    }
}

/* Forces run linearly from the beginning of the communication step: their value `since` then [s], and their slope. */
static void tell_forces(const Exchange *x, double since) {
    for (size_t i = 0; i < force_count(x); i++) {
        const ForcePlace force = force_place(x, i);
        *force.slope = unit_slope(x->unit, force.vr);
        *force.value = x->forces[i] + *force.slope * since;
    }
}

/* What the importer has set stays as it has set it. */
static void hand_back_forces(const Exchange *x) {
    for (size_t i = 0; i < force_count(x); i++) {
        const ForcePlace force = force_place(x, i);
        *force.value = x->forces[i];
        *force.slope = 0;
    }
}

/* What the drive of an axis reads at t_k in a communication step that began at t. */
static void tell_drive(Unit *unit, size_t i, double t, double t_k) {
    AxisBlock *axis = unit_axis(unit, i);
    axis->drive_n_add = axis->n_add;
    axis->drive_M_add = axis->M_add;
    axis->drive_release = axis->release;
    if (unit_sloped(unit)) {
        const unsigned first = (unsigned)(SCALAR_ROWS + i * AXIS_ROWS);
        axis->drive_n_add += unit_slope(unit, first + AXIS_VR_n_add) * (t_k - t);
        axis->drive_M_add += unit_slope(unit, first + AXIS_VR_M_add) * (t_k - t);
    }
    if (unit_scalars(unit)->motion_built_in) {
        axis->drive_x_s = axis->motion_x_s;
        axis->drive_n_ffw = axis->motion_n_ffw;
    } else {
        machine_path_tell(unit, i, t, t_k);
        axis->motion_x_s = axis->drive_x_s; /* the setpoint in use, wherever it comes from */
        axis->motion_n_ffw = axis->drive_n_ffw;
    }
}

/* --- drives */

static bool step_drives(const Exchange *x) {
    for (size_t i = 0; i < x->machine->axes; i++) {
        Part *drive = &x->machine->drives[i];
        AxisState *own = &x->axes[i];
        const AxisBlock *axis = unit_axis(x->unit, i);
        tell_drive(x->unit, i, x->t, x->t_k);
        if (!controller_part.step(drive, x->t_k, x->machine->T_c)) {
            return false;
        }
        own->M_a = axis->drive_M_a;
        own->i_d = axis->drive_i_d;
        own->i_q = axis->drive_i_q;
        own->M_a_slope = controller_part.output_derivative(drive, AXIS_VR_drive_M_a - DRIVE_FIRST);
        x->M_a_slope[i] = x->scheme->torque_ramp ? own->M_a_slope : 0;
    }
    return true;
}

/* --- plant and friction */

static bool step_plant(const Exchange *x) {
    Machine *machine = x->machine;
    for (size_t i = 0; i < machine->axes; i++) {
        AxisBlock *axis = unit_axis(x->unit, i);
        double *slopes = machine->plant.slopes + plant_part.scalar_rows + i * plant_part.axis_rows;
        axis->plant_M_a = x->M_a[i];
        axis->plant_M_fr = x->axes[i].M_fr;
        slopes[AXIS_VR_plant_M_a - PLANT_AXIS_FIRST] = x->M_a_slope[i];
        slopes[AXIS_VR_plant_M_fr - PLANT_AXIS_FIRST] = x->scheme->friction_ramp ? x->axes[i].M_fr_slope : 0;
    }
    return plant_part.step(&machine->plant, 0, x->h); /* the structure does not change with time */
}

static bool step_friction(const Exchange *x) {
    const size_t axes = unit_scalars(x->unit)->coupling_friction ? x->machine->axes : 0;
    const bool ramp = x->scheme->friction_ramp;
    const bool speed_ramp = x->scheme->speed == SPEED_within || x->scheme->speed == SPEED_extrapolated;
    Part *contact = x->machine->contacts;
    for (size_t i = 0; i < axes; i++, contact++) {
        AxisBlock *axis = unit_axis(x->unit, i);
        axis->friction_n_fr = x->n[i];
        contact->slopes[AXIS_VR_friction_n_fr - FRICTION_FIRST] = speed_ramp ? x->n_slope[i] : 0;
        if (!friction_part.step(contact, 0, x->h)) { /* nor does its law */
            return false;
        }
        x->axes[i].M_fr = axis->friction_M_fr;
        if (ramp) {
            x->axes[i].M_fr_slope = friction_part.output_derivative(contact, AXIS_VR_friction_M_fr - FRICTION_FIRST);
        }
    }
    return true;
}

/* --- steps that are taken again */

/* Copy what plant and friction are made of between the block and `kept`. */
static bool copy_kept(const Exchange *x, bool back) {
    const Machine *machine = x->machine;
    const size_t first = machine->places[0], states = machine->places[1 + machine->axes] - first;
    const size_t axes = machine->axes * sizeof(AxisBlock);
    const struct {
        void *own;
        size_t size;
    } pieces[] = {{(unsigned char *)unit_state(x->unit) + first, states},
                  {unit_scalars(x->unit), sizeof(Scalars)},
                  {unit_axis(x->unit, 0), axes}};
    unsigned char *kept = machine->kept;
    for (size_t i = 0; i < sizeof pieces / sizeof pieces[0]; kept += pieces[i++].size) {
        memcpy(back ? pieces[i].own : kept, back ? kept : pieces[i].own, pieces[i].size);
    }
    return true;
}

static bool step_keep(const Exchange *x) {
    return copy_kept(x, false);
}

static bool step_restore(const Exchange *x) {
    return copy_kept(x, true);
}

/* --- the rows of cycle.h */

/* a vector at axis i */
#define AT_M_a x->M_a[i]
#define AT_M_a_start x->M_a_start[i]
#define AT_M_a_end x->axes[i].M_a
#define AT_M_a_before x->axes[i].M_a_before
#define AT_M_a_slope x->M_a_slope[i]
#define AT_M_fr x->axes[i].M_fr
#define AT_M_fr_start x->M_fr_start[i]
#define AT_n x->n[i]
#define AT_n_slope x->n_slope[i]
#define AT_n_slope_last x->axes[i].n_slope
#define AT_n_start x->n_start[i]
#define AT_n_end unit_axis(x->unit, i)->plant_n_fr
/* a number */
#define NUMBER_back_a_cycle (-x->machine->T_c)
#define NUMBER_since since
#define NUMBER_h x->h
/* when */
#define WHEN_always true
#define WHEN_torque_ramps x->scheme->torque_ramp
#define WHEN_torque_constant !x->scheme->torque_ramp
#define WHEN_two_passes x->scheme->passes > 1
#define WHEN_second_pass pass > 0
#define WHEN_plant_first !x->scheme->friction_first
#define WHEN_friction_first x->scheme->friction_first
#define WHEN_speed_end x->scheme->speed == SPEED_end
#define WHEN_speed_start x->scheme->speed == SPEED_start
#define WHEN_speed_within x->scheme->speed == SPEED_within
#define WHEN_speed_extrapolated x->scheme->speed == SPEED_extrapolated

#define ON_EVERY_AXIS for (size_t i = 0; i < x->machine->axes; i++)
#define DO_copy(y, a)                                                                                                  \
    ON_EVERY_AXIS {                                                                                                    \
        AT_##y = AT_##a;                                                                                               \
    }
#define DO_line(y, a, s, b)                                                                                            \
    ON_EVERY_AXIS {                                                                                                    \
        AT_##y = AT_##a + NUMBER_##s * AT_##b;                                                                         \
    }
#define DO_rate(y, a, b, s)                                                                                            \
    ON_EVERY_AXIS {                                                                                                    \
        AT_##y = (AT_##a - AT_##b) / NUMBER_##s;                                                                       \
    }
#define DO_call(what)                                                                                                  \
    if (!step_##what(x)) {                                                                                             \
        return false;                                                                                                  \
    }
#define DO(when, what, ...)                                                                                            \
    if (WHEN_##when) {                                                                                                 \
        DO_##what(__VA_ARGS__)                                                                                         \
    }

static bool step_speed(const Exchange *x) {
    SPEED_GIVEN(DO)
    return true;
}

static bool begin_cycle(const Exchange *x) {
    CYCLE_BEGINS(DO)
    return true;
}

/* since: the start of the exchange step after that of the cycle [s] */
static bool exchange_step(const Exchange *x, double since) {
    EXCHANGE_BEGINS(DO)
    for (int pass = 0; pass < x->scheme->passes; pass++) {
        EXCHANGE_PASS(DO)
    }
    return true;
}

static Exchange exchange_of(Unit *unit, Machine *machine, double t, double t_k) {
    double *v = machine->vectors;
    const size_t n = machine->axes;
    return (Exchange){.unit = unit,
                      .machine = machine,
                      .scheme = machine->scheme,
                      .axes = machine_axis_states(unit),
                      .t = t,
                      .t_k = t_k,
                      .h = machine->T_c / (double)machine->substeps,
                      .M_a = v,
                      .M_a_start = v + n,
                      .M_a_slope = v + 2 * n,
                      .M_fr_start = v + 3 * n,
                      .n_start = v + 4 * n,
                      .n = v + 5 * n,
                      .n_slope = v + 6 * n,
                      .forces = v + VECTORS * n};
}

bool machine_cycle(Unit *unit, double t, double t_k) {
    Machine *machine = unit_derived(unit);
    const Exchange x = exchange_of(unit, machine, t, t_k);
    keep_forces(&x);
    bool good = begin_cycle(&x);
    for (size_t j = 0; good && j < machine->substeps; j++) {
        const double since = (double)j * x.h;
        tell_forces(&x, t_k - t + since);
        good = exchange_step(&x, since);
    }
    hand_back_forces(&x);
    for (size_t i = 0; i < machine->axes; i++) {
        AxisBlock *axis = unit_axis(unit, i);
        axis->drive_x_a = axis->plant_x_a;
        axis->drive_n_a = axis->plant_n_a;
    }
    return good && (!unit_scalars(unit)->motion_built_in || setpoint_part.step(&machine->motion, t_k, machine->T_c));
}
