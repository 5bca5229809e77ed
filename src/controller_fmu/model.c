/* controller: position, speed and current control of one feed axis, with its synchronous motor.
 *
 *   inputs   x_s n_ffw (taken over every T_pos), x_a n_a n_add M_add release (every T_c)
 *   output   M_a, linear over a control cycle; the rest are observables
 *
 * Equations, symbols and units stand in the headers of the blocks: position.h (delay.h, lag.h), setpoint_ramp.h,
 * reference_model.h, measured_speed.h, speed.h, biquad.h, current.h, pmsm.h, and of what real drives have besides, off
 * by default: orders.h, measuring.h, corrections.h; drive.h puts them in order; README.md shows the whole. Source:
 * Wiesauer, Bleicher, 18th CIRP CMMO (2021), section 2.2. This file holds what is about time and about the unit's
 * interface.
 *
 * Instant k lies at t_k = start + k T_c; k is counted, so that nothing drifts. A step [t, t + H) works the instants in
 * that interval and reads the inputs at each, value + slope (t_k - t). H may be anything. */
#include <math.h>

#include "drive.h"
#include "instants.h"
#include "numbers.h"
#include "unit.h"

typedef struct State {
    DriveState drive;
    double lines[]; /* delay lines */
} State;

/* Derived data. */
typedef struct Controller {
    Drive drive;
    bool warned; /* of orders too fast for the sampling rate */
} Controller;

/* --- parameters to coefficients */

static bool derive_cycles(Unit *unit, const Scalars *v, Drive *p) {
    double ratio = v->T_pos / v->T_c;
    double ticks = round(ratio);
    /* Times of four significant digits that do not fit are off by far more, quotients of doubles by far less. */
    if (ticks < 1.0 || fabs(ratio - ticks) > 1e-9 * ticks) {
        char text[3][NUMBER_TEXT_SIZE];
        return unit_fail(unit, "T_pos = %s s is not a whole multiple of T_c = %s s (ratio %s)",
                         number_text(text[0], v->T_pos), number_text(text[1], v->T_c),
                         number_text(text[2], round(1e10 * ratio) / 1e10));
    }
    p->T_c = v->T_c;
    p->ticks = (int32_t)ticks;
    return true;
}

static bool derive_filters(Unit *unit, const Scalars *v, Drive *p) {
    const struct {
        const char *name;
        int type;
        double f, D_num, D_den;
    } filters[FILTERS] = {
        {"filter_1", v->filter_1_type, v->filter_1_f, v->filter_1_D_num, v->filter_1_D_den},
        {"filter_2", v->filter_2_type, v->filter_2_f, v->filter_2_D_num, v->filter_2_D_den},
        {"filter_3", v->filter_3_type, v->filter_3_f, v->filter_3_D_num, v->filter_3_D_den},
        {"filter_4", v->filter_4_type, v->filter_4_f, v->filter_4_D_num, v->filter_4_D_den},
    };
    const double pi = acos(-1.0);
    bool good = true;
    p->filters = 0;
    for (int i = 0; i < FILTERS; ++i) {
        if (filters[i].type == 0) {
            continue;
        }
        if (filters[i].f >= 0.5 / v->T_c) {
            char text[2][NUMBER_TEXT_SIZE];
            good = unit_fail(unit, "%s.f = %s Hz is not below half the sampling rate, 1/(2 T_c) = %s Hz",
                             filters[i].name, number_text(text[0], filters[i].f), number_text(text[1], 0.5 / v->T_c));
            continue;
        }
        double K = tan(pi * filters[i].f * v->T_c);
        p->filter[p->filters++] = filters[i].type == 1 ? biquad_band_stop(K, filters[i].D_num, filters[i].D_den)
                                                       : biquad_low_pass(K, filters[i].D_den);
    }
    return good;
}

static void derive_blocks(const Scalars *v, Drive *p) {
    const PositionParameters position = {.T_pos = v->T_pos,
                                         .I_P = v->I_P,
                                         .K_v = v->K_v,
                                         .k_ffw = v->k_ffw,
                                         .T_dyn = v->T_dyn,
                                         .T_sym = v->T_sym,
                                         .symmetry_lag = v->symmetry_lag != 0};
    p->position = position_of(&position);
    p->ramp.ticks = p->ticks;
    p->ramp.ramped = v->ramp_speed_setpoint != 0;
    p->reference_model = reference_model_of(v->reference_model != 0, v->omega_0, v->D, v->T_ref, v->T_c);
    p->measured_speed = measured_speed_of(v->speed_window, v->T_c, v->I_P);
    p->speed = speed_of(v->K_p, v->T_n, v->speed_integrator != 0, v->M_max, v->T_c);
    p->ideal_current_loop = v->ideal_current_loop != 0;
    p->K_t = v->K_t;
    p->current = current_of(v->current_K_p, v->current_T_n, v->u_max, v->T_c);
    p->motor.R = v->R;
    p->motor.L_d = v->L_d;
    p->motor.L_q = v->L_q;
    p->motor.p = v->p;
    p->motor.psi = pmsm_flux_linkage(v->K_t, v->p);
}

/* Rows of a table over position lie one behind the other in the unit's table: e_0 ... e_10. */
static void derive_effects(const Scalars *v, Drive *p) {
    p->orders.count = 0;
    orders_add(&p->orders, v->cogging_1_order, v->cogging_1_amplitude, v->cogging_1_phase, 0);
    orders_add(&p->orders, v->cogging_2_order, v->cogging_2_amplitude, v->cogging_2_phase, 0);
    orders_add(&p->orders, v->cogging_3_order, v->cogging_3_amplitude, v->cogging_3_phase, 0);
    orders_add(&p->orders, v->ripple_1_order, v->ripple_1_amplitude, v->ripple_1_phase, 1);
    orders_add(&p->orders, v->ripple_2_order, v->ripple_2_amplitude, v->ripple_2_phase, 1);
    orders_add(&p->orders, v->ripple_3_order, v->ripple_3_amplitude, v->ripple_3_phase, 1);

    Measuring *m = &p->measuring;
    *m = (Measuring){.indirect = v->measuring_indirect != 0,
                     .T_c = v->T_c,
                     .I_P = v->I_P,
                     .linear = v->measuring_linear,
                     .resolution = v->measuring_resolution,
                     .noise = v->measuring_noise,
                     .seed = (uint64_t)v->measuring_seed,
                     .eccentricity = v->encoder_eccentricity,
                     .eccentric_phase = v->encoder_phase};
    measuring_add(m, v->periodic_error_1_period, v->periodic_error_1_amplitude, v->periodic_error_1_phase);
    measuring_add(m, v->periodic_error_2_period, v->periodic_error_2_amplitude, v->periodic_error_2_phase);
    measuring_add(m, v->periodic_error_3_period, v->periodic_error_3_amplitude, v->periodic_error_3_phase);
    m->table = points_of(v->measuring_table_first, v->measuring_table_spacing, &v->measuring_table_e_0);
    m->used = m->indirect || m->periodic_errors > 0 || m->table.used || fabs(m->linear) > 0 || m->resolution > 0 ||
              m->noise > 0 || fabs(m->eccentricity) > 0;

    Corrections *c = &p->corrections;
    c->resolution = v->setpoint_resolution;
    c->backlash = v->backlash_compensation_value;
    c->change = v->backlash_compensation_ramp > 0 ? fmin(2, 2 * v->T_pos / v->backlash_compensation_ramp) : 2;
    c->leadscrew =
        points_of(v->leadscrew_compensation_first, v->leadscrew_compensation_spacing, &v->leadscrew_compensation_e_0);
    c->leadscrew_minus = points_of(v->leadscrew_compensation_minus_first, v->leadscrew_compensation_minus_spacing,
                                   &v->leadscrew_compensation_minus_e_0);
    c->used = fabs(c->backlash) > 0 || c->leadscrew.used;
}

/* Friction compensations. Accelerations and speeds of points have to rise: a table between them would have no value. */
static bool derive_compensation(Unit *unit, const Scalars *v, Drive *p) {
    FrictionPulse *u = &p->pulse;
    *u = (FrictionPulse){.used = fabs(v->friction_pulse_amplitude) > 0 ||
                                 (v->friction_pulse_adaptation != 0 && fabs(v->friction_pulse_amplitude_min) > 0),
                         .adaptation = v->friction_pulse_adaptation != 0,
                         .resolution = v->setpoint_resolution,
                         .I_P = v->I_P,
                         .T_pos = v->T_pos,
                         .amplitude = v->friction_pulse_amplitude,
                         .min = v->friction_pulse_amplitude_min,
                         .acceleration = {v->friction_pulse_acceleration_1, v->friction_pulse_acceleration_2,
                                          v->friction_pulse_acceleration_3},
                         .T = v->friction_pulse_time,
                         .wait = fmax(0.0, v->T_dyn + v->friction_pulse_delay)};
    bool good = true;
    for (int i = 0; u->used && u->adaptation && i < 2; ++i) {
        if (u->acceleration[i] > u->acceleration[i + 1]) {
            char text[2][NUMBER_TEXT_SIZE];
            good = unit_fail(unit, "friction_pulse.acceleration_%d = %s m/s2 is above acceleration_%d = %s m/s2", i + 1,
                             number_text(text[0], u->acceleration[i]), i + 2,
                             number_text(text[1], u->acceleration[i + 1]));
        }
    }
    TorqueTable *t = &p->table;
    *t = (TorqueTable){.points = v->friction_table_points,
                       .resolution = v->setpoint_resolution,
                       .I_P = v->I_P,
                       .T_pos = v->T_pos,
                       .distance = v->friction_table_distance,
                       .delay = delay_linear(fmax(0.0, v->T_dyn + v->T_sym + v->friction_table_delay) / v->T_pos)};
    const double *speed = &v->friction_table_speed_0, *torque = &v->friction_table_torque_0;
    for (int i = 0; i < t->points; ++i) {
        t->speed[i] = speed[i];
        t->torque[i] = torque[i];
        if (i > 0 && !(speed[i] > speed[i - 1])) {
            char text[2][NUMBER_TEXT_SIZE];
            good = unit_fail(unit, "friction_table.speed_%d = %s m/s is not above speed_%d = %s m/s", i,
                             number_text(text[0], speed[i]), i - 1, number_text(text[1], speed[i - 1]));
        }
    }
    return good;
}

static bool derive_drive(Unit *unit, const Scalars *v, Drive *p) {
    bool cycles = derive_cycles(unit, v, p);
    bool filters = derive_filters(unit, v, p);
    if (!cycles || !filters) {
        return false;
    }
    derive_blocks(v, p);
    derive_effects(v, p);
    if (!derive_compensation(unit, v, p)) {
        return false;
    }
    drive_layout(p);
    return true;
}

static bool derive(Unit *unit) {
    Controller *p = unit_derived(unit);
    if (p == NULL) {
        p = unit_alloc(unit, 1, sizeof *p);
        if (p == NULL) {
            return false;
        }
        unit_set_derived(unit, p);
    }
    return derive_drive(unit, unit_scalars(unit), &p->drive);
}

static size_t state_size(const Unit *unit) {
    const Drive *p = &((const Controller *)unit_derived(unit))->drive;
    return sizeof(State) + p->samples * sizeof(double);
}

static void release(Unit *unit) {
    unit_free(unit, unit_derived(unit));
    unit_set_derived(unit, NULL);
}

/* The counts of a saved state, within what the parameters saved with it make of them. */
static bool accepts(Unit *unit, const Scalars *scalars, const void *state, size_t size) {
    Drive p;
    if (!derive_drive(unit, scalars, &p)) {
        return false;
    }
    if (size < sizeof(State)) {
        return unit_fail(unit, "the state holds %.0f bytes of model state, without delay lines alone it has %.0f",
                         (double)size, (double)sizeof(State));
    }
    const DriveState *x = &((const State *)state)->drive;
    const struct {
        const char *name;
        int64_t value, end;
    } counts[] = {
        {"sample instant", x->instant, INSTANTS_COUNTED},
        {"cycle within T_pos", x->tick, p.ticks},
        {"place in the delay line of x_s", x->position.x_newest, p.position.x_delay.length},
        {"place in the delay line of n_ffw", x->position.n_newest, p.position.n_delay.length},
        {"place in the delay line of T_ref", x->reference_model.newest, p.reference_model.dead_time.length},
        {"place in the delay line of speed_window", x->speed_newest, p.measured_speed.window.length},
        {"place in the delay line of friction_table", x->table.newest, p.table.points > 0 ? p.table.delay.length : 1},
    };
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; ++i) {
        if (counts[i].value < 0 || counts[i].value >= counts[i].end) {
            return unit_fail(unit, "the state is out of range: %s is %.0f; allowed is 0 to %.0f", counts[i].name,
                             (double)counts[i].value, (double)(counts[i].end - 1));
        }
    }
    if (!instants_agree(unit, unit_clock_behind(unit, scalars), x->instant, p.T_c)) {
        return false;
    }
    return x->instant % p.ticks == x->tick ||
           unit_fail(unit,
                     "the state contradicts itself: behind %.0f sample instants it is in cycle %.0f of %.0f within "
                     "T_pos",
                     (double)x->instant, (double)x->tick, (double)p.ticks);
}

/* --- time */

/* What the outputs show that belong to the last instant. */
static void show_instant(Scalars *v, const DriveState *x) {
    unit_show(&v->x_e, x->position.x_e);
    unit_show(&v->n_s, x->n_s);
    unit_show(&v->n_ref, x->n_ref);
    unit_show(&v->M_s, x->M_s);
    unit_show(&v->u_d, x->u_d);
    unit_show(&v->u_q, x->u_q);
    v->torque_limited = x->speed.limited != 0;
    v->voltage_limited = x->current.limited != 0;
}

/* What runs linearly over the cycle, at `share` [1] of it. */
static void show_cycle(Scalars *v, const DriveState *x, double share) {
    if (share == 1.0) { /* exactly the cycle's end */
        unit_show(&v->M_a, x->right.M_a);
        unit_show(&v->i_d, x->right.i.i_d);
        unit_show(&v->i_q, x->right.i.i_q);
        return;
    }
    v->M_a = x->left.M_a + share * (x->right.M_a - x->left.M_a);
    v->i_d = x->left.i.i_d + share * (x->right.i.i_d - x->left.i.i_d);
    v->i_q = x->left.i.i_q + share * (x->right.i.i_q - x->left.i.i_q);
}

/* The measured position belongs to the present x_a, which an importer sets behind the step that led there. */
static void show_measured(Unit *unit) {
    const Drive *p = &((const Controller *)unit_derived(unit))->drive;
    Scalars *v = unit_scalars(unit);
    v->x_m = drive_measured(p, &((const State *)unit_state(unit))->drive, v->x_a, v->n_a);
}

static void start(Unit *unit) {
    const State *state = unit_state(unit);
    Scalars *v = unit_scalars(unit);
    show_instant(v, &state->drive);
    show_cycle(v, &state->drive, 1.0);
    v->x_e = v->x_s - v->x_a;
    show_measured(unit);
}

/* Inputs `since` the start of the step [s]. */
static DriveInputs inputs_at(Unit *unit, double since) {
    const Scalars *v = unit_scalars(unit);
    DriveInputs in = {.x_s = v->x_s,
                      .n_ffw = v->n_ffw,
                      .x_a = v->x_a,
                      .n_a = v->n_a,
                      .n_add = v->n_add,
                      .M_add = v->M_add,
                      .release = v->release != 0};
    if (unit_sloped(unit)) {
        in.x_s += unit_slope(unit, VR_x_s) * since;
        in.n_ffw += unit_slope(unit, VR_n_ffw) * since;
        in.x_a += unit_slope(unit, VR_x_a) * since;
        in.n_a += unit_slope(unit, VR_n_a) * since;
        in.n_add += unit_slope(unit, VR_n_add) * since;
        in.M_add += unit_slope(unit, VR_M_add) * since;
    }
    return in;
}

/* A wave sampled at fewer than five points of its period is shown as another one. */
static void warn_of_orders(Unit *unit, Controller *controller, double n) {
    const Drive *p = &controller->drive;
    const double order = orders_too_fast(&p->orders, n, p->T_c);
    if (order > 0) {
        char text[3][NUMBER_TEXT_SIZE];
        unit_warn(unit,
                  "a torque of order %s has %s Hz at n_a = %s rad/s, above a fifth of the sampling rate 1/T_c: it acts "
                  "with another shape then; lower the order or T_c, or leave it out at such speeds",
                  number_text(text[0], order), number_text(text[1], order * fabs(n) / (2 * acos(-1.0))),
                  number_text(text[2], n));
        controller->warned = true;
    }
}

static bool step(Unit *unit, double t, double h) {
    Controller *controller = unit_derived(unit);
    const Drive *p = &controller->drive;
    State *state = unit_state(unit);
    DriveState *x = &state->drive;
    Scalars *v = unit_scalars(unit);
    const double start_time = unit_start_time(unit);
    const double end = t + h;
    double t_k = start_time + (double)x->instant * p->T_c;
    if (end - t_k > INSTANTS_MOST * p->T_c) {
        return instants_too_many(unit, (end - t_k) / p->T_c, p->T_c);
    }
    const double last = end - instants_margin(t, h, p->T_c);
    while (t_k < last) {
        const DriveInputs in = inputs_at(unit, t_k - t);
        drive_instant(p, x, state->lines, &in);
        t_k = start_time + (double)x->instant * p->T_c;
    }

    if (x->instant > 0) {
        const double ahead = t_k - end; /* of the cycle, what lies behind the end of the step [s] */
        show_instant(v, x);
        show_cycle(v, x, instants_share(ahead, p->T_c));
        unit_leave_late(unit);
    }
    if (p->orders.count > 0 && !controller->warned) {
        warn_of_orders(unit, controller, x->orders.n);
    }
    return true;
}

/* Slope over the cycle that the communication point ends or lies in; 0 at the start, where there is none yet. */
static double output_derivative(Unit *unit, unsigned vr) {
    const Drive *p = &((const Controller *)unit_derived(unit))->drive;
    const State *state = unit_state(unit);
    const DriveEnd *left = &state->drive.left;
    const DriveEnd *right = &state->drive.right;
    switch (vr) {
    case VR_M_a:
        return (right->M_a - left->M_a) / p->T_c;
    case VR_i_d:
        return (right->i.i_d - left->i.i_d) / p->T_c;
    case VR_i_q:
        return (right->i.i_q - left->i.i_q) / p->T_c;
    default: /* sampled: steps */
        return 0.0;
    }
}

/* Of x_m, its rounding left out: small ways, over which the errors of measuring are straight. */
static double partial_of_measured(Unit *unit, unsigned input, bool initial) {
    Drive drive = ((const Controller *)unit_derived(unit))->drive;
    const DriveState *x = &((const State *)unit_state(unit))->drive;
    const Scalars *v = unit_scalars(unit);
    drive.measuring.resolution = 0.0;
    if (initial || !drive.measuring.used) {
        return input == VR_x_a ? 1.0 : 0.0;
    }
    const double dx = input == VR_x_a ? 1e-8 : 0.0, dn = input == VR_n_a ? 1e-2 : 0.0;
    return (drive_measured(&drive, x, v->x_a + dx, v->n_a + dn) - drive_measured(&drive, x, v->x_a - dx, v->n_a - dn)) /
           (2.0 * (dx + dn));
}

/* The other outputs are sampled or computed from samples: no input acts on one at once. Ahead of the first instant x_e
 * shows the difference of its inputs. */
static double partial(Unit *unit, unsigned output, unsigned input, bool initial) {
    if (output == VR_x_m) {
        return input == VR_x_a || input == VR_n_a ? partial_of_measured(unit, input, initial) : 0.0;
    }
    if (!initial || output != VR_x_e) {
        return 0.0;
    }
    return input == VR_x_s ? 1.0 : input == VR_x_a ? -1.0 : 0.0;
}

const Model MODEL = {.identifier = "controller",
                     .load = NULL,
                     .derive = derive,
                     .state_size = state_size,
                     .accepts = accepts,
                     .start = start,
                     .step = step,
                     .late_first = VR_x_m,
                     .late_end = VR_x_m + 1,
                     .late_reads_inputs = true,
                     .show_late = show_measured,
                     .output_derivative = output_derivative,
                     .partial = partial,
                     .release = release};
