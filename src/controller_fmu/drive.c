#include "drive.h"

void drive_layout(Drive *p) {
    p->x_ring = 0;
    p->n_ring = p->x_ring + (size_t)p->position.x_delay.length;
    p->reference_ring = p->n_ring + (size_t)p->position.n_delay.length;
    p->speed_ring = p->reference_ring + (size_t)p->reference_model.dead_time.length;
    p->samples = p->speed_ring + (size_t)p->measured_speed.window.length;
}

/* The past before the first instant: setpoint and axis stood at their first values, everything else was at rest. It is
 * made here and not at the start, because importers may set the first inputs as late as before the first step. */
static void begin(const Drive *p, DriveState *x, double *lines, const DriveInputs *in) {
    position_start(&p->position, &x->position, lines + p->x_ring, lines + p->n_ring, in->x_s);
    reference_model_start(&p->reference_model, &x->reference_model, lines + p->reference_ring, 0.0);
    measured_speed_start(&p->measured_speed, &x->speed_newest, lines + p->speed_ring, in->x_a);
}

void drive_instant(const Drive *p, DriveState *x, double *lines, const DriveInputs *in) {
    if (x->instant == 0) {
        begin(p, x, lines, in);
    }
    if (x->tick == 0) {
        setpoint_ramp_take(&x->ramp, position_step(&p->position, &x->position, lines + p->x_ring, lines + p->n_ring,
                                                   in->x_s, in->n_ffw, in->x_a));
    }
    x->n_s = setpoint_ramp_value(&p->ramp, &x->ramp, (int32_t)x->tick) + in->n_add;
    x->n_ref = reference_model_step(&p->reference_model, &x->reference_model, lines + p->reference_ring, x->n_s);
    const double n = measured_speed_step(&p->measured_speed, &x->speed_newest, lines + p->speed_ring, in->x_a, in->n_a);
    x->M_s = speed_step(&p->speed, &x->speed, x->n_s, x->n_ref, n, in->M_add);
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
        pmsm_step(&p->motor, &x->right.i, x->u_d, x->u_q, in->n_a, p->T_c);
        x->right.M_a = pmsm_torque(&p->motor, &x->right.i);
    }
    ++x->instant;
    x->tick = x->tick + 1 < p->ticks ? x->tick + 1 : 0;
}
