#include "drive.h"

void drive_layout(Drive *p) {
    p->x_ring = 0;
    p->n_ring = p->x_ring + (size_t)p->position.x_delay.length;
    p->reference_ring = p->n_ring + (size_t)p->position.n_delay.length;
    p->speed_ring = p->reference_ring + (size_t)p->reference_model.dead_time.length;
    p->table_ring = p->speed_ring + (size_t)p->measured_speed.window.length;
    p->samples = p->table_ring + (p->table.points > 0 ? (size_t)p->table.delay.length : 0);
}

/* The past before the first instant with release: setpoint and axis stood at their present values, everything else was
 * at rest. It is made here and not at the start, because importers may set the first inputs as late as before the first
 * step. */
static void begin(const Drive *p, DriveState *x, double *lines, const DriveInputs *in, double x_s) {
    position_start(&p->position, &x->position, lines + p->x_ring, lines + p->n_ring, x_s);
    reference_model_start(&p->reference_model, &x->reference_model, lines + p->reference_ring, 0.0);
    if (!x->measured) {
        measured_speed_start(&p->measured_speed, &x->speed_newest, lines + p->speed_ring, in->x_a);
    }
    x->pulse = (PulseState){0};
    if (p->table.points > 0) {
        torque_table_start(&p->table, &x->table, lines + p->table_ring);
    }
    x->released = 1;
    x->measured = 1;
}

/* An instant without release: no torque, all memory but that of the measurement as before the first instant. */
static void rest(const Drive *p, DriveState *x, double *lines, const DriveInputs *in) {
    x->released = 0;
    if (x->measured) {
        measured_speed_step(&p->measured_speed, &x->speed_newest, lines + p->speed_ring, in->x_a, in->n_a);
    }
    x->position.x_e = in->x_s - in->x_a;
    x->n_s = 0.0;
    x->n_ref = 0.0;
    x->M_s = 0.0;
    x->ramp = (SetpointRampState){0};
    x->speed = (SpeedState){0};
    x->current = (CurrentState){0};
    for (int32_t i = 0; i < p->filters; ++i) {
        x->filter[i] = (BiquadState){0};
    }
    x->left = x->right;
    x->right = (DriveEnd){0};
    if (p->ideal_current_loop) {
        x->left = x->right;
        return;
    }
    /* Where no current flows the motor's terminals show its electromotive force. It is also what acts in the first
     * cycle with release, for which nothing was computed: a motor that turns would else get a torque from it. */
    x->current.u_q = p->motor.p * in->n_a * p->motor.psi;
    x->u_d = 0.0;
    x->u_q = x->current.u_q;
}

/* `in` as it is measured; the motor itself turns with n_a [rad/s]. */
static void control(const Drive *p, DriveState *x, double *lines, const DriveInputs *in, double n_a) {
    /* The motor first, whose long chain of divisions depends on nothing that follows: a processor does the rest
     * meanwhile. */
    PmsmState current = x->right.i;
    if (!p->ideal_current_loop) {
        pmsm_step(&p->motor, &current, x->current.u_d, x->current.u_q, n_a, p->T_c);
    }
    const bool begins = !x->released;
    if (begins || x->tick == 0) {
        const double x_s = p->corrections.used ? corrections_step(&p->corrections, &x->corrections, in->x_s) : in->x_s;
        if (begins) {
            begin(p, x, lines, in, x_s);
        }
        double n_new =
            position_step(&p->position, &x->position, lines + p->x_ring, lines + p->n_ring, x_s, in->n_ffw, in->x_a);
        if (p->pulse.used) {
            n_new += pulse_step(&p->pulse, &x->pulse, in->n_ffw);
        }
        if (p->table.points > 0) {
            torque_table_step(&p->table, &x->table, lines + p->table_ring, in->n_ffw);
        }
        setpoint_ramp_take(&x->ramp, n_new);
    }
    x->n_s = setpoint_ramp_value(&p->ramp, &x->ramp, (int32_t)x->tick) + in->n_add;
    x->n_ref = reference_model_step(&p->reference_model, &x->reference_model, lines + p->reference_ring, x->n_s);
    const double n = measured_speed_step(&p->measured_speed, &x->speed_newest, lines + p->speed_ring, in->x_a, in->n_a);
    const double M_add = p->table.points > 0 ? in->M_add + x->table.M : in->M_add;
    x->M_s = speed_step(&p->speed, &x->speed, x->n_s, x->n_ref, n, M_add);
    double M = x->M_s;
    for (int32_t i = 0; i < p->filters; ++i) {
        M = biquad_step(&p->filter[i], &x->filter[i], M);
    }

    x->left = x->right;
    if (p->ideal_current_loop) {
        x->right.M_a = M;
        x->right.i.i_q = M / p->K_t;
        x->left = x->right; /* the torque jumps at t_k and is held */
    } else {
        x->u_d = x->current.u_d; /* of the instant before */
        x->u_q = x->current.u_q;
        current_step(&p->current, &x->current, &p->motor, &x->left.i, M / p->K_t, in->n_a);
        x->right.i = current;
        x->right.M_a = pmsm_torque(&p->motor, &x->right.i);
    }
}

/* Cogging and ripple on the torque at the ends of the cycle that was opened. */
static void add_orders(const Drive *p, DriveState *x, double n_a) {
    orders_turn(&p->orders, &x->orders, n_a, p->T_c);
    if (p->ideal_current_loop) { /* its torque jumped: else the beginning is the end of the cycle before */
        x->left.M_a = orders_torque(&p->orders, x->orders.theta, x->left.M_a);
    }
    x->right.M_a = orders_torque(&p->orders, x->orders.ahead, x->right.M_a);
}

void drive_instant(const Drive *p, DriveState *x, double *lines, const DriveInputs *in) {
    DriveInputs measured;
    const double n_a = in->n_a;
    if (p->measuring.used) {
        measured = *in;
        measuring_step(&p->measuring, &x->measuring, x->instant, &measured.x_a, &measured.n_a);
        in = &measured;
    }
    if (in->release) {
        control(p, x, lines, in, n_a);
    } else {
        rest(p, x, lines, in);
    }
    if (p->orders.count > 0) {
        add_orders(p, x, n_a);
    }
    ++x->instant;
    x->tick = x->tick + 1 < p->ticks ? x->tick + 1 : 0;
}

double drive_measured(const Drive *p, const DriveState *x, double x_a, double n_a) {
    if (p->measuring.used) {
        MeasuringState next = x->measuring;
        measuring_step(&p->measuring, &next, x->instant, &x_a, &n_a);
    }
    return x_a;
}
