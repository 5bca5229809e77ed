#include "current.h"

#include <math.h>

CurrentController current_of(double K_p, double T_n, double u_max, double T_c) {
    double ratio = T_c / T_n;
    CurrentController p = {.K_p = K_p, .K_i = K_p * ratio, .tracking = fmin(1.0, ratio), .u_max = u_max};
    return p;
}

void current_step(const CurrentController *p, CurrentState *x, const Pmsm *motor, const PmsmState *i, double i_q_s,
                  double n_a) {
    double omega_e = motor->p * n_a;
    double e_d = -i->i_d;
    double e_q = i_q_s - i->i_q;
    x->I_d += p->K_i * e_d;
    x->I_q += p->K_i * e_q;
    double u_d = p->K_p * e_d + x->I_d - omega_e * motor->L_q * i->i_q;
    double u_q = p->K_p * e_q + x->I_q + omega_e * (motor->L_d * i->i_d + motor->psi);

    double amplitude = sqrt(u_d * u_d + u_q * u_q);
    x->limited = amplitude > p->u_max;
    double share = x->limited ? p->u_max / amplitude : 1.0;
    x->u_d = u_d * share;
    x->u_q = u_q * share;
    x->I_d += p->tracking * (x->u_d - u_d);
    x->I_q += p->tracking * (x->u_q - u_q);
}
