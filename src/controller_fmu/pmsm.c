#include "pmsm.h"

#include <math.h>

#define SMALL 0.5       /* bound of the eigenvalues' magnitude for the series */
#define TERMS 14        /* of the series; the first one left out is below SMALL^14/15! = 5e-17 */
#define MAX_HALVINGS 64 /* ends the loop at speeds beyond all physics: 2^64 SMALL rad per cycle */

/* The matrix f_0 + f_1 Z. */
typedef struct Pair {
    double f_0, f_1;
} Pair;

static Pair product(Pair a, Pair b, double trace, double det) {
    double square = a.f_1 * b.f_1; /* factor of Z^2 = trace Z - det */
    Pair c = {a.f_0 * b.f_0 - square * det, a.f_0 * b.f_1 + a.f_1 * b.f_0 + square * trace};
    return c;
}

/* 1 + Z f / k. */
static Pair one_plus(Pair f, double k, double trace, double det) {
    Pair c = {1.0 - f.f_1 * det / k, (f.f_0 + f.f_1 * trace) / k};
    return c;
}

/* phi(Z) = (exp(Z) - 1)/Z = 1 + Z/2 (1 + Z/3 (1 + ...)) for a matrix Z of given trace and determinant. */
static Pair phi(double trace, double det) {
    double bound = fabs(trace) / 2.0 + sqrt(fabs(trace * trace / 4.0 - det));
    int halvings = 0;
    while (bound > SMALL && halvings < MAX_HALVINGS) {
        bound *= 0.5;
        trace *= 0.5;
        det *= 0.25;
        ++halvings;
    }
    Pair f = {1.0, 0.0};
    for (int k = TERMS; k >= 2; --k) {
        f = one_plus(f, k, trace, det);
    }
    for (; halvings > 0; --halvings) {
        /* phi(2 Z) = phi(Z) (exp(Z) + 1)/2, exp(Z) = 1 + Z phi(Z); then count in 2 Z. */
        f = product(f, one_plus(f, 2.0, trace, det), trace, det);
        f.f_1 *= 0.5;
        trace *= 2.0;
        det *= 4.0;
    }
    return f;
}

double pmsm_flux_linkage(double K_t, double p) {
    return K_t / (1.5 * p);
}

void pmsm_step(const Pmsm *p, PmsmState *x, double u_d, double u_q, double n, double h) {
    double omega_e = p->p * n;
    double rate_d = (u_d - p->R * x->i_d + omega_e * p->L_q * x->i_q) / p->L_d;
    double rate_q = (u_q - p->R * x->i_q - omega_e * (p->L_d * x->i_d + p->psi)) / p->L_q;

    double Z_dd = -h * p->R / p->L_d;
    double Z_dq = h * omega_e * p->L_q / p->L_d;
    double Z_qd = -h * omega_e * p->L_d / p->L_q;
    double Z_qq = -h * p->R / p->L_q;
    Pair f = phi(Z_dd + Z_qq, Z_dd * Z_qq - Z_dq * Z_qd);

    x->i_d += h * (f.f_0 * rate_d + f.f_1 * (Z_dd * rate_d + Z_dq * rate_q));
    x->i_q += h * (f.f_0 * rate_q + f.f_1 * (Z_qd * rate_d + Z_qq * rate_q));
}

double pmsm_torque(const Pmsm *p, const PmsmState *x) {
    return 1.5 * p->p * (p->psi * x->i_q + (p->L_d - p->L_q) * x->i_d * x->i_q);
}
