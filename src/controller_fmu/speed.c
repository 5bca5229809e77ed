#include "speed.h"

#include <math.h>

SpeedController speed_of(double K_p, double T_n, bool integrator, double M_max, double T_c) {
    double ratio = integrator ? T_c / T_n : 0.0;
    SpeedController p = {.K_p = K_p, .K_i = K_p * ratio, .tracking = fmin(1.0, ratio), .M_max = M_max};
    return p;
}

double speed_step(const SpeedController *p, SpeedState *x, double n_s, double n_ref, double n_a, double M_add) {
    x->I += p->K_i * (n_ref - n_a);
    double M = p->K_p * (n_s - n_a) + x->I + M_add;
    double M_s = M > p->M_max ? p->M_max : M < -p->M_max ? -p->M_max : M; /* no number stays none */
    x->limited = M_s != M;
    x->I += p->tracking * (M_s - M);
    return M_s;
}
