/* Speed controller: PI, the P part on the speed setpoint, the I part on the reference model's output.
 *
 *   I(t_k) = I(t_k-1) + K_p T_c/T_n (n_ref - n_a)(t_k)
 *   M(t_k) = K_p (n_s - n_a)(t_k) + I(t_k) + M_add(t_k)
 *   M_s    = M limited to +-M_max
 *   I(t_k) = I(t_k) + min(1, T_c/T_n) (M_s - M)(t_k)             anti-windup
 *
 * Order: compute, saturate, then update the integrator with what was realised. While the limit holds, I tends to the
 * value at which M leaves the limit as soon as the error behind it turns round (time constant T_n); without limit the
 * last line adds 0. No FMI. */
#ifndef FEEDSIM_SPEED_H
#define FEEDSIM_SPEED_H

#include <stdbool.h>

#include "prefix.h"

#define speed_of PREFIXED(speed_of)
#define speed_step PREFIXED(speed_step)

typedef struct SpeedController {
    double K_p;      /* [N.m.s/rad] */
    double K_i;      /* K_p T_c/T_n [N.m.s/rad]; 0: P controller */
    double tracking; /* min(1, T_c/T_n) [1]; 0: P controller */
    double M_max;    /* [N.m] */
} SpeedController;

typedef struct SpeedState {
    double I;    /* integral part [N.m] */
    int limited; /* at the last instant; 0 or not: any bytes of a saved state are an int, few a bool */
} SpeedState;

/* K_p [N.m.s/rad] >= 0, T_n [s] > 0, cycle T_c [s], M_max [N.m] >= 0; integrator false: P controller. */
SpeedController speed_of(double K_p, double T_n, bool integrator, double M_max, double T_c);

/* One instant: speeds [rad/s], M_add [N.m] -> M_s [N.m]. */
double speed_step(const SpeedController *p, SpeedState *x, double n_s, double n_ref, double n_a, double M_add);

#endif
