/* Sampled part of the monolithic reference: position, speed and current control of one axis, with its motor. */
#ifndef MONOLITHIC_CONTROL_H
#define MONOLITHIC_CONTROL_H

typedef struct {
    /* parameters, SI */
    double T_c, T_pos, I_P, K_v, k_ffw, T_dyn, T_sym, K_p, T_n, omega_0, D, M_max;
    double f, D_num, D_den;     /* band-stop; f = 0: off */
    double R, L_d, L_q, p, K_t; /* motor; K_t = 3/2 p psi */
    double K_p_current, T_n_current, u_max;
    double symmetry_lag, ramp, integrator, reference_model, ideal_current_loop, emf_feedforward; /* switches, 0 or 1 */
    double x_start; /* position before the first setpoint */
} Drive;

/* numerator b, denominator 1, a1, a2; transposed direct form II */
typedef struct {
    double b[3], a[2], s[2];
} Section;

typedef struct {
    Drive drive;
    const double *x_s,
        *n_ffw; /* setpoints on the T_pos grid; before the first: x_start and 0, after the last: the last */
    int setpoints;
    Section reference, band_stop;
    double lag, lag_input; /* symmetry filter as a first-order lag: its output and last input */
    double n_old, n_new, speed_integral, current_integral[2], u[2], i[2];
    /* observables of the last sample */
    double x_e, n_s, n_ref, M_s, i_sample[2];
} Control;

void control_start(Control *control);

/* Works at sample k with what was measured there; returns the motor torque at sample k + 1. */
double control_sample(Control *control, long k, double x_a, double n_a);

#endif
